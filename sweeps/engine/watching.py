"""Who follows a sweep: a live display on a terminal, plain lines elsewhere; and what it came to."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn
from rich.table import Table

from sweeps.engine.execute import Watch
from sweeps.engine.process import say
from sweeps.engine.progress import Progress as Stages
from sweeps.engine.schedule import Schedule

EVERY = 10.0  # s between plain lines
NAMED_FAILURES = 20  # the attributes of the store have them all


@contextmanager
def watching(name: str) -> Iterator[Watch]:
    """Show the progress of a sweep by stage on stderr meanwhile.

    Parameters
    ----------
    name : str
        Name of the command, which plain lines begin with.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield _Lines(name).watch
        return
    console = Console(stderr=True)
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description:<20}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[left]}"),
    )
    with Progress(*columns, console=console) as bars:
        yield _Bars(name, bars).watch


class _Lines:
    def __init__(self, name: str) -> None:
        self.name = name
        self.shown = time.monotonic()
        self.watch = Watch(lambda sentence: say(name, sentence), self._step, self._failed)

    def _step(self, schedule: Schedule) -> None:
        if time.monotonic() - self.shown < EVERY:
            return
        self.shown = time.monotonic()
        parts = [
            f"{stage} {one.reused + one.done + one.failed}/{one.total}"
            for stage, one in reversed(schedule.progress.items())
            if one.done + one.failed and one.reused + one.done + one.failed < one.total
        ]
        say(self.name, ", ".join(parts) or "finishing")

    def _failed(self, what: str, why: str) -> None:
        say(self.name, f"failed: {what}: {why}")


class _Bars:
    def __init__(self, name: str, bars: Progress) -> None:
        self.name = name
        self.bars = bars
        self.tasks: dict[str, object] = {}
        self.started = time.monotonic()
        self.watch = Watch(self._say, self._step, self._failed)

    def _say(self, sentence: str) -> None:
        with suppress(OSError):
            self.bars.console.print(escape(sentence), highlight=False)

    def _step(self, schedule: Schedule) -> None:
        for stage, one in reversed(schedule.progress.items()):
            if one.reused == one.total:
                continue
            if stage not in self.tasks:
                self.tasks[stage] = self.bars.add_task(stage, total=one.total, left="")
            finished = one.reused + one.done + one.failed
            left = ""
            if one.done > 0 and finished < one.total and stage in schedule.costs:
                left = f"{schedule.costs[stage] * (one.total - finished):.0f} s of work left"
            self.bars.update(self.tasks[stage], completed=finished, left=left)  # type: ignore[arg-type]

    def _failed(self, what: str, why: str) -> None:
        with suppress(OSError):
            self.bars.console.print(escape(f"failed: {what}: {why}"), style="red", highlight=False)


def summary(progress: Mapping[str, Stages], seconds: float) -> Table:
    """Table of what was done, reused and failed by stage, and where the time went."""
    table = Table(title=f"{seconds:.1f} s", title_justify="left", box=None, pad_edge=False)
    table.add_column("stage")
    for name in ("done", "reused", "failed", "work [s]"):
        table.add_column(name, justify="right")
    for stage, one in reversed(list(progress.items())):
        work = f"{one.seconds:.1f}" if one.seconds >= 0.05 else ""
        table.add_row(stage, str(one.done), str(one.reused), str(one.failed or ""), work)
    return table
