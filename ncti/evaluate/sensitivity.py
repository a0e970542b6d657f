"""Sobol indices of a figure over several settings, and interpolation of a grid of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Shares of the variance of a figure that settings account for.

    Attributes
    ----------
    names : tuple of str
        Settings.
    first : (setting,) float64 ndarray
        First-order index: share of the variance that the setting alone accounts for.
    total : (setting,) float64 ndarray
        Total index: share that is left if all others are fixed.
    first_interval, total_interval : (setting,) float64 ndarray
        Half widths of their 95 % intervals.

    See Also
    --------
    sobol_indices : Estimates them.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.evaluate.sensitivity import SobolIndices
    >>> SobolIndices(("cnr",), np.ones(1), np.ones(1), np.zeros(1), np.zeros(1)).names
    ('cnr',)
    """

    names: tuple[str, ...]
    first: Floats
    total: Floats
    first_interval: Floats
    total_interval: Floats


def sobol_indices(
    figure: Callable[[Floats], ArrayLike],
    bounds: Mapping[str, tuple[float, float]],
    *,
    samples: int = 1024,
    seed: int = 0,
) -> SobolIndices:
    """Return the Sobol indices of a function of several settings, by SALib.

    Parameters
    ----------
    figure : callable
        Function of (point, setting) float64 arrays that returns a value for each point.
    bounds : mapping of str to (float, float)
        Interval of each setting, in which it is uniform.
    samples : int
        Points of the base sequence, a power of 2; the function is called with ``samples`` times
        the number of settings plus 2.
    seed : int
        Seed of the scrambled sequence, and of the resamples of the intervals.

    Returns
    -------
    SobolIndices
        First and total indices, with 95 % intervals of the sampling from 200 resamples.

    Raises
    ------
    ValueError
        If an interval is empty or the number of samples no power of 2.
    ImportError
        If SALib is not installed; it comes with ``ncti-sweep[design]``.

    See Also
    --------
    grid_interpolant : Function of a grid's values.

    Notes
    -----
    Saltelli's design and estimators [1]_ as SALib has them, of a scrambled Sobol sequence. The
    intervals are of that sampling alone; what the figure's own noise adds shows in the indices of
    resampled figures.

    References
    ----------
    .. [1] A. Saltelli et al., "Variance based sensitivity analysis of model output", Computer
       Physics Communications 181, 259-270 (2010), doi:10.1016/j.cpc.2009.09.018.

    Examples
    --------
    Of a + 2 b, both uniform in the same interval, b has four fifths of the variance:

    >>> from ncti.evaluate.sensitivity import sobol_indices
    >>> bounds = {"a": (0.0, 1.0), "b": (0.0, 1.0)}
    >>> indices = sobol_indices(lambda x: x @ [1.0, 2.0], bounds)
    >>> indices.first.round(2).tolist()
    [0.2, 0.8]
    """
    require("samples", samples, minimum=2, whole=True)
    if samples & (samples - 1):
        raise ValueError(f"samples is {samples}, but must be a power of 2")
    for name, (low, high) in bounds.items():
        require(f"bounds[{name!r}]", high - low, positive=True)
    from SALib.analyze import sobol as analysis
    from SALib.sample import sobol as sampling

    problem = {
        "num_vars": len(bounds),
        "names": list(bounds),
        "bounds": [list(ends) for ends in bounds.values()],
    }
    points = sampling.sample(problem, samples, calc_second_order=False, seed=seed)
    values = require_all("figure", np.asarray(figure(points), dtype=np.float64))
    done = analysis.analyze(
        problem,
        values,
        calc_second_order=False,
        num_resamples=200,
        conf_level=0.95,
        seed=seed,
    )
    arrays = (np.asarray(done[name]) for name in ("S1", "ST", "S1_conf", "ST_conf"))
    return SobolIndices(tuple(bounds), *arrays)


def grid_interpolant(
    axes: Sequence[ArrayLike], values: ArrayLike
) -> Callable[[ArrayLike], NDArray[Any]]:
    """Return the multilinear interpolant of values on a grid, linear in the logarithms of axes.

    Parameters
    ----------
    axes : sequence of (x,) array_like
        Positive, increasing places along each axis.
    values : (x, ...) array_like
        Values on the grid.

    Returns
    -------
    callable
        Function of (point, axis) arrays of the logarithms of places.

    Raises
    ------
    ValueError
        If axes and values do not match.

    See Also
    --------
    interpolation_errors : Its error, from the grid itself.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.evaluate.sensitivity import grid_interpolant
    >>> between = grid_interpolant([[1, 4], [10, 20]], [[0.0, 1.0], [2.0, 3.0]])
    >>> between(np.log([[2, 10], [4, 20]])).round(3).tolist()
    [1.0, 3.0]
    """
    # Imported here because scipy takes a while.
    from scipy.interpolate import RegularGridInterpolator

    logs = [np.log(require_all("axes", axis, positive=True)) for axis in axes]
    return RegularGridInterpolator(logs, require_all("values", values))


def interpolation_errors(axes: Sequence[ArrayLike], values: ArrayLike) -> Floats:
    """Return the error of `grid_interpolant` at every second place of each axis, left out.

    Parameters
    ----------
    axes, values
        As of `grid_interpolant`.

    Returns
    -------
    (axis,) float64 ndarray
        Root mean square error of values interpolated between the places beside theirs, on that
        axis alone; NaN for axes of fewer than three places. With steps twice as wide it is, for
        smooth values, about four times that of the whole grid half-way between places.

    Raises
    ------
    ValueError
        If axes and values do not match.

    See Also
    --------
    grid_interpolant : The interpolant.

    Examples
    --------
    >>> from ncti.evaluate.sensitivity import interpolation_errors
    >>> interpolation_errors([[1, 2, 4]], [0.0, 0.6, 1.0]).round(2).tolist()
    [0.1]
    """
    given = require_all("values", values)
    errors = np.full(len(axes), np.nan)
    for k, axis in enumerate(axes):
        logs = np.log(require_all("axes", axis, positive=True))
        if len(logs) != given.shape[k]:
            raise ValueError(f"axes[{k}] has {len(logs)} places, but must have {given.shape[k]}")
        along = np.moveaxis(given, k, 0)
        middle = np.arange(1, len(logs) - 1, 2)
        if not middle.size:
            continue
        part = (logs[middle] - logs[middle - 1]) / (logs[middle + 1] - logs[middle - 1])
        part = part.reshape(-1, *[1] * (along.ndim - 1))
        between = along[middle - 1] * (1 - part) + along[middle + 1] * part
        errors[k] = np.sqrt(np.mean((along[middle] - between) ** 2))
    return errors
