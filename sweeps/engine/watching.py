"""Progress of a sweep: a live display on a terminal, plain lines elsewhere; and its summary."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import timedelta

import rich.progress
from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from sweeps.engine.failures import Failure, FailureLog
from sweeps.engine.process import say
from sweeps.engine.schedule import Progress, Schedule, Watch

EVERY = 10.0  # s between plain lines
EARLIEST = 3.0  # s of work done before the rest is estimated
NAMED_FAILURES = 5  # all are in the log of failures and in the attributes of the store
AT_ONCE = 8  # stages that the live display shows: a terminal may have 24 lines
LONGEST, LEAST = 3, 0.05  # stages whose time the summary lists, and the least time [s]


@contextmanager
def watching(name: str, log: FailureLog) -> Iterator[Watch]:
    """Show the progress of a sweep on stderr, in lines that begin with the `name`.

    The first failures are shown, and all are logged.
    """
    shown = _Shown(name, log)
    with shown.live:
        yield Watch(shown.say, shown.step, shown.failed)


class _Shown:
    """What is shown of a sweep under way."""

    def __init__(self, name: str, log: FailureLog) -> None:
        self.name, self.log = name, log
        self.terminal = sys.stderr is not None and sys.stderr.isatty()
        self.live = Live(console=Console(stderr=True, quiet=not self.terminal), transient=True)
        # In seconds of all workers; it only estimates the time left.
        self.work = rich.progress.Progress(disable=True)
        self.work.add_task("all")
        self.at = time.monotonic()
        self.failures = 0

    def say(self, sentence: str, style: str | None = None) -> None:
        if self.terminal:
            self.live.console.print(sentence, style=style, markup=False, highlight=False)
        else:
            say(self.name, sentence)

    def failed(self, failure: Failure) -> None:
        self.log.add(failure)
        self.failures += 1
        if self.failures <= NAMED_FAILURES:
            self.say(f"failed: {failure.what}: {failure.why}", "red")
        elif self.failures == NAMED_FAILURES + 1:
            self.say("further failures are counted at the end", "red")

    def step(self, schedule: Schedule) -> None:
        now = time.monotonic()
        left = self._left(schedule)
        stages = [*schedule.progress.items()]
        begun = [(name, one) for name, one in stages if one.left and one.done + one.failed]
        if self.terminal:
            shown = [one for _, one in stages if one.reused < one.total]
            every = Progress.over(shown)
            table = Table.grid(padding=(0, 1))
            for name, one in [*begun[:AT_ONCE], ("all", every)] if shown else ():
                count = one.total - one.left
                bar = ProgressBar(one.total, count, width=20)
                table.add_row(f"{name:<20}", bar, f"{count}/{one.total}", left * (one is every))
            self.live.update(table)
        elif now - self.at >= EVERY:
            self.at = now
            parts = [f"{name} {one.total - one.left}/{one.total}" for name, one in begun[::-1]]
            self.say(", ".join([*parts, left] if left else parts) or "finishing")

    def _left(self, schedule: Schedule) -> str:
        """Return the estimated time until all cells are done; empty while too little is known."""
        done = sum(one.seconds for one in schedule.progress.values())
        [every] = self.work.tasks
        self.work.update(every.id, completed=done, total=done + sum(schedule.work_left().values()))
        known = done >= EARLIEST and every.time_remaining
        return f"about {timedelta(seconds=known)} left" if known else ""


def foreseen(stages: Mapping[str, tuple[int, int]]) -> Table:
    """Return a table of the cells of each stage: all, reused, and to be computed."""
    table = Table(box=None, pad_edge=False)
    table.add_column("stage")
    for heading in ("cells", "reused", "to compute"):
        table.add_column(heading, justify="right")
    for name, (total, left) in reversed([*stages.items()]):
        table.add_row(name, str(total), str(total - left), str(left))
    return table


def summary(stages: Mapping[str, Progress], seconds: float) -> str:
    """Return how many cells were computed, reused and failed, and which stages took longest."""
    every = Progress.over(stages.values())
    longest = sorted(stages.items(), key=lambda item: item[1].seconds, reverse=True)
    parts = [
        f"{name} {one.seconds:.1f} s" for name, one in longest[:LONGEST] if one.seconds >= LEAST
    ]
    return (
        f"{every.done:,} cells computed, {every.reused:,} reused, {every.failed:,} failed in "
        f"{seconds:.1f} s; work {every.seconds:.1f} s" + (f" ({', '.join(parts)})" if parts else "")
    )
