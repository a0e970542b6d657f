"""What a sweep would do, without doing it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from sweeps.engine.inputs import Spot
from sweeps.engine.plan import Plan
from sweeps.engine.results import CellIndex
from sweeps.engine.run import existing
from sweeps.engine.schedule import Find, Schedule
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Experiment
from sweeps.engine.takeover import OldStore


@dataclass(frozen=True)
class Preview:
    """Cells, tasks, bytes and time that a sweep would take.

    Attributes
    ----------
    stages : mapping of str to (int, int)
        Cells of each stage, and those to be made.
    calls : int
        Calls of stages.
    size : float or None
        Bytes that the new results take; None where some stage was never measured.
    seconds : float or None
        Work, on one core, likewise.
    """

    stages: Mapping[str, tuple[int, int]]
    calls: int
    size: float | None
    seconds: float | None

    @property
    def table(self) -> Table:
        """The same for people."""
        table = Table(box=None, pad_edge=False)
        table.add_column("stage")
        for name in ("cells", "at hand", "to do"):
            table.add_column(name, justify="right")
        for stage, (total, missing) in reversed(list(self.stages.items())):
            table.add_row(stage, str(total), str(total - missing), str(missing))
        return table

    @property
    def sentence(self) -> str:
        """What it comes to."""
        if not self.calls:
            return "nothing to do: all cells are at hand"
        work = "unknown" if self.seconds is None else f"{self.seconds:.3g} s"
        size = "unknown" if self.size is None else f"{self.size / 1e6:.3g} MB"
        return f"{self.calls} calls; new results {size}; work on one core {work}"


def preview(
    experiment: Experiment, choices: Choices, cache: Path, store: Path | None = None
) -> Preview:
    """What a sweep would do; nothing is written.

    Parameters
    ----------
    experiment, choices
        As of `sweeps.engine.run.sweep`.
    cache : Path
        Folder of finished results, which need not exist.
    store : Path, optional
        The store that would be written; a new one if not given.

    Raises
    ------
    ConfigurationError
        If the sweep would be refused.
    """
    plan = Plan(experiment, choices)
    old = existing(experiment, store, plan) if store is not None else None
    before = OldStore(plan, store, old, lambda sentence: None) if store and old else None

    def there(keys: Sequence[str]) -> dict[str, Spot]:
        return {key: ("", 0) for key in (before.has(keys) if before is not None else ())}

    index = CellIndex(cache, lambda sentence: None)  # which is not saved
    return _preview(Schedule(plan), index.costs(), lambda keys: there(keys) | index.find(keys))


def _preview(schedule: Schedule, costs: Mapping[str, tuple[float, float]], find: Find) -> Preview:
    schedule.resolve(find)
    missing = {name: one.total - one.reused for name, one in schedule.progress.items() if one.total}
    known = all(name in costs for name, cells in missing.items() if cells)
    return Preview(
        {name: (one.total, missing[name]) for name, one in schedule.progress.items() if one.total},
        sum(1 for _ in schedule.missing_cells()),
        sum(costs[name][1] * cells for name, cells in missing.items() if cells) if known else None,
        sum(costs[name][0] * cells for name, cells in missing.items() if cells) if known else None,
    )
