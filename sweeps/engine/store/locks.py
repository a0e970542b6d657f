"""Locks of stores, so that one process writes at a time.

The lock of a folder is a file beside it that the operating system locks, and frees when its owner
ends in any way. The lock in a bucket is an object that its owner renews; a process that sees no
renewal during the lease takes it over. A takeover never compares clocks of different machines: the
waiting process measures the lease with its own clock.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import socket
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from datetime import UTC, datetime
from itertools import count
from pathlib import Path

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl, resolve_path, split_parent
from sweeps.engine.objects import PUBLIC_MODE, Objects, ensure_folder
from sweeps.engine.run.process import call_every

LEASE = 60.0  # s without renewal, after which the owner of an object is dead
RENEW_INTERVAL = 10.0  # s between renewals
POLL_INTERVAL = 1.0  # s between checks of the object of another owner
LOCK_SECONDS = 0.1  # s to wait for the lock of a store in a folder
LOCK_FLAGS, LOCK_MODE = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644  # of its file
OWNER = re.compile(r"process \d+ on [\w.-]+ since [\d:T+-]+")


@contextmanager
def store_lock(path: PathOrUrl) -> Iterator[Callable[[], None]]:
    """Hold the lock of a store, which need not exist; yield a check that it is still held.

    The lock is advisory. The check raises OSError if another process has taken over the lock of a
    bucket because this one was suspended for longer than the lease; call it before changes that
    readers see. Raises ConfigurationError if another process or thread holds the lock, or if
    locking fails.
    """
    parent, name = _lock_path(path)
    try:
        if isinstance(parent, Path):
            check, release = _lock_file(parent, name)
        else:
            check, release = _lock_object(parent, name)
    except OSError as error:
        raise ConfigurationError(
            f"store is {str(path)!r}, but nothing can be locked in {str(parent)!r}: "
            f"{error.strerror}"
        ) from error
    except _LockHeldError as holder:
        raise ConfigurationError(
            f"store is {str(path)!r}, which is being written by {holder}; "
            "wait until it ends or give another path"
        ) from None
    try:
        with call_every(RENEW_INTERVAL, check):
            yield check
    finally:
        with suppress(OSError):  # then the lease ends
            release()


def seconds_since_renewal(path: PathOrUrl) -> float | None:
    """Return the seconds since a store's lock was renewed; None if it is free.

    The operating system frees the lock of a folder when its owner ends, so this is 0 there. In a
    bucket, clocks are compared: an owner that is silent for longer than `LEASE` is probably dead.
    """
    parent, name = _lock_path(path)
    if not isinstance(parent, Path):
        lock = Objects(parent).head(name)
        return (datetime.now(UTC) - lock["last_modified"]).total_seconds() if lock else None
    with suppress(OSError), (parent / name).open("rb") as file:  # its owner is not disturbed
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return 0.0
    return None


def _lock_path(path: PathOrUrl) -> tuple[PathOrUrl, str]:
    """Return the folder or URL that a store is in, and the name of its lock there."""
    parent, name = split_parent(resolve_path(path))
    return parent, f".{name}.lock"


class _LockHeldError(Exception):
    """Another process or thread holds a lock; the message names it."""

    def __init__(self, owner: bytes) -> None:
        text = owner.decode(errors="replace").partition("\n")[0]
        super().__init__(text if OWNER.fullmatch(text) else "another process")


def _owner_text() -> str:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return f"process {os.getpid()} on {socket.gethostname()} since {now}"


Lock = tuple[Callable[[], None], Callable[[], None]]
"""A check that a lock is still held, and its release."""


def _lock_file(folder: Path, name: str) -> Lock:
    """Lock a file, which `release` deletes."""
    ensure_folder(folder, PUBLIC_MODE)
    path, deadline = folder / name, time.monotonic() + LOCK_SECONDS
    while True:
        file = os.fdopen(os.open(path, LOCK_FLAGS, LOCK_MODE), "r+b", buffering=0)
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.fstat(file.fileno()).st_nlink:  # else its owner has just deleted it
                break
        with file:
            # Not at once: `seconds_since_renewal` may hold it for a moment.
            if time.monotonic() > deadline:
                raise _LockHeldError(file.read())
        time.sleep(LOCK_SECONDS / 10)
    file.truncate(0)  # drop the text of a killed owner
    file.write(_owner_text().encode())

    def release() -> None:
        path.unlink(missing_ok=True)  # a process that has just opened it makes another
        file.close()

    return lambda: None, release


def _lock_object(parent: PathOrUrl, name: str) -> Lock:
    """Make a lock object that `check` renews, or take over one whose lease has ended."""
    objects, token, mutex = Objects(parent), uuid.uuid4().hex, threading.Lock()
    owner, turns, current, since = _owner_text(), count(), None, 0.0

    def content() -> bytes:
        return f"{owner}\n{token} {next(turns)}".encode()  # differs each time

    while True:
        previous, current = current, objects.get_versioned(name)
        if current and previous and current != previous:
            raise _LockHeldError(current[0])
        if previous is None:
            since = time.monotonic()  # not before the answer, which may have taken longer
        if current is None or time.monotonic() - since > LEASE:
            version = objects.put_if(name, content(), current and current[1])
            if version:
                break
            raise _LockHeldError(current[0] if current else b"")
        time.sleep(POLL_INTERVAL)

    def check() -> None:
        nonlocal version
        with mutex:
            version = version and objects.put_if(name, content(), version)
            if (
                not version
                and (stored := objects.get_versioned(name))
                and token.encode() in stored[0]
            ):
                version = stored[1]  # the answer to an earlier put was lost
            if not version:
                reason = f"its lock was taken by another process after {LEASE:.0f} s without a sign"
                raise OSError(errno.EIO, reason, f"{parent}/{name}")

    def release() -> None:
        check()
        objects.delete([name])

    return check, release


def cache_lock(folder: PathOrUrl, *, exclusive: bool = False) -> AbstractContextManager[None]:
    """Hold a shared or exclusive lock of a folder; BlockingIOError if an exclusive one is refused.

    Buckets and missing folders are not locked.
    """
    if not (isinstance(folder, Path) and folder.is_dir()):
        return nullcontext()
    return folder_lock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB if exclusive else fcntl.LOCK_SH)


@contextmanager
def folder_lock(folder: Path, operation: int = fcntl.LOCK_EX) -> Iterator[None]:
    """Hold a lock of a folder, which the operating system frees when the process ends.

    On a file system without locks, hold nothing; with `fcntl.LOCK_NB`, raise OSError instead.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with nullcontext() if operation & fcntl.LOCK_NB else suppress(OSError):
            fcntl.flock(descriptor, operation)
        yield
    finally:
        os.close(descriptor)
