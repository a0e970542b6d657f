"""Constants of the bound on the sampling error of lines, fitted to true errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import QuantileRegressor
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # of scikit-learn

import ncti.ships
from benchmarks.reports import Column, Report
from benchmarks.tolerances import across_the_sight, random_views
from ncti.ladar.pulse import target_response
from ncti.ladar.sampling import FACTOR, ROUGHNESS, SLOPE, magnitude, scarcity
from ncti.render import LineImage, line_image

Floats = NDArray[np.float64]

TRUTH = 1 / 128
"""Distance of the lines that count as the truth [m]."""

STEPS = (128, 96, 64, 48, 32, 24, 16, 12, 8, 6, 4)
"""Spacings whose errors are taken, in distances of the truth's lines."""

FEWEST, LARGEST = 32, 0.3
"""Least lines across a ship, and largest error, of what is fitted to."""

COVERED = 0.977
"""Share of errors that the fitted bound covers."""

PULSES = ((0.0, 1e-12, "none"), (1e-12, 25e-9, "to 25 ns"), (25e-9, 1.0, "longer"), (0, 1, "all"))


def measure(*, views: int = 300, seed: int = 11) -> Report:
    """Return fitted constants, and coverage of the fitted bound and of that in use.

    Parameters
    ----------
    views : int
        Views to fit to, half of them nearly end-on or abeam; as many others judge.
    seed : int
        Of the views.

    Returns
    -------
    Report
        One row for each kind of pulse.
    """
    with threadpool_limits(1):
        fit = np.array(list(_errors(views, seed)))
        judge = np.array(list(_errors(views, seed + 1)))
    inputs, target = _logarithms(fit)
    some = np.random.default_rng(seed).permutation(len(fit))[:12_000]  # the fit's time grows fast
    found = QuantileRegressor(quantile=COVERED, alpha=0, solver="highs")
    found.fit(inputs[some, None], target[some])
    fitted = (float(np.exp(found.intercept_)), float(found.coef_[0]))
    true, pulse = judge[:, 0], judge[:, 3]
    rows = []
    for low, high, name in PULSES:
        here = (pulse >= low) & (pulse < high)
        row: dict[str, object] = {"pulse": name, "errors": int(here.sum())}
        for way, constants in (("in use", (FACTOR, ROUGHNESS)), ("fitted", fitted)):
            bound = _bound(judge, *constants)[here]
            row[f"covered {way}"] = 100.0 * float(np.mean(true[here] <= bound))
            row[f"ratio {way}"] = float(np.median(bound / true[here]))
        rows.append(row)
    return Report(
        f"Bound on the sampling error of lines, fitted to {views} views, judged by others",
        (
            Column("pulse", "pulse"),
            Column("errors", "errors", "d"),
            *(
                column
                for way in ("in use", "fitted")
                for column in (
                    Column(f"covered {way}", f"{way}: error <= bound [%]", ".1f"),
                    Column(f"ratio {way}", f"{way}: bound / error", ".2f"),
                )
            ),
        ),
        rows,
        [
            f"Factor, and exponent of (a n^1.6): fitted {fitted[0]:.3f}, {fitted[1]:.3f}; in use "
            f"{FACTOR:g}, {ROUGHNESS:g}.",
        ],
    )


def _errors(views: int, seed: int) -> Iterator[tuple[float, ...]]:
    """Yield error, a, lines and pulse [s] of views by lines 1 m to 1/32 m apart."""
    rng = np.random.default_rng(seed)
    half = views // 2
    for asked in (*random_views(views - half, seed), *across_the_sight(half, seed)):
        mesh, phase = ncti.ships.load(asked.ship), float(rng.uniform(0, 1))
        whole = line_image(mesh, spacing=TRUTH, phase=phase, **asked.view)
        exact = _strands(whole, asked.bin_width).sum(axis=0)
        for step in STEPS:
            some = _every(whole, step, int(rng.integers(step)))
            if some.count < FEWEST:
                continue
            strands = _strands(some, asked.bin_width)
            missed = magnitude(strands, asked.pulse_width, bin_width=asked.bin_width)
            p, q = strands.sum(axis=0), exact
            if asked.pulse_width > 0:
                response = target_response(pulse_width=asked.pulse_width, bin_width=asked.bin_width)
                p, q = np.convolve(p, response**2), np.convolve(q, response**2)
            error = float(np.abs(p - q).sum() / q.sum())
            if 0 < error < LARGEST and missed > 0:
                yield error, missed, some.count, asked.pulse_width


def _every(lines: LineImage, step: int, first: int) -> LineImage:
    """Return every so many lines, from that number on, as a view of its own."""
    kept = (lines.line - first) % step == 0
    return replace(
        lines,
        line=(lines.line[kept] - first) // np.int32(step),
        piece=lines.piece[kept],
        surface=lines.surface[kept],
        spacing=step * lines.spacing,
        phase=(lines.phase + first) / step,
    )


def _strands(lines: LineImage, bin_width: float) -> Floats:
    half = round(125 / bin_width)
    return lines.bin(
        side=1e9,
        shift=(0.5, 0.5),
        near=-half * bin_width,
        bin_width=bin_width,
        bin_count=2 * half,
    ).strands


def _logarithms(errors: Floats) -> tuple[Floats, Floats]:
    """Return the features of the regression, and the errors that it bounds."""
    true, missed, count, _ = errors.T
    few = np.array([scarcity(int(lines)) for lines in count])
    return np.log(missed * count**SLOPE), np.log(true / (missed * few))


def _bound(errors: Floats, factor: float, roughness: float) -> Floats:
    inputs, target = _logarithms(errors)
    bound: Floats = errors[:, 0] * np.exp(np.log(factor) + roughness * inputs - target)
    return bound
