"""Progress of a sweep: on this terminal, in the cache for `--status`, and as a summary."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import astuple
from datetime import timedelta
from typing import TYPE_CHECKING, Any

from rich.console import Console

from sweeps.engine.declare.failures import Failure, FailureLog
from sweeps.engine.declare.paths import PathOrUrl, join, resolve_path
from sweeps.engine.objects import PRIVATE_MODE, Objects
from sweeps.engine.resolve.keys import digest
from sweeps.engine.run.process import say
from sweeps.engine.run.schedule import Callbacks, Progress, Schedule

if TYPE_CHECKING:
    from rich.table import Table

LINE_INTERVAL = 10.0  # s between plain lines
MIN_WORK = 3.0  # s of work done before the rest is estimated
NAMED_FAILURES = 5  # all are in the log of failures and in the attributes of the store
MAX_BARS = 8  # stages that the live display shows: a terminal may have 24 lines
MAX_STAGES = 3  # stages whose time the summary lists
MIN_LISTED_SECONDS = 0.05  # s


@contextmanager
def show_progress(
    name: str, log: FailureLog, store: PathOrUrl, cache: PathOrUrl, *, record: bool = True
) -> Iterator[Callbacks]:
    """Show the progress of a sweep on stderr, in lines that begin with the `name`.

    The first failures are shown, and all are logged. With `record`, its state is also written into
    the cache, at most every second; errors of writing it are ignored.
    """
    view = _ProgressView(name, log, store, cache, record)
    with view.live:
        try:
            yield Callbacks(view.say, view.update, view.report_failure)
            view.state["ended"] = "finished"
        finally:
            view.write()


class _ProgressView:
    """Display and record of a running sweep."""

    def __init__(
        self, name: str, log: FailureLog, store: PathOrUrl, cache: PathOrUrl, record: bool
    ) -> None:
        from rich.live import Live

        self.name, self.log, self.record = name, log, record
        self.states, self.file = open_states(cache, create=True), state_name(store)
        self.next_save = 0.0
        self.state: dict[str, Any] = {"process": os.getpid(), "begun": time.time()}
        self.state["ended"] = "stopped"  # until the sweep finishes
        self.terminal = sys.stderr is not None and sys.stderr.isatty()
        self.live = Live(console=Console(stderr=True, quiet=not self.terminal), transient=True)
        self.begun = self.last_line = time.monotonic()
        self.failures = 0
        self.schedule: Schedule | None = None

    def say(self, sentence: str, style: str | None = None) -> None:
        if self.terminal:
            self.live.console.print(sentence, style=style, markup=False, highlight=False)
        else:
            say(self.name, sentence)

    def report_failure(self, failure: Failure) -> None:
        self.log.add(failure)
        self.failures += 1
        if self.failures <= NAMED_FAILURES:
            self.say(f"failed: {failure.name}: {failure.reason}", "red")
        elif self.failures == NAMED_FAILURES + 1:
            self.say("more failures are counted at the end", "red")

    def update(self, schedule: Schedule) -> None:
        now, self.schedule = time.monotonic(), schedule
        stages = [*schedule.progress.items()]
        if now >= self.next_save:
            self.write()
            self.next_save = time.monotonic() + SAVE_INTERVAL
        remaining = _remaining_time(schedule, self.begun)
        started = [
            (name, progress)
            for name, progress in stages
            if progress.remaining and progress.done + progress.failed
        ]
        if self.terminal:
            computed = [progress for _, progress in stages if progress.reused < progress.total]
            rows = [*started[:MAX_BARS], ("all", Progress.sum(computed))] if computed else []
            self.live.update(_make_bars(rows, remaining))
        elif now - self.last_line >= LINE_INTERVAL:
            self.last_line = now
            parts = [
                f"{name} {progress.total - progress.remaining}/{progress.total}"
                for name, progress in started[::-1]
            ]
            if not parts and (cells := sum(progress.remaining for _, progress in stages)):
                parts = [f"{cells:,} cells left"]
            self.say(", ".join([*parts, remaining] if remaining else parts) or "finishing")

    def write(self) -> None:
        if self.record and self.schedule is not None:
            work, stages = self.schedule.remaining_seconds(), self.schedule.progress.items()
            numbers = {
                name: [*astuple(progress), work[name]]
                for name, progress in stages
                if progress.total
            }
            state = json.dumps(self.state | {"stages": numbers, "at": time.time()})
            with suppress(OSError):
                self.states.put(self.file, state.encode())


@contextmanager
def progress_bar() -> Iterator[Callable[[Schedule], None]]:
    """Yield a function that draws progress bars in a terminal or notebook, else does nothing."""
    console, begun = Console(stderr=True), time.monotonic()
    terminal = sys.stderr is not None and sys.stderr.isatty()

    def make_table(schedule: Schedule) -> Table:
        stages = [item for item in schedule.progress.items() if item[1].reused < item[1].total]
        return _make_bars(stages, _remaining_time(schedule, begun))

    if console.is_jupyter:
        from IPython.display import display  # there, if this is a notebook

        drawn: list[Any] = []

        def draw(schedule: Schedule) -> None:
            table = make_table(schedule)
            if drawn:
                drawn[0].update(table)
            elif table.row_count:
                drawn.append(display(table, display_id=True))

        yield draw
    elif terminal:
        from rich.live import Live

        with Live(console=console, transient=True) as live:
            yield lambda schedule: live.update(make_table(schedule))
    else:
        yield lambda schedule: None


def _make_bars(rows: Sequence[tuple[str, Progress]], remaining: str) -> Table:
    """Return a bar for each stage, the last one followed by the remaining time."""
    from rich.progress_bar import ProgressBar
    from rich.table import Table

    table = Table.grid(padding=(0, 1))
    for number, (name, progress) in enumerate(rows, 1):
        count = progress.total - progress.remaining
        bar = ProgressBar(progress.total, count, width=20)
        table.add_row(
            f"{name:<20}", bar, f"{count}/{progress.total}", remaining * (number == len(rows))
        )
    return table


def _remaining_time(schedule: Schedule, begun: float) -> str:
    """Return the estimated time left of a sweep in words, or nothing."""
    work, total = schedule.remaining_seconds(), Progress.sum(schedule.progress.values())
    text = time_left(sum(work.values()), total.seconds, time.monotonic() - begun)
    return f"about {text} left" if text else ""


def time_left(work: float, done: float, elapsed: float) -> str:
    """Return the time left for `work`, at the rate of the work `done` in `elapsed` [s].

    Empty until `MIN_WORK` is done.
    """
    return str(timedelta(seconds=round(work * elapsed / done))) if done >= MIN_WORK else ""


def count_table(rows: Mapping[str, Sequence[Any]], *headings: str) -> Table:
    """Return a table of numbers by stage."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    table.add_column("stage")
    for heading in headings:
        table.add_column(heading, justify="right")
    for name, numbers in rows.items():
        table.add_row(name, *map(str, numbers))
    return table


def summary(stages: Mapping[str, Progress], seconds: float) -> str:
    """Return the numbers of computed, reused and failed cells, and the stages that took longest."""
    total = Progress.sum(stages.values())
    longest = sorted(stages.items(), key=lambda item: item[1].seconds, reverse=True)
    slow = (item for item in longest[:MAX_STAGES] if item[1].seconds >= MIN_LISTED_SECONDS)
    parts = [f"{name} {progress.seconds:.1f} s" for name, progress in slow]
    return (
        f"{total.done:,} cells computed, {total.reused:,} reused, {total.failed:,} failed in "
        f"{seconds:.1f} s; work {total.seconds:.1f} s" + (f" ({', '.join(parts)})" if parts else "")
    )


SAVE_INTERVAL = 1.0  # s between states that are written
STATUS_FOLDER = "status"  # of a cache


def open_states(cache: PathOrUrl, *, create: bool = False) -> Objects:
    """Return the states of sweeps in a cache."""
    return Objects(join(cache, STATUS_FOLDER), create=create, mode=PRIVATE_MODE, remove_empty=False)


def state_name(store: PathOrUrl) -> str:
    """Return the name of the state of a store's latest sweep."""
    return f"{digest(str(resolve_path(store)))}.json"
