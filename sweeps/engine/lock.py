"""The lock of a store: one writer at a time."""

from __future__ import annotations

import fcntl
import json
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.replacement import remove_orphans
from sweeps.engine.target import real_place


@contextmanager
def locked(path: Path, *, say: Callable[[str], object] | None = None) -> Iterator[None]:
    """Hold the lock of a store, which need not exist; remove what killed writers of it left.

    The lock is a file beside the store that is locked by the operating system, which lets go of
    it when the process that holds it ends in any way. It is advisory, and holds between the nodes
    of a cluster only if its file system has `flock` across them.

    Raises
    ------
    ConfigurationError
        If another process or thread holds it, or nothing can be locked there.
    """
    place = real_place(path)
    file = place.with_name(f".{place.name}.lock")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        held = _acquire(file)
    except BlockingIOError:
        raise ConfigurationError(
            f"store is {str(path)!r}, which is being written by {_holder(file)}; "
            "wait for its end or give another path"
        ) from None
    except OSError as error:
        raise ConfigurationError(
            f"store is {str(path)!r}, but {str(file)!r} cannot be locked: {error.strerror}"
        ) from error
    try:
        since = datetime.now(UTC).isoformat(timespec="seconds")
        holder = {"pid": os.getpid(), "host": socket.gethostname(), "since": since}
        os.ftruncate(held, 0)
        os.pwrite(held, json.dumps(holder).encode(), 0)
        remove_orphans(place)
        yield
    finally:
        # Removed while it is locked: who gets it next finds out that it is not there any more.
        file.unlink(missing_ok=True)
        os.close(held)


def _acquire(file: Path) -> int:
    """Descriptor of a locked file; raises BlockingIOError if another holds it."""
    while True:
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(descriptor), file.stat()):
                return descriptor
        except FileNotFoundError:  # its holder removed it before letting go of it
            pass
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _holder(file: Path) -> str:
    """Words for the holder of a lock."""
    try:
        holder = json.loads(file.read_bytes())
        return f"process {holder['pid']} on {holder['host']} since {holder['since']}"
    except (OSError, ValueError):
        return "another process"  # which has not signed yet, or has just ended
