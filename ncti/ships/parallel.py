"""Building of many ships at once: the solid modeller computes in one thread of a process."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from subprocess import DEVNULL, Popen

from ncti.processors import processor_count
from ncti.ships.errors import ShipError
from ncti.ships.loading import describe, is_built

MAX_PROCESSES = 8
"""Most processes: a login node has other users."""


def build_in_parallel(
    ships: Sequence[str],
    *,
    cache: str | Path,
    progress: Callable[[int], None] = lambda built: None,
) -> None:
    """Build named ships into a cache folder, in several processes including this one.

    There is one process per processor, up to `MAX_PROCESSES`. Ships that cannot be built are
    skipped, since `describe` reports the fault, and so are the ships of a process that cannot start
    or is killed. After each ship of this process, `progress` receives the number of all ships built
    so far.
    """
    count = max(1, min(processor_count(), MAX_PROCESSES, len(ships)))
    started: list[Popen[bytes]] = []
    try:
        with suppress(OSError):
            for first in range(1, count):
                command = [sys.executable, "-m", __name__, str(cache), *ships[first::count]]
                started.append(Popen(command, stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL))
        for ship in ships[::count]:
            _build([ship], cache)
            progress(sum(is_built(name, cache=cache) for name in ships))
        for process in started:
            process.wait()
    finally:
        for process in started:
            process.kill()
            process.wait()


def _build(ships: Sequence[str], cache: str | Path, parent: int | None = None) -> None:
    """Build ships one after another, until the parent process ends."""
    for ship in ships:
        if parent not in (None, os.getppid()):
            return
        with suppress(ShipError):
            describe(ship, cache=cache)


if __name__ == "__main__":
    _build(sys.argv[2:], sys.argv[1], os.getppid())
