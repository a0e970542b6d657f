"""A folder put in the place of another whole."""

from __future__ import annotations

import ctypes
import errno
import os
import re
import shutil
import uuid
from pathlib import Path

PARTIAL = "partial"  # suffix of what is not whole yet, or being deleted
ASIDE = "aside"  # suffix of what stood in the place, where two folders cannot be exchanged

_HERE = -100  # AT_FDCWD: paths are relative to the working directory
_EXCHANGE = 2  # RENAME_EXCHANGE
_UNSUPPORTED = {errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP, errno.EPERM}


def hidden(place: Path, suffix: str) -> Path:
    """New name beside a place, hidden and unlike any other."""
    return place.with_name(f".{place.name}.{uuid.uuid4().hex}.{suffix}")


def put_in_place(partial: Path, place: Path) -> None:
    """Put a folder in its place; what was there before is then at `partial`.

    Readers see the old folder or the new one at any time; where the file system cannot exchange
    two folders they see none for a moment.
    """
    if not os.path.lexists(place):
        partial.rename(place)
    elif not _exchange(partial, place):
        aside = hidden(place, ASIDE)
        try:
            place.rename(aside)
            partial.rename(place)
        except BaseException:
            if not os.path.lexists(place):
                aside.rename(place)
            raise
        aside.rename(partial)


def remove_orphans(place: Path) -> None:
    """Remove what killed writers left beside a place; only for who holds its lock.

    A folder that a killed writer set aside goes back, if nothing is in its place.
    """
    pattern = re.compile(rf"\.{re.escape(place.name)}\.[0-9a-f]{{32}}\.({PARTIAL}|{ASIDE})")
    for found in sorted(place.parent.iterdir()):
        match = pattern.fullmatch(found.name)
        if match and match[1] == ASIDE and not os.path.lexists(place):
            found.rename(place)
        elif match:
            shutil.rmtree(found, ignore_errors=True)


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two folders at once; False where that is not supported."""
    try:
        renameat2 = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False
    if renameat2(_HERE, os.fsencode(one), _HERE, os.fsencode(other), ctypes.c_uint(_EXCHANGE)) == 0:
        return True
    code = ctypes.get_errno()
    if code in _UNSUPPORTED:
        return False
    raise OSError(code, os.strerror(code), str(one), None, str(other))
