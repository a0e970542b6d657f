"""Landmarks of a near-stern range profile: hangar, stern, masts and bridge as numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import NothingSeenError, require, require_flags, require_shape

MAST = (40.0, 50.0)  # m past the hangar, for frigates of the Perry class
FORWARD = (57.0, 64.0)
REACH = 1.5  # m; half the width of a peak
TRANSOM = 5.0  # m from the stern end
DECK = 4.0  # m from the stern end
APRON = 4.0  # m before the hangar, on the slope of its peak
END_SHARE = 0.05  # share of the highest peak
FRONT_SHARE = 0.98  # share of all returns
PROMINENCE = 0.05  # share of the hangar's height by which a peak stands out

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Peak:
    """A peak relative to the hangar's.

    Attributes
    ----------
    offset : float
        Distance past the hangar [m], negative towards the stern; NaN for no peak.
    height : float
        Highest bin over the hangar's.
    energy : float
        Returns within 1.5 m of it over those of the hangar. Unlike heights, they hardly depend on
        the position of the bins.

    See Also
    --------
    landmarks : Measure the peaks of a profile.

    Examples
    --------
    >>> Peak(offset=45.0, height=0.28, energy=0.3).offset
    45.0
    """

    offset: float
    height: float
    energy: float


@dataclass(frozen=True)
class Landmarks:
    """Landmarks measured in a near-stern profile of a frigate.

    Attributes
    ----------
    hangar : float
        Down-range of the hangar's spike [m].
    stern : float
        Distance from the stern end to the hangar [m].
    bridge : float
        Distance from the hangar to the front of the forward structure [m].
    transom : Peak
        Highest bin within 5 m of the stern end, whether or not it is a peak.
    mast : Peak
        Peak of the main mast.
    forward : Peak
        Peak of the aft face of the block below the bridge.
    deck_spikes : tuple of float
        Offsets of the peaks between transom and hangar [m].

    See Also
    --------
    landmarks : Measure them in a profile.

    Examples
    --------
    >>> nothing = Peak(float("nan"), 0.0, 0.0)
    >>> marks = Landmarks(-33.5, 28.0, 60.9, nothing, nothing, nothing, deck_spikes=())
    >>> marks.stern_to_bridge
    88.9
    """

    hangar: float
    stern: float
    bridge: float
    transom: Peak
    mast: Peak
    forward: Peak
    deck_spikes: tuple[float, ...]

    @property
    def stern_to_bridge(self) -> float:
        """Distance from the stern end to the front of the forward structure [m].

        In range: cos(depression) cos(aspect) times the length on deck, apart from the difference in
        height of the two ends.
        """
        return self.stern + self.bridge


def landmarks(
    profile: ArrayLike,
    down_range: ArrayLike,
    *,
    hangar: tuple[float, float] | None = None,
    end: float = END_SHARE,
) -> Landmarks:
    """Measure the landmarks of a near-stern profile.

    Parameters
    ----------
    profile : (bin,) array_like
        Returned intensity in each range bin, noise floor removed, in any unit.
    down_range : (bin,) array_like
        Centres of the bins [m], increasing evenly away from the sensor.
    hangar : (float, float), optional
        Window of the hangar's spike [m]; the highest peak of all when not given.
    end : float
        Share of the highest peak that marks the first bin of the ship, in (0, 1).

    Returns
    -------
    Landmarks
        A missing peak has offset NaN, and height and energy 0.

    Raises
    ------
    ValueError
        If the shapes differ, the bins are uneven, a value is not finite, or a parameter is out of
        range.
    ncti.checks.NothingSeenError
        If nothing returns where the hangar should be.

    See Also
    --------
    profile : Range profile of a corrected flight.
    profile_correlation : Similarity of two profiles as a whole.

    Notes
    -----
    The article discusses these features by eye [1]_: the hangar's spike, the length from stern to
    bridge, the transom's spike, the masts, and the spikes of a point-sampled flight deck.

    The place of a peak is the centroid of the part above half its height, within 1.5 m. Heights
    depend on the position of the bins' edges, those of a hangar 1.8 m deep by a quarter; energies
    hardly do.

    The article finds the length from stern to bridge to be equal in model and measurement. The
    stern is steep, and its place is the centre of its first bin. The front, seen from behind, fades
    out over roofs, so no height marks its place: it is where 98 % of all returns have arrived.

    The mast and the forward block are the highest peaks 40 to 50 m and 57 to 64 m past the hangar,
    where the Perry class has them. Where something else is higher than the hangar, as the Connole's
    stack is, give the window of the hangar.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Discussion of Range Profiles from Ships' and 'Validation of
       Synthetic Range Profiles', Figures 14 and 16.

    Examples
    --------
    A profile with a transom, a hangar, a mast and a forward block:

    >>> import numpy as np
    >>> bins = np.arange(-125, 125) + 0.5
    >>> parts = {-60.5: 0.3, -33.5: 1.0, 11.5: 0.25, 26.5: 0.2}
    >>> profile = sum(height * np.exp(-((bins - place) ** 2)) for place, height in parts.items())
    >>> marks = landmarks(profile, bins)
    >>> marks.hangar, marks.stern, marks.mast.offset, marks.forward.offset
    (-33.5, 28.0, 45.0, 60.0)
    """
    values, centres, width = _checked_profile(profile, down_range)
    require("end", end, positive=True, below=1.0)
    low, high = (centres[0], centres[-1]) if hangar is None else hangar
    inside = (centres >= low) & (centres <= high)
    if not inside.any() or not values[inside].max() > 0:
        subject = "profile has" if hangar is None else f"hangar is {hangar!r}, which has"
        raise NothingSeenError(f"{subject} no return above 0, but must have one")
    # The hangar's spike is the reference of all places, heights and energies.
    top = int(np.flatnonzero(inside)[values[inside].argmax()])
    spike, height = _centroid(values, centres, top), float(values[top])
    energy = _energy(values, centres, spike, width)

    def peak(index: int) -> Peak:
        """Return the peak of a bin."""
        place = _centroid(values, centres, index)
        share = _energy(values, centres, place, width) / energy
        return Peak(place - spike, float(values[index]) / height, share)

    from scipy.signal import find_peaks

    # Zeros on both sides, so that a maximum at the profile's end is a peak, too.
    peak_bins = find_peaks(np.pad(values, 1), prominence=PROMINENCE * height)[0] - 1

    def highest(near: float, far: float) -> Peak:
        """Return the highest peak from `near` to `far` past the hangar."""
        offsets = centres[peak_bins] - spike
        peaks = peak_bins[(offsets >= near) & (offsets <= far)]
        return peak(int(peaks[values[peaks].argmax()])) if peaks.size else Peak(math.nan, 0.0, 0.0)

    # Ends of the ship, the transom at its stern and the spikes of the deck before the hangar.
    stern, last = _ends(values, centres, width, end)
    aft = np.flatnonzero((centres >= stern) & (centres <= stern + TRANSOM) & (centres < spike))
    transom = peak(int(aft[values[aft].argmax()])) if aft.size else Peak(math.nan, 0.0, 0.0)
    # The deck begins beyond the transom, including its slope.
    begins = max(stern + DECK, spike + np.nan_to_num(transom.offset, nan=-math.inf) + REACH)
    deck = (centres[peak_bins] > begins) & (centres[peak_bins] < spike - APRON)
    return Landmarks(
        hangar=spike,
        stern=spike - stern,
        bridge=last - spike,
        transom=transom,
        mast=highest(*MAST),
        forward=highest(*FORWARD),
        deck_spikes=tuple(_centroid(values, centres, n) - spike for n in peak_bins[deck]),
    )


def profile_correlation(
    first: ArrayLike, second: ArrayLike, *, exclude: ArrayLike | None = None
) -> Floats:
    """Return the correlation of profiles on the same bins.

    Parameters
    ----------
    first, second : (..., bin) array_like
        Profiles, in any unit.
    exclude : (bin,) array_like of bool, optional
        Bins to omit, such as those within 4 m of the hangar, which otherwise dominates.

    Returns
    -------
    (...) float64 ndarray
        Pearson's coefficient, in [-1, 1], independent of gain and floor; 0 where a profile is flat.

    Raises
    ------
    ValueError
        If the shapes differ, a value is not finite or fewer than two bins are left.

    See Also
    --------
    landmarks : Compare profiles by their landmarks.

    Examples
    --------
    >>> import numpy as np
    >>> profile = np.array([0.0, 3.0, 1.0, 1.0, 0.0])
    >>> print(f"{profile_correlation(profile, 2 * profile + 1):.2f}")
    1.00
    >>> print(f"{profile_correlation(profile, profile[::-1]):.2f}")
    0.33
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    for name, values in (("first", a), ("second", b)):
        if values.ndim < 1 or not np.isfinite(values).all():
            raise ValueError(f"{name} is not an array of finite numbers, but must be profiles")
    if a.shape[-1] != b.shape[-1]:
        raise ValueError(f"second has {b.shape[-1]} bins, but must have {a.shape[-1]} as first")
    included = np.ones(a.shape[-1], dtype=bool)
    if exclude is not None:
        excluded = require_flags("exclude", exclude)
        require_shape("exclude", excluded, included.shape)
        included = ~excluded
    if included.sum() < 2:
        raise ValueError(f"exclude leaves {included.sum()} bins, but must leave at least 2")
    a, b = _standardised_profiles(a[..., included]), _standardised_profiles(b[..., included])
    return np.asarray(np.clip((a * b).sum(axis=-1), -1.0, 1.0))


