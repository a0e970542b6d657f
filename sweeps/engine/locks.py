"""Locks of stores: objects beside them, of which one of several at once is made.

The objects are numbered. The one of the highest number holds the lock until it is deleted or its
owner is dead, and then one process makes the next number. An owner is dead if it is a process of
this machine that is gone; of any other, when it did not renew its object for a while. Clocks are
never compared: whoever waits measures that while itself.
"""

from __future__ import annotations

import errno
import json
import os
import random
import socket
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.places import Objects, Where, apart, readable, real_place
from sweeps.engine.process import repeating

LEASE = 60.0  # s without renewal, after which an owner elsewhere is dead
RENEWED = 10.0  # s between renewals
LOOK = 1.0  # s between looks at the object of an owner elsewhere
TRIES = 8  # when others come and go meanwhile


@contextmanager
def locked(place: Where) -> Iterator[Callable[[], None]]:
    """Hold the lock of a store, which need not exist; yield what raises OSError once it is lost.

    It is advisory. A process that was stopped for longer than the lease may have lost it to another
    one; call what is yielded before changes that readers see. ConfigurationError if another process
    or thread holds it, or locking fails.
    """
    above, room = _beside(place)
    try:
        lock = _acquired(place, Objects(above, make=True), room)
    except OSError as error:
        raise ConfigurationError(
            f"store is {str(place)!r}, but nothing can be locked in {str(above)!r}: "
            f"{error.strerror}"
        ) from error
    try:
        with repeating(RENEWED, lock.check):  # a failure is said before anything is changed
            yield lock.check
    finally:
        with suppress(OSError):  # then it expires
            lock.release()


def is_locked(place: Where) -> bool:
    """Return whether a process holds the lock of a store; one elsewhere may have died lately."""
    above, room = _beside(place)
    objects = Objects(above)
    numbers = _numbers(objects, room)
    content = objects.get(f"{room}/{numbers[-1]}") if numbers else None
    return content is not None and not _is_gone(content)


def _beside(place: Where) -> tuple[Where, str]:
    """Return the folder or URL that a store is in, and the name of its lock there."""
    above, name = apart(real_place(place))
    return above, f".{name}.lock"


@dataclass
class _Lock:
    """The object of an owner, and those of dead ones before it, in a folder beside a store."""

    place: Where
    objects: Objects
    room: str
    number: int
    owner: dict[str, Any]
    dead: tuple[int, ...]

    def check(self) -> None:
        """Renew the object; raise OSError if another owner has taken its place, or it fails."""
        name = f"{self.room}/{self.number}"
        found = _read(self.objects.get(name))
        if found.get("id") != self.owner["id"] or max(_numbers(self.objects, self.room)) > (
            self.number
        ):
            why = f"its lock was taken by another process after {LEASE:.0f} s without a sign"
            raise OSError(errno.EIO, why, str(self.place))
        self.owner["renewed"] = self.owner.get("renewed", 0) + 1
        self.objects.put(name, json.dumps(self.owner).encode())

    def release(self) -> None:
        """Delete the objects: its own last, so that whoever found it dead sees that it is not."""
        if _read(self.objects.get(f"{self.room}/{self.number}")).get("id") == self.owner["id"]:
            for number in (*self.dead, self.number):
                self.objects.delete([f"{self.room}/{number}"])


def _acquired(place: Where, objects: Objects, room: str) -> _Lock:
    """Return a lock that is now held; ConfigurationError if another owner is alive."""
    owner = {
        "id": uuid.uuid4().hex,
        "pid": os.getpid(),
        "host": socket.gethostname(),
        "machine": _machine(),
        "started": _start_of(os.getpid()),
        "since": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    seen = "another process"
    for _ in range(TRIES):
        before = _numbers(objects, room)
        last = f"{room}/{before[-1]}" if before else ""
        content = objects.get(last) if last else None
        if content is not None:
            found = _read(content)
            if {"pid", "host", "since"} <= found.keys():
                seen = "process {pid} on {host} since {since}".format(**found)
            if not _is_dead(objects, last, content):
                break
        if bool(last) == (content is not None):  # else it was released just now
            number = before[-1] + 1 if before else 1
            with readable():
                made = objects.create(f"{room}/{number}", json.dumps(owner).encode())
            # Others may have come and gone since: then what was found dead is there no more.
            alone = made and _numbers(objects, room) == [*before, number]
            if alone and (not last or objects.get(last) == content):
                return _Lock(place, objects, room, number, owner, tuple(before))
            if made:
                objects.delete([f"{room}/{number}"])
        time.sleep(random.uniform(0.001, 0.02))
    raise ConfigurationError(
        f"store is {str(place)!r}, which is being written by {seen}; "
        "wait until it ends or give another path"
    )


def _numbers(objects: Objects, room: str) -> list[int]:
    """Return the numbers of objects of a lock, ascending."""
    names = [name.rpartition("/")[2] for name in objects.sizes(room)]
    return sorted(int(name) for name in names if name.isdecimal())


def _read(content: bytes | None) -> dict[str, Any]:
    """Return what an owner says of itself; nothing if that cannot be read."""
    with suppress(ValueError):
        found = json.loads(content or b"")
        return found if isinstance(found, dict) else {}
    return {}


def _is_dead(objects: Objects, name: str, content: bytes) -> bool:
    """Return whether the owner of an object is gone; wait for its lease if it is elsewhere."""
    if (gone := _is_gone(content)) is not None:
        return gone
    until = time.monotonic() + LEASE
    while time.monotonic() < until:
        time.sleep(LOOK)
        if objects.get(name) != content:
            return False
    return True


def _is_gone(content: bytes) -> bool | None:
    """Return whether the owner of an object is gone; None if this process does not see it."""
    owner = _read(content)
    is_here = owner.get("machine") == _machine() != ""
    return owner.get("started") != _start_of(owner.get("pid", 0)) if is_here else None


def _machine() -> str:
    """Return what all processes that see each other's numbers have in common; empty if unknown."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{socket.gethostname()} {boot} {os.readlink('/proc/self/ns/pid')}"
    except OSError:
        return ""


def _start_of(process: int) -> str:
    """Return when a process of this machine started, in ticks since the boot; empty if it ended."""
    try:
        state, *numbers = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        return "" if state == "Z" else numbers[18]
    except (OSError, IndexError):
        return ""
