"""What workers elsewhere must share with this command: its code, and its folders."""

from __future__ import annotations

import errno
import uuid
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from sweeps.engine.code import OtherCode, check_code
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.packs import ROOM, open_own, write_whole


class Apart(RuntimeError):
    """A worker does not see a folder of the command."""


class Shared(NamedTuple):
    """Digests of packages by name, and the files, with their content, that mark folders."""

    code: Mapping[str, str] = {}
    marks: tuple[tuple[str, str], ...] = ()

    def check(self) -> None:
        """Raise `OtherCode` or `Apart` if this process has other code or does not see a folder."""
        check_code(self.code)
        for path, token in self.marks:
            _check_mark(path, token)


UNSHARED = (OtherCode, Apart)
"""Errors of `Shared.check`."""


@contextmanager
def marked(folders: Iterable[Path]) -> Iterator[tuple[tuple[str, str], ...]]:
    """Write a file into each of some folders, and remove them afterwards; yield path and content.

    A folder that is full or cannot be written is left out, since no worker can use it either.
    Raises ConfigurationError if files there belong to another user than that of this process.
    """
    marks: list[tuple[str, str]] = []
    with ExitStack() as stack:
        for folder in folders:
            token = uuid.uuid4().hex
            # By this name it is found after a crash, as one of an unfinished pack.
            mark = folder.absolute() / ROOM / f"{token}.partial"
            with suppress(OSError):
                write_whole(folder.absolute(), f"{ROOM}/{mark.name}", [token.encode()])
                stack.callback(mark.unlink, missing_ok=True)
                marks.append((str(mark), token))
        try:
            Shared(marks=tuple(marks)).check()
        except Apart as error:
            raise ConfigurationError(f"this process {error}") from None
        yield tuple(marks)


@cache
def _check_mark(path: str, token: str) -> None:
    """Raise `Apart` if the file that marks a folder is not seen by this process, or another's."""
    folder, found = str(Path(path).parent.parent), b""
    try:
        with open_own(Path(path)) as file:
            found = file.read()
    except OSError as error:
        if error.errno == errno.EPERM:
            raise Apart(
                f"sees files of another user in {folder!r}; it must run as the same user"
            ) from None
    if found != token.encode():
        raise Apart(
            f"does not see the folder {folder!r} of this command; it must be on a file system that "
            "all of them share"
        )
