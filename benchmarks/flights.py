"""Seconds of a simulated flight and of its corrections, and where they go."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

import ncti.ships
from benchmarks.reports import Column, Report, Sample
from ncti.irar import (
    Flight,
    correct,
    fly,
    profile,
    segmented,
    ship_heading,
    ship_window,
)

# Name, slant range [m], aspect [deg], samples a line: the study's two missions, and a beam view of
# twelve lines a pixel.
FLIGHTS = (
    ("connole", 3000.0, 175.0, 160),
    ("roberts", 3900.0, 175.0, 160),
    ("connole", 4700.0, 90.0, 220),
)
STEPS = ("fly", "record", "correct", "overscanned", "profile")
HEADINGS = dict(zip(STEPS, ("fly", "record", "correct", "fine", "profile"), strict=True))


def measure(*, repeats: int) -> Report:
    """Time every step from a ship's mesh to its corrected profile.

    Parameters
    ----------
    repeats : int
        How often each flight is flown, after one that is not counted.

    Returns
    -------
    Report
        One row per flight.
    """
    rows = []
    for name, slant_range, aspect, samples in FLIGHTS:
        mesh = ncti.ships.load(name)
        flight = Flight(
            slant_range=slant_range,
            ship_heading=ship_heading(aspect=aspect, sight=5.0),
            samples=samples,
            pulse_rate=119.0 * samples,
        )
        taken: dict[str, list[float]] = {step: [] for step in STEPS}
        for turn in range(repeats + 1):
            found, lines = _once(mesh, flight, np.random.default_rng(turn))
            if turn:
                for step, seconds in found.items():
                    taken[step].append(seconds)
        whole = [sum(parts) for parts in zip(*taken.values(), strict=True)]
        row: dict[str, Any] = {
            f"{step}_ms": 1e3 * Sample.of(values).median for step, values in taken.items()
        }
        rows.append(
            row
            | {
                "flight": f"{name} {slant_range / 1e3:g} km {aspect:g}°",
                "lines": lines,
                "overscan": flight.lines_per_pixel,
                "whole": Sample.of(whole),
            }
        )
    columns = (
        Column("flight", "flight"),
        Column("lines", "lines", "d"),
        Column("overscan", "N", ".0f"),
        *(Column(f"{step}_ms", HEADINGS[step], ".0f") for step in STEPS),
        Column("whole", "whole [s]", ".2f"),
    )
    return Report(
        f"Flights of the airborne sensor, one pass each, {repeats} times",
        columns,
        rows,
        [
            "On one core; steps in ms, medians; N lines a pixel. `fly` casts rays, `record` draws "
            "speckle, noise and infrared images, `correct` registers, averages and filters, `fine` "
            "does so at line rate, `profile` segments and sums. Expected: under 5 s."
        ],
    )


def _once(mesh: Any, flight: Flight, rng: np.random.Generator) -> tuple[dict[str, float], int]:
    """Seconds of each step of one flight, and its lines."""
    taken: dict[str, float] = {}

    def clocked(step: str, work: Callable[[], Any]) -> Any:
        start = time.perf_counter()
        result = work()
        taken[step] = time.perf_counter() - start
        return result

    flown = clocked("fly", lambda: fly(mesh, flight))
    scan = clocked("record", lambda: flown.record(rng))
    window = ship_window(mesh, flight)
    clocked("correct", lambda: correct(scan, window=window))
    fine = clocked("overscanned", lambda: correct(scan, window=window, overscanned=True))
    clocked("profile", lambda: profile(segmented(fine, scan.flight), scan.flight))
    return taken, flown.plan.lines
