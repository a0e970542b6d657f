"""Sobol indices of a figure over several settings, and interpolation of a grid of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def sobol_indices(
    figure: Callable[[Floats], ArrayLike],
    bounds: Mapping[str, tuple[float, float]],
    *,
    samples: int = 1024,
    seed: int = 0,
) -> dict[str, Floats]:
    """Return the Sobol indices of a function of several settings, with 95 % intervals, by SALib.

    `figure` returns a value for each of (point, setting); settings are uniform within their bounds.
    `samples`, a power of 2, is the length of the scrambled base sequence: `figure` is called with
    as many times the number of settings plus 2. Design and estimators are Saltelli's (Computer
    Physics Communications 181, 259 (2010)); intervals, of 200 resamples, cover that
    sampling alone: to see the noise of the figure, compute the indices of resampled figures. Needs
    ``ncti-sweep[design]``.
    """
    from SALib.analyze import sobol as analysis
    from SALib.sample import sobol as sampling

    problem = {
        "num_vars": len(bounds),
        "names": list(bounds),
        "bounds": [list(ends) for ends in bounds.values()],
    }
    points = sampling.sample(problem, samples, calc_second_order=False, seed=seed)
    values = np.asarray(figure(points), dtype=np.float64)
    indices = analysis.analyze(
        problem,
        values,
        calc_second_order=False,
        num_resamples=200,
        conf_level=0.95,
        seed=seed,
    )
    names = {"S1": "first", "ST": "total", "S1_conf": "first_interval", "ST_conf": "total_interval"}
    return {name: np.asarray(indices[key]) for key, name in names.items()}


def grid_interpolant(
    axes: Sequence[ArrayLike], values: ArrayLike
) -> Callable[[ArrayLike], NDArray[Any]]:
    """Return the multilinear interpolant of values on a grid, linear in the logarithms of axes.

    It is a function of (point, axis) logarithms; the `axes` are positive and increase.
    """
    from scipy.interpolate import RegularGridInterpolator

    logs = [np.log(axis) for axis in axes]
    return RegularGridInterpolator(logs, np.asarray(values, dtype=np.float64))


def interpolation_errors(axes: Sequence[ArrayLike], values: ArrayLike) -> Floats:
    """Return the (axis,) error of `grid_interpolant` at every second place of each axis, left out.

    It is the root mean square of values interpolated along that axis alone; NaN for fewer than
    three places. With steps twice as wide it is, for smooth values, about four times that of the
    whole grid half-way between places.
    """
    grid = np.asarray(values, dtype=np.float64)
    errors = np.full(len(axes), np.nan)
    for k, axis in enumerate(axes):
        logs = np.log(axis)
        along = np.moveaxis(grid, k, 0)
        middle = np.arange(1, len(logs) - 1, 2)
        if not middle.size:
            continue
        weight = (logs[middle] - logs[middle - 1]) / (logs[middle + 1] - logs[middle - 1])
        weight = weight.reshape(-1, *[1] * (along.ndim - 1))
        between = along[middle - 1] * (1 - weight) + along[middle + 1] * weight
        errors[k] = np.sqrt(np.mean((along[middle] - between) ** 2))
    return errors
