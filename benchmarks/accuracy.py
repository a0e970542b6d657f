"""Error of the range extent against run time, by pixel, roll and spread."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import product

import numpy as np
import trimesh
from numpy.typing import NDArray

import ncti.ships
from benchmarks.reports import Column, Report, Sample
from benchmarks.views import DEPRESSION
from ncti.ladar import range_extent
from ncti.ladar.pulse import target_kernel
from ncti.render import range_image
from ncti.render.choice import choose_engine
from ncti.render.view import ROLL

SLANT_RANGE = 100e3  # [m]
PULSE_WIDTH = 30e-9  # [s]
PIXELS = (0.5, 0.25, 0.125)  # [m]
ROLLS = (0.0, ROLL)  # [deg]
SPREADS = (0.0, 0.5)  # shares of a pixel's own range extent
ASPECTS = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0)  # [deg]
FINER = 4  # pixels of the reference along a side of the finest pixel measured

Setting = tuple[float, float, float]
"""Pixel [m], roll [deg] and spread."""

COLUMNS = (
    Column("pixel_m", "pixel [m]", ".3f"),
    Column("roll_deg", "roll [°]", ".2f"),
    Column("sampling", "sampling"),
    Column("wall_ms", "ms a view", ".1f"),
    Column("no_pulse_percent", "error, no pulse [%]", ".2f"),
    Column("pulse_percent", "error, 30 ns [%]", ".2f"),
)


def measure(
    ship: str,
    *,
    repeats: int,
    aspects: Sequence[float] = ASPECTS,
    pixels: Sequence[float] = PIXELS,
) -> Report:
    """Time and error of a ship's range extent by every sampling.

    Parameters
    ----------
    ship : str
        Name or path.
    repeats : int
        How often every view is timed.
    aspects : sequence of float
        Views [deg].
    pixels : sequence of float
        Pixels [m].

    Returns
    -------
    Report
        One row per sampling.

    Notes
    -----
    The error of a profile p is sum |p - q| / sum q over 1 m bins of all the ship, where q is
    that of a reference: the rolled image of the same view with pixels a quarter of the finest
    ones here, spread over half of their range extent. It is taken without a pulse, and after
    one of 30 ns in the power of Equation C, exp(-8 (n - k)^2 / N_z^2).
    """
    mesh = ncti.ships.load(ship)
    engine = choose_engine("auto")
    settings: list[Setting] = list(product(pixels, ROLLS, SPREADS))
    reference = (min(pixels) / FINER, ROLL, 0.5)
    seconds: dict[Setting, list[float]] = {setting: [] for setting in settings}
    errors: dict[Setting, list[tuple[float, float]]] = {setting: [] for setting in settings}
    for aspect in aspects:
        truth = _profile(mesh, aspect, reference, engine)
        for turn in range(repeats):
            # Forwards, then backwards: no sampling always follows the same one.
            for setting in settings[:: 1 if turn % 2 == 0 else -1]:
                start = time.perf_counter()
                profile = _profile(mesh, aspect, setting, engine)
                seconds[setting].append(time.perf_counter() - start)
                if turn == 0:
                    errors[setting].append(_errors(profile, truth))
    rows = []
    for pixel, roll, spread in settings:
        key = pixel, roll, spread
        no_pulse, pulse = zip(*errors[key], strict=True)
        rows.append(
            {
                "pixel_m": pixel,
                "roll_deg": roll,
                "sampling": f"spread {spread:g}" if spread else "point",
                "wall_ms": Sample.of(1e3 * value for value in seconds[key]),
                "no_pulse_percent": Sample.of(100 * value for value in no_pulse),
                "pulse_percent": Sample.of(100 * value for value in pulse),
            }
        )
    return Report(
        f"Range extent, error against time: {ship}, {engine}, {len(aspects)} aspects, "
        f"timed {repeats} times",
        COLUMNS,
        rows,
        [
            "ms a view: range image and range extent. Median (lowest–highest) over views.",
            "Error: sum of absolute differences over the sum, all of the ship in 1 m bins, from "
            f"the rolled and spread image with {reference[0]:g} m pixels, whose own error is not "
            "in it.",
        ],
    )


def _profile(
    mesh: trimesh.Trimesh, aspect: float, setting: Setting, engine: str
) -> NDArray[np.float64]:
    """(bin,) float64 ndarray: range extent of the whole ship."""
    pixel, roll, spread = setting
    image = range_image(
        mesh, aspect=aspect, depression=DEPRESSION, pixel=pixel, roll=roll, engine=engine
    )
    extent = range_extent(image, slant_range=SLANT_RANGE, spread=spread)
    profile: NDArray[np.float64] = extent.fraction.sum(axis=0)
    return profile


def _errors(profile: NDArray[np.float64], truth: NDArray[np.float64]) -> tuple[float, float]:
    """Relative errors without a pulse and after one."""
    power = target_kernel(pulse_width=PULSE_WIDTH, bin_width=1.0, bin_count=len(truth)) ** 2
    without = np.abs(profile - truth).sum() / truth.sum()
    blurred = np.abs(power @ (profile - truth)).sum() / (power @ truth).sum()
    return float(without), float(blurred)
