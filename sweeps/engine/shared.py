"""What workers elsewhere must share with this command: its code, and the folder of its cache."""

from __future__ import annotations

import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from sweeps.engine.code import OtherCode, check_code
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.packs import ROOM, is_own, write_whole


class Apart(RuntimeError):
    """A worker does not see the folder of the command."""


class Shared(NamedTuple):
    """Digests of packages by name, and the file that marks the folder; empty if there is none."""

    code: Mapping[str, str] = {}
    mark: str = ""

    def check(self) -> None:
        """Raise `OtherCode` or `Apart` if this process has other code or sees no such folder."""
        check_code(self.code)
        if self.mark:
            _check_mark(self.mark)


UNSHARED = (OtherCode, Apart)
"""Errors of `Shared.check`."""


@contextmanager
def marked(folder: Path) -> Iterator[str]:
    """Write a file of a unique name into a folder, and remove it afterwards; yield its path.

    Raises ConfigurationError if files there belong to another user than that of this process, and
    OSError if none can be written.
    """
    # By this name it is found after a crash, as one of an unfinished pack.
    mark = folder.absolute() / ROOM / f"{uuid.uuid4().hex}.partial"
    write_whole(folder.absolute(), f"{ROOM}/{mark.name}", [])
    try:
        _check_mark(str(mark))
        yield str(mark)
    except Apart as error:
        raise ConfigurationError(f"this process {error}") from None
    finally:
        with suppress(OSError):
            mark.unlink()


@cache
def _check_mark(path: str) -> None:
    """Raise `Apart` if the file that marks a folder is not seen by this process, or another's."""
    folder = str(Path(path).parent.parent)
    try:
        is_seen = is_own(Path(path))
    except OSError:
        raise Apart(
            f"does not see the folder {folder!r} of this command; it must be on a file system that "
            "all of them share"
        ) from None
    if not is_seen:
        raise Apart(f"sees files of another user in {folder!r}; it must run as the same user")
