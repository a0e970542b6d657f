"""Cost of a page's sweep by the engine, beside a loop that computes each setting anew."""

from __future__ import annotations

import csv
import shutil
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from benchmarks.commands import new_folder, sweep
from benchmarks.processes import Run
from benchmarks.reports import Column, Report

COLUMNS = (Column("what", "the engine"), Column("value", "in this sweep"))
STORE = "sweep.zarr"


@dataclass(frozen=True)
class LoneSetting:
    """A setting by itself: arguments of `ncti-sweep`, and its comparison with the sweep.

    Attributes
    ----------
    overrides : tuple of str
        Arguments that give each axis one value.
    same : callable, optional
        Function of the sweep's group and of the setting's: whether they have the same figures.
    """

    overrides: tuple[str, ...]
    same: Callable[[xr.Dataset, xr.Dataset], bool] | None = None


@dataclass(frozen=True)
class RepeatedSweep:
    """A sweep with an empty cache, and a new store from the same cache.

    Attributes
    ----------
    cells : int
        Cells that the first computed.
    cold, warm : Run
        Time and memory of both.
    """

    cells: int
    cold: Run
    warm: Run

    @property
    def computing(self) -> float:
        """Processor time, except of starting and of writing the store and tables [s]."""
        return self.cold.cpu - self.warm.cpu


def sweep_twice(overrides: Sequence[str], folder: Path) -> RepeatedSweep:
    """Run `ncti-sweep` twice in a folder, which then has the store.

    Raises
    ------
    RuntimeError
        If a sweep fails, or the second computes anything.
    """
    cold = sweep(overrides, new_folder(folder)).run
    with (folder / "sweep-tables" / "stages.csv").open(encoding="utf-8", newline="") as file:
        cells = sum(int(row["done"]) for row in csv.DictReader(file))
    shutil.rmtree(folder / STORE)
    warm = sweep(overrides, folder)
    if warm.made:
        raise RuntimeError(f"`ncti-sweep {' '.join(overrides)}` computes {warm.made} cells again")
    return RepeatedSweep(cells, cold, warm.run)


def prove_sweep(
    overrides: Sequence[str], groups: Sequence[str], settings: int, alone: Iterable[LoneSetting]
) -> tuple[list[xr.Dataset], Report]:
    """Run a sweep, and some of its settings each by itself.

    Parameters
    ----------
    overrides : sequence of str
        Arguments of `ncti-sweep`. Nothing but the built ships is in its cache.
    groups : sequence of str
        Groups of the store that are read into memory.
    settings : int
        Number of settings of the sweep.
    alone : iterable of LoneSetting
        A random sample of settings of the same distribution, each with a cache of its own.

    Returns
    -------
    list of Dataset
        The groups.
    Report
        Work of the engine.

    Raises
    ------
    RuntimeError
        If a sweep fails, or a setting alone has other figures.
    """

    def read_groups(folder: Path, names: Sequence[str]) -> list[xr.Dataset]:
        return [xr.open_zarr(folder / STORE, group=name).load() for name in names]

    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent, "sweep")
        full, datasets = sweep_twice(overrides, folder), read_groups(folder, groups)
    samples, compared = [], 0
    for setting in alone:
        with tempfile.TemporaryDirectory() as parent:
            folder = Path(parent, "alone")
            samples.append(sweep_twice(setting.overrides, folder))
            if setting.same is not None:
                if not setting.same(datasets[0], *read_groups(folder, groups[:1])):
                    arguments = " ".join(setting.overrides)
                    raise RuntimeError(f"`ncti-sweep {arguments}` differs from the whole sweep")
                compared += 1
    return datasets, engine_report(overrides, settings, full, samples, compared)


def engine_report(
    overrides: Sequence[str],
    settings: int,
    whole: RepeatedSweep,
    each: Sequence[RepeatedSweep],
    compared: int,
) -> Report:
    """Return the report of a sweep, and of settings computed alone.

    Parameters
    ----------
    overrides : sequence of str
        Arguments of `ncti-sweep`.
    settings : int
        Number of settings of the sweep.
    whole : RepeatedSweep
        The sweep.
    each : sequence of RepeatedSweep
        Two settings or more, each computed alone.
    compared : int
        How many of them were compared with the sweep.
    """
    cells = settings * np.mean([sample.cells for sample in each])
    seconds = np.array([sample.computing for sample in each])
    mean, error = seconds.mean(), seconds.std(ddof=1) / np.sqrt(len(seconds))
    times = settings * mean / whole.computing
    run = whole.cold
    rows = {
        "settings": f"{settings:,}",
        "cells computed": f"{whole.cells:,}",
        "cells of a loop over the settings": f"{cells:,.0f}",
        "results reused": f"{100 * (1 - whole.cells / cells):.3g} %",
        "processor time": f"{run.cpu:,.0f} s",
        "cells a second of it": f"{whole.cells / run.cpu:,.3g}",
        "settings a second of it": f"{settings / run.cpu:,.3g}",
        "most memory, all processes": f"{run.together:,.0f} MiB",
        "a new store from the same cache": f"{whole.warm.cpu:,.1f} s of the processor",
        "processor time of a loop over the settings": f"{settings * mean / 3600:,.3g} h, "
        f"{_round_digits(times, 3)} ± {_round_digits(2 * times * error / mean, 2)} times as long",
    }
    equal = f" Figures of {compared} of them are also the sweep's, and equal." if compared else ""
    return Report(
        "The engine",
        COLUMNS,
        [{"what": what, "value": value} for what, value in rows.items()],
        [
            f"`ncti-sweep {' '.join(overrides)}`, once, nothing in the cache but the built ships. "
            f"A loop computes anew what each setting needs: the mean of {len(each)} settings at "
            "random, each swept alone with a cache of its own, without the time of starting and "
            f"of writing a store, ± two standard errors.{equal}"
        ],
    )


def _round_digits(value: float, digits: int) -> str:
    """Return a number to some significant digits, without an exponent."""
    return f"{float(f'{value:.{digits}g}'):,.16g}"
