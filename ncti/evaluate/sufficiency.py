"""Crossing of a level by a share of right answers, and the least cost of reaching it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]

ROUNDING = 1e-12  # of a mean of shares

TAILS = (0.025, 0.975)
"""Quantiles of resamples that are the ends of an interval."""


def isotonic(values: ArrayLike) -> Floats:
    """Return the non-decreasing values nearest to given ones, along the last axis.

    Parameters
    ----------
    values : (..., x) array_like
        Values, a few along x.

    Returns
    -------
    (..., x) float64 ndarray
        Least-squares fit.

    Raises
    ------
    ValueError
        If a value is not finite.

    See Also
    --------
    crossing : Where they reach a level.

    Notes
    -----
    At k the largest, over i up to k, of the smallest mean from i to j, over j from k on [1]_.

    References
    ----------
    .. [1] R. E. Barlow et al., Statistical Inference under Order Restrictions, Wiley, 1972,
       section 1.2.

    Examples
    --------
    >>> from ncti.evaluate import isotonic
    >>> isotonic([0.1, 0.4, 0.2, 0.9]).round(2).tolist()
    [0.1, 0.3, 0.3, 0.9]
    """
    given = require_all("values", values)
    count = given.shape[-1]
    fitted = np.full(given.shape, -np.inf)
    for i in range(count):
        means = np.cumsum(given[..., i:], axis=-1) / np.arange(1, count - i + 1)
        # The smallest mean from i to j, for j from each place on.
        least = np.minimum.accumulate(means[..., ::-1], axis=-1)[..., ::-1]
        np.maximum(fitted[..., i:], least, out=fitted[..., i:])
    return fitted


def crossing(values: ArrayLike, places: ArrayLike, *, level: float = 0.95) -> Floats:
    """Return the smallest place at which values that grow along the last axis reach a level.

    Parameters
    ----------
    values : (..., x) array_like
        Values, such as shares of right answers; made non-decreasing by `isotonic`.
    places : (x,) array_like
        Places, positive and increasing, such as numbers of frames.
    level : float
        Level to reach.

    Returns
    -------
    (...) float64 ndarray
        Place, linear in its logarithm between those given; the first of them where the level is
        reached from the start, and infinity where it is not reached at all.

    Raises
    ------
    ValueError
        If a value is not finite, or places are not positive and increasing, one for each value.

    See Also
    --------
    cheapest : The least cost of reaching it.

    Examples
    --------
    >>> from ncti.evaluate import crossing
    >>> crossing([[0.5, 0.9, 1.0], [0.97, 1.0, 1.0], [0.2, 0.3, 0.4]], [4, 16, 64])
    array([32.,  4., inf])
    """
    require("level", level)
    fitted, at = isotonic(values), require_all("places", places)
    if at.shape != fitted.shape[-1:] or not (at > 0).all() or not (np.diff(at) > 0).all():
        raise ValueError(
            f"places is {at.tolist()}, but must be {fitted.shape[-1]} positive, increasing numbers"
        )
    log = np.log(at)
    reached = fitted >= level - ROUNDING
    first = reached.argmax(axis=-1)
    before = np.maximum(first - 1, 0)
    low, high = (np.take_along_axis(fitted, k[..., None], -1)[..., 0] for k in (before, first))
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(first > 0, (level - low) / (high - low), 0.0)
        place = np.exp(log[before] + part * (log[first] - log[before]))
    return np.where(reached.any(axis=-1), np.where(first > 0, place, at[0]), np.inf)


def cheapest(cost: xr.DataArray, over: tuple[str, ...], resample: str = "resample") -> xr.Dataset:
    """Return the least cost over settings, its interval, and the setting that has it.

    Parameters
    ----------
    cost : xarray.DataArray
        Cost of each setting, infinite where it does not suffice, over the axes of `over`, others,
        and `resample`, whose first place is the cost from all answers and whose others are those
        from resampled ones.
    over : tuple of str
        Axes of the settings.
    resample : str
        Name of the axis of resamples.

    Returns
    -------
    xarray.Dataset
        `cost`, with `cost_low` and `cost_high`, the 95 % interval over resamples of the least
        cost; each name of `over`, the value of the cheapest setting, NaN where none suffices; and
        `chosen`, the share of resamples that choose this setting.

    See Also
    --------
    crossing : Where a setting suffices.

    Notes
    -----
    The least of noisy costs is too low on average, in the resamples even more so than in the
    answers; `chosen` says how firmly the setting is the cheapest.

    Examples
    --------
    >>> import xarray as xr
    >>> from ncti.evaluate import cheapest
    >>> cost = xr.DataArray(
    ...     [[4.0, 5.0, 3.0], [2.0, 6.0, 2.0]],
    ...     {"cnr": [26.0, 32.0]}, ("cnr", "resample"),
    ... )
    >>> least = cheapest(cost, ("cnr",))
    >>> float(least.cost), float(least.cnr), float(least.chosen)
    (2.0, 32.0, 0.5)
    """
    import xarray as xr

    flat = cost.stack(setting=over).transpose(..., resample, "setting")
    least = flat.min("setting")
    place = flat.argmin("setting")
    best, again = place.isel({resample: 0}), place.isel({resample: slice(1, None)})
    there = np.isfinite(least.isel({resample: 0}))
    ends = [
        xr.apply_ufunc(
            lambda values, q=q: np.quantile(values, q, axis=-1, method="inverted_cdf"),
            least.isel({resample: slice(1, None)}),
            input_core_dims=[[resample]],
        )
        for q in TAILS
    ]
    columns = {
        "cost": least.isel({resample: 0}),
        "cost_low": ends[0],
        "cost_high": ends[1],
        "chosen": (again == best).mean(resample).where(there),
    }
    for name in over:
        values = flat[name].values[best.values]
        columns[name] = best.copy(data=values).where(there)
    bare = {
        name: column.drop_vars(["setting", *over], errors="ignore")
        for name, column in columns.items()
    }
    return xr.Dataset(bare)
