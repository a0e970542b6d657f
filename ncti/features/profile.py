"""The range-profile vector: noise floor removed, peak normalised."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all

LARGEST = 1e300  # either way: sums over an edge stay numbers
EDGE = 0.08  # of the window at each end, for the noise alone


def profile_vector(
    profile: ArrayLike,
    *,
    floor: ArrayLike | None = None,
    edge: float = EDGE,
) -> NDArray[np.float64]:
    """Profiles as a classifier takes them.

    Parameters
    ----------
    profile : (..., bin) array_like
        Range profiles, noise floor included.
    floor : (...) array_like, optional
        Known noise floor, in the profile's units. Without it, the floor is the mean over both
        edges of the window.
    edge : float
        Share of the bins, at each end of the window, that no ship reaches, in (0, 0.5].

    Returns
    -------
    (..., bin) float64 ndarray
        (profile - floor) / max(profile - floor): the peak is 1. A profile that nowhere rises
        above its floor becomes zeros. Values below the floor stay negative, so that noise
        averages out in an inner product.

    Raises
    ------
    ValueError
        If a profile has no bins, a profile or a floor is not finite or beyond 1e300 either way,
        or the share is out of range.

    Notes
    -----
    Article, 'Classification Results Using Synthetic Range Profiles', normalises to the peak
    and says nothing of the floor. Left in, a floor of thousands of IFOVs makes all profiles
    alike; the median over bins is no estimate of it, since a ship seen from the bow fills most
    of the window.
    """
    values = np.asarray(profile, dtype=np.float64)
    if not np.isfinite(values).all():
        raise ValueError("profile holds a value that is not finite, but must be all numbers")
    moderate = {"minimum": -LARGEST, "maximum": LARGEST}
    require_all("profile", values, **moderate)
    if values.ndim == 0 or values.shape[-1] == 0:
        raise ValueError(f"profile has shape {values.shape}, but must have bins")
    if floor is None:
        level = estimated_floor(values, edge=edge)
    else:
        level = require_all("floor", floor, **moderate)[..., None]
    above = values - level
    peak = above.max(axis=-1, keepdims=True)
    # Rounding leaves a flat profile a few ulp above its own floor: that is no peak.
    flat = peak <= 1e-12 * np.abs(values).max(axis=-1, keepdims=True)
    return np.where(flat, 0.0, above / np.where(flat, 1.0, peak))


def estimated_floor(profile: ArrayLike, *, edge: float = EDGE) -> NDArray[np.float64]:
    """Noise floor of profiles, the mean over both edges of the window.

    Parameters
    ----------
    profile : (..., bin) array_like
        Range profiles.
    edge : float
        As for `profile_vector`.

    Returns
    -------
    (..., 1) float64 ndarray
        In the profile's units.

    Raises
    ------
    ValueError
        If the share is out of range.
    """
    require("edge", edge, positive=True, maximum=0.5)
    values = np.asarray(profile, dtype=np.float64)
    count = max(1, round(edge * values.shape[-1]))
    outer = np.concatenate([values[..., :count], values[..., -count:]], axis=-1)
    level: NDArray[np.float64] = outer.mean(axis=-1, keepdims=True)
    return level