def _standardised_profiles(values: Floats) -> Floats:
    """Return profiles of mean 0 and norm 1, or zero."""
    deviation = values - values.mean(axis=-1, keepdims=True)
    norm = np.sqrt((deviation**2).sum(axis=-1, keepdims=True))
    # Rounding leaves a flat profile a few units in the last place off its mean.
    flat = norm <= 1e-12 * np.abs(values).max(axis=-1, keepdims=True) * values.shape[-1]
    return np.where(flat, 0.0, deviation / np.where(flat, 1.0, norm))


def _ends(values: Floats, centres: Floats, width: float, end: float) -> tuple[float, float]:
    """Return the down-range of the stern and of the front of the bridge [m]."""
    stern = int(np.flatnonzero(values >= end * values.max())[0])
    arrived = np.concatenate([[0.0], np.cumsum(np.maximum(values[stern:], 0.0))])
    edges = centres[stern] - width / 2 + width * np.arange(arrived.size)
    return float(centres[stern]), float(np.interp(FRONT_SHARE * arrived[-1], arrived, edges))


def _centroid(values: Floats, centres: Floats, top: int) -> float:
    """Return the place of the peak whose highest bin is `top` [m]."""
    near = np.abs(centres - centres[top]) <= REACH
    weight = np.where(near, np.maximum(values - values[top] / 2, 0.0), 0.0)
    return float(weight @ centres / weight.sum())


def _energy(values: Floats, centres: Floats, place: float, width: float) -> float:
    """Return the sum of returns within reach of a place; bins at the edge count in part."""
    low = np.maximum(centres - width / 2, place - REACH)
    high = np.minimum(centres + width / 2, place + REACH)
    return float(values @ (np.maximum(high - low, 0.0) / width))


def _checked_profile(profile: ArrayLike, down_range: ArrayLike) -> tuple[Floats, Floats, float]:
    """Return values, centres and width of the bins, checked."""
    values = np.asarray(profile, dtype=np.float64)
    centres = np.asarray(down_range, dtype=np.float64)
    if values.ndim != 1 or values.size < 3 or not np.isfinite(values).all():
        raise ValueError(
            f"profile has shape {values.shape}, but must be three or more finite numbers in a row"
        )
    require_shape("down_range", centres, values.shape)
    steps = np.diff(centres)
    width = float(steps.mean())
    if not (width > 0 and np.allclose(steps, width, rtol=1e-6, atol=0.0)):
        raise ValueError(
            f"down_range steps by {steps.min():g} to {steps.max():g} m, but must increase evenly"
        )
    return values, centres, width
