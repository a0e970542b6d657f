"""Range-profile vectors: noise floor removed, peak normalised."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all
from ncti.ladar.window import EDGE_SHARE

MAX_VALUE = 1e300  # in magnitude; sums over an edge then stay finite


def profile_vector(profile: ArrayLike, *, floor: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return range profiles with the noise floor removed and the peak set to 1.

    Parameters
    ----------
    profile : (..., bin) array_like
        Range profiles, noise floor included.
    floor : (...) array_like, optional
        Known noise floor, in the units of the profile. By default the mean over the outer 8 % of
        the bins at both ends of the window, which no ship should reach.

    Returns
    -------
    (..., bin) float64 ndarray
        (profile - floor) / max(profile - floor), dimensionless; all zero for a profile that
        nowhere exceeds its floor. Values below the floor stay negative, so that noise averages out
        in an inner product.

    Raises
    ------
    ValueError
        If a profile has no bins, or a profile or floor is not finite or exceeds 1e300 in magnitude.

    See Also
    --------
    ncti.ladar.expected_profile : Expected range profile.
    ncti.ladar.cumulative_average : Averages of frames.
    ncti.classify.AdaptiveClusteringNetwork : Classifier of such vectors.

    Notes
    -----
    The article normalises profiles to the peak and does not mention the floor [1]_. If it is left
    in, the floor of thousands of IFOVs makes all profiles alike. The median over bins is no
    estimate of it, since a ship seen from the bow fills most of the window.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, section "Classification Results Using Synthetic Range Profiles".

    Examples
    --------
    Two peaks of 8 and 4 on a floor of 4,000. With the floor left in, the weaker peak would be at
    0.999 and everything else at 0.998:

    >>> import numpy as np
    >>> from ncti.features import profile_vector
    >>> profile = np.full(25, 4000.0)
    >>> profile[[10, 14]] += 8.0, 4.0
    >>> profile_vector(profile)[9:16]
    array([0. , 1. , 0. , 0. , 0. , 0.5, 0. ])

    A different gain and floor leave the vector as it is:

    >>> np.allclose(profile_vector(3.0 * profile + 100.0), profile_vector(profile))
    True
    """
    values = _checked_profiles(profile)
    if floor is None:
        level = estimated_floor(values)
    else:
        level = require_all("floor", floor, minimum=-MAX_VALUE, maximum=MAX_VALUE)[..., None]
        try:
            np.broadcast_to(level, values.shape)
        except ValueError:
            raise ValueError(
                f"floor has shape {level.shape[:-1]}, but must be that of the profiles, "
                f"{values.shape[:-1]}, or one number"
            ) from None
    above = values - level
    peak = above.max(axis=-1, keepdims=True)
    # Rounding may leave a flat profile a few ulp above its own floor, which is not a peak.
    flat = peak <= 1e-12 * np.abs(values).max(axis=-1, keepdims=True)
    return np.where(flat, 0.0, above / np.where(flat, 1.0, peak))


def estimated_floor(profile: ArrayLike) -> NDArray[np.float64]:
    """Return the noise floor (..., 1) of profiles (..., bin), their mean at both edges."""
    values = _checked_profiles(profile)
    count = max(1, round(EDGE_SHARE * values.shape[-1]))
    outer = np.concatenate([values[..., :count], values[..., -count:]], axis=-1)
    return outer.mean(axis=-1, keepdims=True)


def _checked_profiles(profile: ArrayLike) -> NDArray[np.float64]:
    """Return profiles as an array, or raise `ValueError`."""
    checked = require_all("profile", profile, minimum=-MAX_VALUE, maximum=MAX_VALUE)
    if checked.ndim == 0 or checked.shape[-1] == 0:
        raise ValueError(f"profile has shape {checked.shape}, but must have bins")
    return checked
