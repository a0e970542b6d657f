"""What the engine did in the sweep of a page, beside a loop that computes each setting anew."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from benchmarks.commands import Swept, new_folder, sweep
from benchmarks.processes import Run
from benchmarks.reports import Column, Report

COLUMNS = (Column("what", "the engine"), Column("value", "in this sweep"))


@dataclass(frozen=True)
class Work:
    """Cells that a sweep computed, and the time of all calls of its stages [s]."""

    cells: int
    seconds: float

    @classmethod
    def of(cls, folder: Path) -> Work:
        """Return the work of the store in a folder, from the table of stages beside it."""
        table = folder / "sweep-tables" / "stages.csv"
        with table.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        return cls(sum(int(row["done"]) for row in rows), sum(float(row["work_s"]) for row in rows))


@dataclass(frozen=True)
class Alone:
    """A setting by itself: arguments of `ncti-sweep`, and how to compare it with the sweep.

    Attributes
    ----------
    overrides : tuple of str
        Arguments that give each axis one value.
    same : callable, optional
        Function of the sweep's group and of the setting's: whether they have the same figures.
    """

    overrides: tuple[str, ...]
    same: Callable[[xr.Dataset, xr.Dataset], bool] | None = None


def proven(
    overrides: Sequence[str], groups: Sequence[str], settings: int, alone: Iterable[Alone]
) -> tuple[list[xr.Dataset], Report]:
    """Run a sweep, the same again, and some of its settings each by itself.

    Parameters
    ----------
    overrides : sequence of str
        Arguments of `ncti-sweep`. Nothing but the built ships is in its cache.
    groups : sequence of str
        Groups of the store that are read into memory.
    settings : int
        Number of settings of the sweep.
    alone : iterable of Alone
        A random sample of settings of the same distribution, each with a cache of its own.

    Returns
    -------
    list of Dataset
        The groups.
    Report
        What the engine did.

    Raises
    ------
    RuntimeError
        If a sweep fails, or a setting alone has other figures.
    """
    with tempfile.TemporaryDirectory() as parent:
        folder = new_folder(Path(parent, "sweep"))
        run = sweep(overrides, folder).run
        whole = Work.of(folder)
        again = sweep(overrides, folder)
        found = [xr.open_zarr(folder / "sweep.zarr", group=group).load() for group in groups]
    each, compared = [], 0
    for one in alone:
        with tempfile.TemporaryDirectory() as parent:
            folder = new_folder(Path(parent, "alone"))
            sweep(one.overrides, folder)
            each.append(Work.of(folder))
            if one.same is not None:
                store = xr.open_zarr(folder / "sweep.zarr", group=groups[0]).load()
                if not one.same(found[0], store):
                    asked = " ".join(one.overrides)
                    raise RuntimeError(f"`ncti-sweep {asked}` differs from the whole sweep")
                compared += 1
    return found, engine(settings, run, whole, again, each, compared)


def engine(
    settings: int, run: Run, whole: Work, again: Swept, each: Sequence[Work], compared: int = 0
) -> Report:
    """Return the report of a sweep, from its work and that of settings computed alone.

    Parameters
    ----------
    settings : int
        Number of settings of the sweep.
    run : Run
        Time and memory of the command.
    whole : Work
        Its work.
    again : Swept
        The same command, once more.
    each : sequence of Work
        Work of two settings or more, each computed alone.
    compared : int
        How many of them were compared with the sweep.
    """
    cells = settings * np.mean([one.cells for one in each])
    seconds = np.array([one.seconds for one in each])
    mean, error = seconds.mean(), seconds.std(ddof=1) / np.sqrt(len(seconds))
    times = settings * mean / whole.seconds
    rows = {
        "settings": f"{settings:,}",
        "cells computed": f"{whole.cells:,}",
        "cells of a loop over the settings": f"{cells:,.0f}",
        "results reused": f"{100 * (1 - whole.cells / cells):.3g} %",
        "time, of the processor": f"{run.seconds:,.0f} s, {run.cpu:,.0f} s",
        "cells a second of the processor": f"{whole.cells / run.cpu:,.0f}",
        "settings a second of the processor": f"{settings / run.cpu:,.3g}",
        "most memory, all processes": f"{run.together:,.0f} MiB",
        "the same command again": f"{again.made:,} cells, {again.run.cpu:.1f} s of the processor",
        "time of all calls": f"{whole.seconds:,.0f} s",
        "the same in a loop over the settings": f"{settings * mean / 3600:,.3g} h: "
        f"{times:,.3g} ± {2 * times * error / mean:.2g} times as long",
    }
    equal = f" Figures of {compared} of them are also the sweep's, and equal." if compared else ""
    return Report(
        "The engine",
        COLUMNS,
        [{"what": what, "value": value} for what, value in rows.items()],
        [
            "Measured once, with nothing in the cache but the built ships. A loop computes anew "
            f"what each setting needs: the mean of {len(each)} settings at random, each swept "
            f"alone with a cache of its own, ± two standard errors.{equal}"
        ],
    )
