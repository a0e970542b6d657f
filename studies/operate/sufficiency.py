"""Crossing of a level by a share of right answers, and the least cost of reaching it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]

ROUNDING = 1e-12  # of a mean of shares

TAILS = (0.025, 0.975)
"""Quantiles of resamples that are the ends of an interval."""


def isotonic(values: ArrayLike) -> Floats:
    """Return the non-decreasing values (..., x) nearest to given ones, by least squares.

    At k it is the largest, over i up to k, of the smallest mean from i to j, over j from k on (R.
    E. Barlow et al., Statistical Inference under Order Restrictions, Wiley, 1972, section 1.2).
    """
    series = np.asarray(values, dtype=np.float64)
    count = series.shape[-1]
    fitted = np.full(series.shape, -np.inf)
    for i in range(count):
        means = np.cumsum(series[..., i:], axis=-1) / np.arange(1, count - i + 1)
        # The smallest mean from i to j, over j from each index on.
        least = np.minimum.accumulate(means[..., ::-1], axis=-1)[..., ::-1]
        np.maximum(fitted[..., i:], least, out=fitted[..., i:])
    return fitted


def crossing(values: ArrayLike, places: ArrayLike, *, level: float = 0.95) -> Floats:
    """Return the smallest place (...) at which values (..., x) reach a level.

    Values are made non-decreasing by `isotonic`; places (x,), such as numbers of frames, are
    positive and increase. Between places, their logarithm is interpolated linearly. The result is
    the first place if it already reaches the level, and infinity if no place does.
    """
    fitted, positions = isotonic(values), np.asarray(places, dtype=np.float64)
    log = np.log(positions)
    reached = fitted >= level - ROUNDING
    first = reached.argmax(axis=-1)
    before = np.maximum(first - 1, 0)
    low, high = (np.take_along_axis(fitted, k[..., None], -1)[..., 0] for k in (before, first))
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(first > 0, (level - low) / (high - low), 0.0)
        position = np.exp(log[before] + fraction * (log[first] - log[before]))
    return np.where(reached.any(axis=-1), np.where(first > 0, position, positions[0]), np.inf)


def cheapest_setting(cost: xr.DataArray, over: tuple[str, ...]) -> xr.Dataset:
    """Return the least cost over settings, its interval, and the setting that has it.

    `cost`, infinite where a setting does not suffice, has the axes `over` of the settings, others,
    and `resample`, whose first place is the cost from all answers and whose others are those from
    resampled ones. The result has `cost`, with `cost_low` and `cost_high`, the 95 % interval of the
    least cost over resamples; each name of `over`, the value of the cheapest setting, NaN where
    none suffices; and `chosen`, the share of resamples that choose this setting.

    The least of noisy costs is too low on average, in the resamples even more so than in the
    answers; `chosen` says how firmly the setting is the cheapest.
    """
    import xarray as xr

    flat = cost.stack(setting=over).transpose(..., "resample", "setting")
    least = flat.min("setting")
    index = flat.argmin("setting")
    best, resampled = index.isel({"resample": 0}), index.isel({"resample": slice(1, None)})
    suffices = np.isfinite(least.isel({"resample": 0}))
    ends = [
        xr.apply_ufunc(
            lambda values, q=q: np.quantile(values, q, axis=-1, method="inverted_cdf"),
            least.isel({"resample": slice(1, None)}),
            input_core_dims=[["resample"]],
        )
        for q in TAILS
    ]
    columns = {
        "cost": least.isel({"resample": 0}),
        "cost_low": ends[0],
        "cost_high": ends[1],
        "chosen": (resampled == best).mean("resample").where(suffices),
    }
    for name in over:
        values = flat[name].values[best.values]
        columns[name] = best.copy(data=values).where(suffices)
    bare = {
        name: column.drop_vars(["setting", *over], errors="ignore")
        for name, column in columns.items()
    }
    return xr.Dataset(bare)
