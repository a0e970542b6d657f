"""Objects of a folder or a bucket, by name, with one interface, on top of obstore.

A bucket's credentials and endpoint come from the environment, by obstore's own rules; no message
contains them.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from obstore.exceptions import (
    AlreadyExistsError,
    BaseError,
    PermissionDeniedError,
    PreconditionError,
    UnauthenticatedError,
)
from obstore.store import LocalStore, MemoryStore, ObjectStore, from_url

from sweeps.engine.declare.paths import PathOrUrl

if TYPE_CHECKING:
    from obstore import ObjectMeta

PUBLIC_MODE = 0o755  # mode of folders: others may read them
PRIVATE_MODE = 0o700  # mode of folders that others may not even read
UNREACHABLE = errno.ECONNABORTED  # errno of a server that cannot be reached, or fails
RETRIES = 6  # retries of a request, with exponential backoff over some seconds

REQUESTS = 16  # requests under way

Version = dict[str, str]
"""Version of an object of a bucket, as its server numbers them."""

Item = TypeVar("Item")
Result = TypeVar("Result")

_OS_ERROR_NUMBER = re.compile(r"\(os error (\d+)\)")


def open_store(
    path: PathOrUrl, *, create: bool = False, mode: int = PUBLIC_MODE, remove_empty: bool = True
) -> ObjectStore:
    """Return the obstore of a path; with `create`, make a missing folder, else treat it as empty.

    With `remove_empty`, the store removes folders that become empty; then no other process may
    write to them.
    """
    if isinstance(path, str):
        return from_url(path, retry_config={"max_retries": RETRIES})
    if create:
        ensure_folder(path, mode)
    elif not path.is_dir():
        return MemoryStore()
    return LocalStore(path, automatic_cleanup=remove_empty)


def ensure_folder(path: Path, mode: int) -> None:
    """Make a folder and its missing parents, with at most this mode; the umask may say less."""
    if path.is_dir():
        return
    for folder in reversed((path, *path.parents)):
        if not folder.is_dir():
            with suppress(FileExistsError):  # made by another process just now
                folder.mkdir(mode)


@contextmanager
def translated_errors(path: PathOrUrl, *, whole: bool = False) -> Iterator[None]:
    """Translate obstore errors into OSErrors with a message of one line.

    The errno is the operating system's if the message has one, EACCES if access is denied, else
    EIO for a folder and `UNREACHABLE` for a bucket. Cut a server's message after its status, since
    the rest may repeat a key. If something is absent, raise FileNotFoundError, or ENXIO if `whole`
    says that it is the whole folder or bucket.
    """
    try:
        yield
    except (AlreadyExistsError, PreconditionError):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
    except FileNotFoundError:
        if whole:
            message = "there is no such bucket or folder"
            raise OSError(errno.ENXIO, message, str(path)) from None
        raise
    except BaseError as error:
        line = str(error).partition("\n")[0]
        if number := _OS_ERROR_NUMBER.search(line):
            code = int(number[1])
            raise OSError(code, os.strerror(code), str(path)) from None
        denied = isinstance(error, PermissionDeniedError | UnauthenticatedError)
        words = re.sub(r"\?[^\s)]*|//[^/\s]*@", "", line.partition("<")[0]).strip(" :")
        failed = errno.EIO if isinstance(path, Path) else UNREACHABLE
        raise OSError(errno.EACCES if denied else failed, words, str(path)) from None


@contextmanager
def world_readable() -> Iterator[None]:
    """Create files that others may read, unless the umask forbids it, but not write."""
    # os.umask can only read the mask by setting it. Set the strictest meanwhile, since other
    # threads may be creating private files.
    before = os.umask(0o077)
    os.umask(before | 0o022)
    try:
        yield
    finally:
        os.umask(before)


@dataclass(frozen=True)
class Objects:
    """Objects of a folder or bucket, by name; pickled as its path, cached in each process.

    A missing object is not an error; an inaccessible path raises OSError.
    """

    path: PathOrUrl
    create: bool = False  # whether a write makes the folder
    mode: int = PUBLIC_MODE  # of the made folder
    remove_empty: bool = True  # whether folders that become empty are removed

    @cached_property
    def store(self) -> ObjectStore:
        """The obstore of the path."""
        with translated_errors(self.path):
            return open_store(
                self.path, create=self.create, mode=self.mode, remove_empty=self.remove_empty
            )

    def __reduce__(self) -> tuple[Any, ...]:
        return _cached_objects, (self.path, self.create, self.mode, self.remove_empty)

    def get(self, name: str) -> bytes | None:
        """Return an object; None if it is absent."""
        stored = self.get_versioned(name)
        return stored and stored[0]

    def put(self, name: str, content: bytes | Iterator[bytes]) -> None:
        """Write an object atomically."""
        with translated_errors(self.path, whole=True):
            self.store.put(name, content, use_multipart=False)

    def read_range(self, name: str, begin: int, end: int) -> memoryview:
        """Return a range of bytes, cut at the end; FileNotFoundError if the object is absent."""
        # Reading a file here takes a sixth of the time of obstore, which uses another thread.
        if isinstance(self.path, Path):
            with open(f"{self.path}/{name}", "rb", buffering=0) as file:
                size = os.fstat(file.fileno()).st_size
                return memoryview(os.pread(file.fileno(), max(min(end, size) - begin, 0), begin))
        with translated_errors(self.path):
            content = self.store.get_range(name, start=begin, end=end) if begin < end else b""
        return memoryview(content)

    def get_versioned(self, name: str) -> tuple[bytes, Version] | None:
        """Return an object and its version; None if it is absent."""
        try:
            with translated_errors(self.path):
                result = self.store.get(name)
                return bytes(result.bytes()), _version(result.meta)
        except FileNotFoundError:
            return None

    def head(self, name: str) -> ObjectMeta | None:
        """Return size, time and version of an object; None if it is absent."""
        try:
            with translated_errors(self.path):
                return self.store.head(name)
        except FileNotFoundError:
            return None

    def put_if(self, name: str, content: bytes, version: Version | None) -> Version | None:
        """Write an object of a bucket if it still has `version`; None means that it is absent.

        Returns the new version, or None if the version differs, so that only one of several
        concurrent writers succeeds.
        """
        mode: Any = version or "create"
        try:
            with translated_errors(self.path, whole=True):
                return _version(self.store.put(name, content, mode=mode, use_multipart=False))
        except FileExistsError:
            return None

    def delete(self, names: Iterable[str]) -> None:
        """Delete objects, which may be absent."""
        self.map(self._delete, names)

    def _delete(self, name: str) -> None:
        with suppress(FileNotFoundError), translated_errors(self.path):
            self.store.delete(name)

    def map(self, function: Callable[[Item], Result], given: Iterable[Item]) -> list[Result]:
        """Call a function on each item in concurrent threads; return the results in order."""
        with ThreadPoolExecutor(REQUESTS) as pool:
            return list(pool.map(function, given))

    def list_objects(self, under: str = "") -> dict[str, ObjectMeta]:
        """Return size and time of all objects, or all under a prefix, by name."""
        with translated_errors(self.path, whole=True):
            return {meta["path"]: meta for page in self.store.list(under or None) for meta in page}

    def sizes(self, under: str = "") -> dict[str, int]:
        """Return the bytes of all objects, or all under a prefix, by name."""
        return {name: meta["size"] for name, meta in self.list_objects(under).items()}

    def delete_unfinished(self) -> None:
        """Delete the unfinished files of killed writers in a folder."""
        for file in self.path.rglob("*#[0-9]*") if isinstance(self.path, Path) else ():
            if not file.is_dir():  # of a variable with such a name
                file.unlink(missing_ok=True)

    def remove_empty_folders(self) -> None:
        """Remove a folder and the folders in it if they are empty."""
        for folder, *_ in os.walk(self.path, topdown=False):  # yields nothing for a URL
            with suppress(OSError):
                os.rmdir(folder)


def _version(meta: Mapping[str, Any]) -> Version:
    """Return the version of an object: a tag, a number, or both."""
    return {name: meta[name] for name in ("e_tag", "version") if meta.get(name)}


@lru_cache(maxsize=8)
def _cached_objects(*fields: Any) -> Objects:
    return Objects(*fields)
