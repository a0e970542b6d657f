"""Memory of a sweep by number of aspects, of the process that drives it and of its workers."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.commands import CORES, Swept, new_folder, sweep
from benchmarks.reports import Column, Report, Sample

SHIPS = ("duncan", "spruance")
ASPECTS = (30, 120, 480)
END = 90.0  # [deg], itself not among the aspects
SCENE = ("sensor=range",)

COLUMNS = (
    Column("aspects", "aspects", "d"),
    Column("cells", "cells made", "d"),
    Column("wall_s", "time [s]", ".1f"),
    Column("driver_mib", "driver [MiB]", ".0f"),
    Column("worker_mib", "largest worker [MiB]", ".0f"),
    Column("together_mib", "all together [MiB]", ".0f"),
)


def measure(
    *, repeats: int, aspects: Sequence[int] = ASPECTS, scene: Sequence[str] = SCENE
) -> Report:
    """Measure the memory of sweeps of two ships by the laser radar.

    Parameters
    ----------
    repeats : int
        How often.
    aspects : sequence of int
        Numbers of aspects.
    scene : sequence of str
        Further arguments of the command.

    Returns
    -------
    Report
        One row per number of aspects.
    """
    rows = []
    for count in aspects:
        found = [_sweep(count, scene) for _ in range(repeats)]
        rows.append(
            {
                "aspects": count,
                "cells": found[0].made,
                "wall_s": Sample.of(one.run.seconds for one in found),
                "driver_mib": Sample.of(one.run.driver for one in found),
                "worker_mib": Sample.of(one.run.worker for one in found),
                "together_mib": Sample.of(one.run.together for one in found),
            }
        )
    return Report(
        f"Memory of `ncti-sweep {' '.join(scene)}`, {len(SHIPS)} ships, {CORES} cores, "
        f"{repeats} times",
        COLUMNS,
        rows,
        [
            "Peak of the resident memory of the command's own process and of the largest that it "
            "starts, as the system counts it (looked up some twenty times a second); of all "
            "together the highest of these looks, pages that they share counted once. Expected: "
            "workers that stay the same, since they hold a few views at a time."
        ],
    )


def _sweep(count: int, scene: Sequence[str]) -> Swept:
    step = END / count
    aspects = f"grid.aspect={{start:0,stop:{END - step!r},step:{step!r}}}"
    with tempfile.TemporaryDirectory() as parent:
        folder = new_folder(Path(parent, "cold"))
        return sweep([*scene, f"grid.ship=[{','.join(SHIPS)}]", aspects], folder)
