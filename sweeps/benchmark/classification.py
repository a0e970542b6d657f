"""Time of the whole classification part of the source's experiment, by classifier."""

from __future__ import annotations

import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hydra
import psutil  # type: ignore[import-untyped]  # comes with distributed

from sweeps import graph, store
from sweeps.app import conf_folder
from sweeps.benchmark.reports import Column, Report, Sample
from sweeps.cluster import Executor, Outcome, executor
from sweeps.prepare import prepare
from sweeps.schema import SweepConfig, register
from sweeps.stages import ViewPlan

CORES = 2
WHOLE, TABLES = "all together", "tables"


@dataclass(frozen=True)
class OneGroup:
    """An executor that leaves out the cells of all groups but one."""

    workers: Executor
    group: str

    def run(
        self, function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]
    ) -> Iterator[Outcome]:
        """See `Executor.run`."""
        return self.workers.run(function, [task for task in tasks if self._has(task)])

    def _has(self, task: tuple[Any, ...]) -> bool:
        return any(isinstance(part, graph.Cell) and part.group == self.group for part in task)


def measure(*, repeats: int, experiment: str = "paper") -> Report:
    """Classify what an experiment's sensors saw, all views being in the store.

    Parameters
    ----------
    repeats : int
        How often.
    experiment : str
        Its name.

    Returns
    -------
    Report
        Seconds of each group of cells alone, of all together, and of the tables.

    Raises
    ------
    RuntimeError
        When a view or cell fails.
    """
    register()
    with tempfile.TemporaryDirectory() as folder:
        path, cache = Path(folder, "sweep.zarr"), Path(folder, "cache")
        overrides = [f"+experiment={experiment}", f"cluster.workers={CORES}", f"cache={cache}"]
        with hydra.initialize_config_dir(str(conf_folder()), version_base="1.3"):
            prepared = prepare(hydra.compose("config", overrides=overrides))
        config, ships = prepared.config, prepared.ships
        code = store.code_digests(config)
        plan = ViewPlan.of(config, engine=prepared.engine, cache=cache, code=code)
        store.create(path, config, ships, prepared.engine)
        cells = Counter(cell.group for cell in graph.cells(config))
        taken: dict[str, list[tuple[float, float]]] = {part: [] for part in (*cells, WHOLE, TABLES)}
        with executor(config.cluster, tasks=CORES) as workers:
            _finish(graph.run_views(workers, ships, config, plan, path))
            for turn in range(repeats):
                # Forwards, then backwards: no group always follows the same one.
                for group in list(cells)[:: 1 if turn % 2 == 0 else -1]:
                    with _clocked(taken[group]):
                        classify(OneGroup(workers, group), config, path)
                with _clocked(taken[WHOLE]):
                    classify(workers, config, path)
        for _ in range(repeats):
            with _clocked(taken[TABLES]):
                graph.write_tables(config, path)  # the workers gone, as in a sweep
    rows: list[dict[str, Any]] = [
        {
            "part": part.rpartition("/")[2],
            "cells": cells.total() if part == WHOLE else cells.get(part),
            "seconds": Sample.of(wall for wall, _ in times),
            "cpu_seconds": Sample.of(cpu for _, cpu in times),
        }
        for part, times in taken.items()
    ]
    return Report(
        f"Classification part of `+experiment={experiment}`, {CORES} workers, {repeats} times",
        (
            Column("part", "part"),
            Column("cells", "cells", "d"),
            Column("seconds", "time in s", ".2f"),
            Column("cpu_seconds", "of processors", ".2f"),
        ),
        rows,
        [
            "Median (lowest–highest). Workers started, everything imported, all views in the "
            f"store. Expected: {WHOLE} under 10 s. Groups with fewer cells than workers leave "
            "workers idle when they are alone. Of processors: what all workers computed, "
            "which other processes slow but do not add to."
        ],
    )


def classify(workers: Executor, config: SweepConfig, path: Path) -> None:
    """Run a classification; a cell that fails is a `RuntimeError`."""
    _finish(graph.run_classification(workers, config, path))


@contextmanager
def _clocked(times: list[tuple[float, float]]) -> Iterator[None]:
    """Add the time that passes, and that this process and its workers compute [s]."""
    cpu, start = _computed(), time.perf_counter()
    yield
    times.append((time.perf_counter() - start, _computed() - cpu))


def _computed() -> float:
    """What this process and its descendants, all of them still there, have computed [s]."""
    this = psutil.Process()
    each = [process.cpu_times() for process in (this, *this.children(recursive=True))]
    return float(sum(times.user + times.system for times in each))


def _finish(outcomes: Iterable[graph.Failure | None]) -> None:
    """Wait for all tasks; the first failure is an error."""
    for failure in list(outcomes):
        if failure is not None:
            raise RuntimeError(f"{failure.what}: {failure.why}")
