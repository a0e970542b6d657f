"""The wiring of a sweep: which task follows which. Nothing is computed here."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from sweeps import store
from sweeps.classification import classify_cell, tabulate
from sweeps.cluster import Executor
from sweeps.layout import ACN, FAILED
from sweeps.schema import ClassifierConfig, SweepConfig
from sweeps.stages import Ship, ViewPlan, view_profiles


@dataclass(frozen=True)
class Failure:
    """A task that failed: what it was to do, and why it could not."""

    what: str
    why: str


def run_views(
    executor: Executor,
    ships: tuple[Ship, ...],
    config: SweepConfig,
    plan: ViewPlan,
    path: Path,
) -> Iterator[Failure | None]:
    """Measure every view that the store lacks; yields once a view, with its failure if any."""
    aspects = config.grid.expand().aspect
    todo = np.argwhere(~store.views_done(path)).tolist()
    tasks = [(path, i, j, ships[i], aspects[j], plan) for i, j in todo]
    for (_, i, j, ship, aspect, _), _, error in executor.run(_measure_view, tasks):
        if error is None:
            yield None
        else:
            store.mark_view(path, i, j, FAILED)
            yield Failure(f"ship={ship.label} aspect={aspect:g}", _reason(error))


def run_classification(
    executor: Executor, config: SweepConfig, path: Path
) -> Iterator[Failure | None]:
    """Train and test in every cell; yields once a cell, with its failure if any."""
    grid = config.grid.expand()
    floors = config.ladar.floor_axis()
    several = len(floors) > 1
    tasks = []
    names = {}
    for (i, t), (j, r), (k, g) in product(
        enumerate(grid.pulse_width), enumerate(grid.range), enumerate(floors)
    ):
        index = (i, j, k) if several else (i, j)
        names[index] = f"pulse_width={t:g} range={r:g}" + (
            f" target_free_ifovs={g}" if several else ""
        )
        tasks.append((path, index, grid.vigilance, config.classifier))
    for (_, index, _, _), _, error in executor.run(_classify, tasks):
        if error is None:
            yield None
        else:
            store.mark_cell(path, index, FAILED)
            yield Failure(f"classification of {names[index]}", _reason(error))


def write_tables(config: SweepConfig, path: Path) -> None:
    """Tabulate what is classified into the store."""
    tables = tabulate(store.read_group(path, ACN).load())
    store.write_tables(path, tables.assign_attrs(receiver=config.ladar.receiver))


def _measure_view(path: Path, i: int, j: int, ship: Ship, aspect: float, plan: ViewPlan) -> None:
    store.write_view(path, i, j, view_profiles(ship, aspect, plan))


def _classify(
    path: Path,
    index: tuple[int, ...],
    vigilances: tuple[float, ...],
    classifier: ClassifierConfig,
) -> None:
    expected, averaged = store.read_profiles(path, index)
    there = store.views_done(path)
    arrays = classify_cell(expected, averaged, there, vigilances=vigilances, classifier=classifier)
    store.write_cell(path, index, arrays)


def _reason(error: Exception) -> str:
    """An exception in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
