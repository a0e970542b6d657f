"""State of a sweep for another terminal: how far it is, or was when it ended."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from datetime import datetime, timedelta
from typing import Any

from rich.table import Table

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.keys import digest
from sweeps.engine.locks import is_locked
from sweeps.engine.packs import CLOSED
from sweeps.engine.places import Objects, Where, below, real_place
from sweeps.engine.schedule import Progress, Schedule, Watch

EVERY = 1.0  # s between states that are written
EARLIEST = 3.0  # s of work done before the rest is estimated
FOLDER = "status"  # of a cache


def _states(cache: Where, *, make: bool = False) -> Objects:
    """Return the states of sweeps that a cache knows."""
    return Objects(below(cache, FOLDER), make=make, mode=CLOSED, clean=False)


def _name(store: Where) -> str:
    """Return the name of the state of a store's latest sweep."""
    return f"{digest(str(real_place(store)))}.json"


@contextmanager
def recorded(store: Where, cache: Where, watch: Watch) -> Iterator[Watch]:
    """Yield an observer that also writes how far a sweep is into its cache, every second at most.

    A state that cannot be written costs nothing but itself.
    """
    states, begun, due = _states(cache, make=True), time.time(), 0.0
    state: dict[str, Any] = {"process": os.getpid(), "begun": begun, "stages": {}}
    state["ended"] = "stopped"  # unless it says otherwise

    def write() -> None:
        with suppress(OSError):
            states.put(_name(store), json.dumps(state | {"at": time.time()}).encode())

    def step(schedule: Schedule) -> None:
        nonlocal due
        if time.monotonic() >= due:
            left = schedule.work_left()
            stages = {
                name: asdict(one) | {"work": left[name]}
                for name, one in schedule.progress.items()
                if one.total
            }
            state["stages"] = stages
            write()
            due = time.monotonic() + EVERY
        watch.step(schedule)

    try:
        yield replace(watch, step=step)
        state["ended"] = "finished"
    finally:
        write()


def described(store: Where, cache: Where) -> tuple[str, Table]:
    """Return a sentence on the latest sweep of a store, and a table of its stages.

    Raises ConfigurationError if the cache knows of none.
    """
    content = _states(cache).get(_name(store))
    if content is None:
        raise ConfigurationError(
            f"store is {str(store)!r}, of which the cache {str(cache)!r} knows no sweep; "
            "give store= and cache= as the sweep has them"
        )
    try:
        state = json.loads(content)
        stages = {
            name: (Progress(**{key: one[key] for key in asdict(Progress())}), float(one["work"]))
            for name, one in state["stages"].items()
        }
        begun, at = float(state["begun"]), float(state["at"])
        process, ended = int(state["process"]), str(state["ended"])
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigurationError(
            f"cache is {str(cache)!r}, whose state of the sweep of {str(store)!r} cannot be read"
        ) from error
    running = is_locked(store)
    how = f"running as process {process}" if running else ended
    sentence = f"{store}: {how}; begun {_clock(begun)}, state of {_clock(at)}"
    return sentence, _table(stages, at - begun, running)


def _table(stages: Mapping[str, tuple[Progress, float]], elapsed: float, running: bool) -> Table:
    """Return a table of cells and estimated time by stage; all of them are in the last row."""
    table = Table(box=None, pad_edge=False)
    table.add_column("stage")
    for heading in ("cells", "reused", "done", "failed", "left", *["time left"] * running):
        table.add_column(heading, justify="right")
    every = Progress.over(one for one, _ in stages.values())
    rows = {**dict(reversed([*stages.items()])), "all": (every, sum(w for _, w in stages.values()))}
    for name, (one, work) in rows.items():
        counts = (one.total, one.reused, one.done, one.failed, one.left)
        known = every.seconds >= EARLIEST  # as fast as all workers were until now
        left = timedelta(seconds=round(work * elapsed / every.seconds)) if known else ""
        table.add_row(name, *map(str, counts), *[str(left)] * running)
    return table


def _clock(seconds: float) -> str:
    return datetime.fromtimestamp(seconds).isoformat(" ", "seconds")
