"""Progress of a sweep: a live display on a terminal, plain lines elsewhere; and its summary."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress

from rich import progress
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sweeps.engine.failures import Failure, FailureLog
from sweeps.engine.process import say
from sweeps.engine.schedule import Progress, Schedule, Watch

EVERY = 10.0  # s between plain lines
EARLIEST = 3.0  # s of work done before the rest is estimated
STEADY = 10.0  # s: time constant of the estimated end
NAMED_FAILURES = 5  # all are in the log of failures and in the attributes of the store
AT_ONCE = 8  # stages that the live display shows: a terminal may have 24 lines
LONGEST, LEAST = 3, 0.05  # stages whose time the summary lists, and the least time [s]


@contextmanager
def watching(name: str, log: FailureLog) -> Iterator[Watch]:
    """Show the progress of a sweep on stderr; plain lines begin with the `name`.

    The first failures are shown, and all are logged.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield _Lines(name, log).watch
        return
    columns = (
        progress.SpinnerColumn(),
        progress.TextColumn("{task.description:<20}"),
        progress.BarColumn(bar_width=20),
        progress.MofNCompleteColumn(),
        progress.TextColumn("{task.fields[left]}"),
    )
    with progress.Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        yield _Bars(bars, log).watch


class Remaining:
    """Estimate of the time [s] until all cells are done, in words.

    Work left, divided by the rate so far of all workers together. The estimated end
    approaches that within some seconds, so that a slow cell does not make it jump.
    """

    def __init__(self) -> None:
        self._begun = self._before = self._last = self._end = math.nan

    def words(self, schedule: Schedule, now: float) -> str:
        """Return, for example, 'about 40 s left' at a time [s]; empty while too little is known."""
        done = sum(one.seconds for one in schedule.progress.values())
        left = schedule.work_left()
        if math.isnan(self._begun) and done:  # from here on, excluding the start of workers
            self._begun, self._before = now, done
        if not done - self._before >= EARLIEST or not 0 < left < math.inf:
            return ""
        end = now + left / (done - self._before) * (now - self._begun)
        weight = 1.0 if math.isnan(self._end) else -math.expm1((self._last - now) / STEADY)
        self._end = end if math.isnan(self._end) else self._end + weight * (end - self._end)
        self._last = now
        return f"about {_rounded(max(self._end - now, 1.0))} left"


def _rounded(seconds: float) -> str:
    """Return a rounded duration: 7 s, 40 s, 3 min, 2 h 10 min."""
    if seconds < 95:
        return f"{seconds:.0f} s" if seconds < 10 else f"{10 * round(seconds / 10)} s"
    minutes = round(seconds / 60) if seconds < 3300 else 10 * round(seconds / 600)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"


class _Failures:
    """The first failures of a sweep in words; all of them in a log."""

    def __init__(self, log: FailureLog) -> None:
        self.log = log
        self.number = 0

    def words(self, failure: Failure) -> str:
        """Log a failure, and return what to print of it: nothing after the first ones."""
        self.log.add(failure)
        self.number += 1
        if self.number <= NAMED_FAILURES:
            return f"failed: {failure.what}: {failure.why}"
        return "further failures are counted at the end" * (self.number == NAMED_FAILURES + 1)


class _Lines:
    def __init__(self, name: str, log: FailureLog) -> None:
        self.name = name
        self.failures = _Failures(log)
        self.shown = time.monotonic()
        self.remaining = Remaining()
        self.watch = Watch(lambda sentence: say(name, sentence), self._step, self._failed)

    def _step(self, schedule: Schedule) -> None:
        now = time.monotonic()
        left = self.remaining.words(schedule, now)
        if now - self.shown < EVERY:
            return
        self.shown = now
        parts = [
            f"{stage} {one.total - one.left}/{one.total}"
            for stage, one in reversed(schedule.progress.items())
            if one.done + one.failed and one.left > 0
        ]
        say(self.name, ", ".join([*parts, left] if left else parts) or "finishing")

    def _failed(self, failure: Failure) -> None:
        if words := self.failures.words(failure):
            say(self.name, words)


class _Bars:
    def __init__(self, bars: progress.Progress, log: FailureLog) -> None:
        self.bars = bars
        self.failures = _Failures(log)
        self.tasks: dict[str, progress.TaskID] = {}
        self.remaining = Remaining()
        self.watch = Watch(self._say, self._step, self._failed)

    def _say(self, sentence: str, style: str | None = None) -> None:
        with suppress(OSError):
            self.bars.console.print(escape(sentence), style=style, highlight=False)

    def _step(self, schedule: Schedule) -> None:
        shown = {stage: one for stage, one in schedule.progress.items() if one.reused < one.total}
        under_way = [stage for stage, one in shown.items() if one.done + one.failed and one.left]
        for stage in {*self.tasks, *under_way} - {"all"}:
            one = shown[stage]
            self._show(stage, one.total - one.left, one.total)
            self.bars.update(self.tasks[stage], visible=stage in under_way[:AT_ONCE])
        if shown:
            left = self.remaining.words(schedule, time.monotonic())
            total = sum(one.total for one in shown.values())
            self._show("all", total - sum(one.left for one in shown.values()), total, left)

    def _show(self, name: str, finished: int, total: int, left: str = "") -> None:
        if name not in self.tasks:
            self.tasks[name] = self.bars.add_task(name, total=total, left="")
        self.bars.update(self.tasks[name], completed=finished, total=total, left=left)

    def _failed(self, failure: Failure) -> None:
        if words := self.failures.words(failure):
            self._say(words, "red")


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
    done, reused, failed = (
        sum(getattr(one, name) for one in stages.values()) for name in ("done", "reused", "failed")
    )
    work = sum(one.seconds for one in stages.values())
    longest = sorted(stages.items(), key=lambda item: item[1].seconds, reverse=True)
    parts = [
        f"{name} {one.seconds:.1f} s" for name, one in longest[:LONGEST] if one.seconds >= LEAST
    ]
    return (
        f"{done:,} cells computed, {reused:,} reused, {failed:,} failed in {seconds:.1f} s; "
        f"work {work:.1f} s" + (f" ({', '.join(parts)})" if parts else "")
    )
