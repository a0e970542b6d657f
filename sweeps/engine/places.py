"""Places: folders, and prefixes of buckets, as objects by name; by one interface, of obstore.

What is written as URL has its credentials and its endpoint from the environment, by obstore's own
rules; they stand in no message.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from obstore.exceptions import (
    AlreadyExistsError,
    BaseError,
    PermissionDeniedError,
    UnauthenticatedError,
)
from obstore.store import LocalStore, MemoryStore, ObjectStore, from_url

from sweeps.engine.errors import ConfigurationError

Where = Path | str
"""A folder, or a URL."""

SCHEMES = ("s3", "gs", "az")
OPEN = 0o755  # mode of folders: others may read them
RETRIES = 6  # of a request, with growing pauses: some seconds

# A Path keeps one slash of a URL; several schemes may be chained.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.:-]*:/")
_OF_BUCKET = re.compile(rf"(?:{'|'.join(SCHEMES)})://[^/@?#:]+(?:/[^/@?#:]+)*")
_NUMBER = re.compile(r"\(os error (\d+)\)")


def where(key: str, given: Where) -> Where:
    """Return a setting's value as a path, or as a URL of a bucket without a slash at its end.

    Raises ConfigurationError if it is a URL of another kind, which may also have a secret in it.
    """
    if not _URL.match(str(given)):
        return Path(given)
    url = str(given).rstrip("/")
    if not _OF_BUCKET.fullmatch(url):
        kinds = ", ".join(f"{scheme}://BUCKET/NAME" for scheme in SCHEMES)
        shown = re.sub(r"//[^/]*@|[?#].*", lambda found: found[0][:1] + "...", url)
        raise ConfigurationError(
            f"{key} is {shown!r}, but must be a folder on a file system or a URL such as {kinds}: "
            "other URLs are not supported, and credentials belong to the environment"
        )
    return url


def opened(place: Where, *, make: bool = False) -> ObjectStore:
    """Return a place as obstore's; a folder that is not there is empty, or made if `make`."""
    if isinstance(place, str):
        return from_url(place, retry_config={"max_retries": RETRIES})
    if make:
        make_folder(place, OPEN)
    elif not place.is_dir():
        return MemoryStore()
    return LocalStore(place, automatic_cleanup=True)


def make_folder(path: Path, mode: int) -> None:
    """Make a folder and its missing parents, with at most this mode; the umask may say less."""
    if path.is_dir():
        return
    for part in reversed((path, *path.parents)):
        if not part.is_dir():
            with suppress(FileExistsError):  # made by another process just now
                part.mkdir(mode)


@contextmanager
def told(place: Where) -> Iterator[None]:
    """Raise what a place cannot do as OSError of one line, and FileNotFoundError as it is.

    The number is that of the operating system, where one is known, and else EIO: a disk or a
    network that failed. What a server says is left out beyond its status: it may repeat a key.
    """
    try:
        yield
    except FileNotFoundError:
        raise
    except BaseError as error:
        line = str(error).partition("\n")[0]
        if number := _NUMBER.search(line):
            code = int(number[1])
            raise OSError(code, os.strerror(code), str(place)) from None
        denied = isinstance(error, PermissionDeniedError | UnauthenticatedError)
        words = re.sub(r"\?[^\s)]*|//[^/\s]*@", "", line.partition("<")[0]).strip(" :")
        raise OSError(errno.EACCES if denied else errno.EIO, words, str(place)) from None


@dataclass(frozen=True)
class Objects:
    """Objects of a place, by name. It is sent away as its place alone.

    Every method raises OSError if the place fails; only an object that is not there is absent.
    """

    place: Where
    make: bool = False  # the folder when it is written

    @cached_property
    def store(self) -> ObjectStore:
        """The place as obstore's."""
        with told(self.place):
            return opened(self.place, make=self.make)

    def __reduce__(self) -> tuple[type[Objects], tuple[Where, bool]]:
        return Objects, (self.place, self.make)

    def get(self, name: str) -> bytes | None:
        """Return an object; None if it is absent."""
        try:
            with told(self.place):
                return bytes(self.store.get(name).bytes())
        except FileNotFoundError:
            return None

    def put(self, name: str, content: bytes) -> None:
        """Write an object: readers see it whole, or as it was before."""
        with told(self.place), _there(self.place):
            self.store.put(name, content, use_multipart=False)

    def create(self, name: str, content: bytes) -> bool:
        """Write a new object; return False if there is one. Of several at once, one succeeds."""
        try:
            with told(self.place), _there(self.place):
                self.store.put(name, content, mode="create", use_multipart=False)
        except FileExistsError:
            return False
        return True

    def copy(self, name: str, to: str) -> bool:
        """Copy an object in its place, by a link on a disk; return False if that cannot be."""
        try:
            with told(self.place):
                self.store.copy(name, to)
        except OSError:
            return False
        return True

    def delete(self, names: Iterable[str]) -> None:
        """Delete objects, which may be absent."""
        for name in names:
            with suppress(FileNotFoundError), told(self.place):
                self.store.delete(name)

    def sizes(self, under: str = "") -> dict[str, int]:
        """Return the bytes of all objects, or of those under a prefix, by name."""
        with told(self.place), _there(self.place):
            parts = self.store.list(under or None)
            return {one["path"]: one["size"] for part in parts for one in part}


@contextmanager
def _there(place: Where) -> Iterator[None]:
    """Raise OSError where a bucket, and not an object, is absent, or an object is there."""
    try:
        yield
    except AlreadyExistsError:
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(place)) from None
    except FileNotFoundError:
        raise OSError(errno.ENXIO, "there is no such bucket or folder", str(place)) from None
