"""Who uses a cache: sweeps that run, the packs that each of them uses, and what may be deleted.

Every sweep that runs has a record in the cache, which it renews. Before anything is deleted, it is
named in such a record, too. As a sweep writes its record before it looks at those of others, and
reads no pack that one of them is about to delete, no two sweeps miss each other.

Times are those of the place: of a server, or of the system of files. So clocks of hosts need not
agree.
"""

from __future__ import annotations

import json
import threading
import uuid
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from sweeps.engine.packs import PACK, undamaged
from sweeps.engine.places import Objects
from sweeps.engine.process import repeating

if TYPE_CHECKING:
    from obstore import ObjectMeta

RUNNING = "running/"
RENEWED, LEASE = 30.0, 3600.0  # s: when a record is renewed; after which it counts no longer

Listed = Mapping[str, "ObjectMeta"]


@contextmanager
def using(cells: Objects) -> Iterator[Use]:
    """Keep a record of a sweep that runs in the cache where its packs are."""
    use = Use(cells)
    with suppress(OSError):
        use.renew()
    try:
        with repeating(RENEWED, use.renew):
            yield use
    finally:
        with suppress(OSError):
            cells.delete([use.name])


@dataclass
class Use:
    """Record of a sweep that runs. Until it has said which packs it uses, it uses all.

    Results are worth more than records: what cannot be written stops nothing.
    """

    cells: Objects
    name: str = field(default_factory=lambda: f"{RUNNING}{uuid.uuid4().hex}")
    packs: set[str] | None = None
    since: float | None = None  # s, epoch
    _deleting: list[str] = field(default_factory=list)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def renew(self) -> None:
        """Write the record again; OSError if that cannot be done."""
        with self._lock:
            packs = None if self.packs is None else sorted(self.packs)
            record = [packs, self.since, self._deleting]
            self.cells.put(self.name, json.dumps(record).encode())

    def leaving(self) -> set[str]:
        """Return packs that others are about to delete. Those listed later are safe to use."""
        listed = self.cells.listed(RUNNING)
        self.since = _time(listed[self.name]) if self.name in listed else None
        return {name for record in self._others(listed) for name in record.deleting}

    def take(self, packs: Iterable[str]) -> None:
        """Add packs to those that are used."""
        self.packs = {*(self.packs or ()), *packs}
        with suppress(OSError):
            self.renew()

    def shrink(self, limit_bytes: int) -> None:
        """Delete the oldest packs until the rest is small enough.

        Those that this or another sweep uses, or that were written since it began, stay. Raises
        OSError if the place does.
        """
        self.renew()
        listed = self.cells.listed()
        if self.since is None or self.name not in listed:
            return
        self.cells.tidy(_time(listed[self.name]) - LEASE)
        packs = {name: one for name, one in listed.items() if name.endswith(PACK)}
        excess = sum(one["size"] for one in packs.values()) - limit_bytes
        if excess <= 0:
            return
        stay = (self.packs or set()) | self._used_by_others(packs) | _since(packs, self.since)
        for name in sorted(packs.keys() - stay):  # by the time in their names
            if excess <= 0:
                break
            self._deleting.append(name)
            excess -= packs[name]["size"]
        self.renew()  # from here on, others see what is to go
        stay = self._used_by_others(packs)
        self.cells.delete(name for name in self._deleting if name not in stay)

    def _used_by_others(self, packs: Listed) -> set[str]:
        """Return packs that other sweeps use, which run now."""
        used: set[str] = set()
        for record in self._others(self.cells.listed(RUNNING)):
            if record.packs is None or record.since is None:
                return set(packs)
            used |= {*record.packs} | _since(packs, record.since)
        return used

    def _others(self, listed: Listed) -> Iterator[Record]:
        """Yield records of other sweeps; delete those of sweeps that ended without doing so."""
        times = {name: _time(one) for name, one in listed.items()}
        now = times.pop(self.name, max(times.values(), default=0.0))
        for name, moment in times.items():
            if now - moment > LEASE:
                self.cells.delete([name])
            elif (content := self.cells.get(name)) is not None:
                yield Record.of(content)


class Record(NamedTuple):
    """What a sweep uses, from when on also all that is new, and what it is about to delete."""

    packs: Collection[str] | None = None
    since: float | None = None
    deleting: Collection[str] = ()

    @classmethod
    def of(cls, content: bytes) -> Record:
        """Return a record from its bytes; one that uses everything if they say nothing."""
        with undamaged():
            packs, since, deleting = json.loads(content)
            packs = None if packs is None else frozenset(packs)
            return cls(packs, float(since), frozenset(deleting))
        return cls()


def _time(one: ObjectMeta) -> float:
    return one["last_modified"].timestamp()


def _since(packs: Listed, moment: float) -> set[str]:
    return {name for name, one in packs.items() if _time(one) >= moment}
