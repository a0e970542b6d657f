"""Fractions of correct answers by aspect bin, with Wilson intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

OVERALL = "overall"
EDGES = (0.0, 30.0, 60.0, 90.0)
BIN_WIDTH = 30.0

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class AspectAccuracy:
    """Fractions of correct answers by aspect bin, the last of which holds all aspects.

    Attributes
    ----------
    labels : tuple of str
        Names of the bins, from the aspects in them ("0-27"); the last is "overall".
    fraction : (..., bin) float64 ndarray
        Correct answers over answers, in [0, 1]; NaN where there are none.
    ci_low, ci_high : (..., bin) float64 ndarray
        Wilson interval of the fraction.
    n : (..., bin) intp ndarray
        Number of answers.
    """

    labels: tuple[str, ...]
    fraction: Floats
    ci_low: Floats
    ci_high: Floats
    n: Integers


def wilson_interval(
    successes: ArrayLike, trials: ArrayLike, *, confidence: float = 0.95
) -> tuple[Floats, Floats]:
    """Confidence interval of a probability from a number of successes.

    Parameters
    ----------
    successes, trials : (...) array_like
        Counts, 0 <= successes <= trials.
    confidence : float, default=0.95
        Probability that the interval covers the truth, in (0, 1).

    Returns
    -------
    low, high : (...) float64 ndarray
        Ends of the interval, in [0, 1]. Without trials nothing is known: 0 and 1.

    Raises
    ------
    ValueError
        When a count is negative or NaN, successes exceed trials, or the confidence is not
        in (0, 1).

    Notes
    -----
    The values p at which the score test does not reject k successes in n trials [1]_:
    |k/n - p| <= z sqrt(p (1 - p)/n), hence the roots of (n + z^2) p^2 - (2k + z^2) p + k^2/n.
    Unlike the normal interval it stays within [0, 1] and has a width at k = 0 and k = n.
    It takes the trials as independent; neighbouring aspects of one ship are not quite.

    .. [1] E. B. Wilson, J. Am. Stat. Assoc. 22, 209 (1927), doi:10.1080/01621459.1927.10502953.
    """
    k, n = np.broadcast_arrays(np.asarray(successes, float), np.asarray(trials, float))
    if not np.all((k >= 0.0) & (k <= n) & np.isfinite(n)):
        raise ValueError(
            f"successes and trials must be counts with 0 <= successes <= trials, "
            f"got {successes!r} of {trials!r}."
        )
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must lie between 0 and 1, got {confidence!r}.")
    # Imported where it is used: scipy takes a tenth of a second.
    from scipy.special import ndtri

    z = ndtri(0.5 + 0.5 * confidence)
    failures = n - k
    spread = z * np.sqrt(z**2 / 4.0 + k * failures / np.maximum(n, 1.0))
    low = (k + z**2 / 2.0 - spread) / (n + z**2)
    high = (k + z**2 / 2.0 + spread) / (n + z**2)
    # Without failures the upper root is 1 exactly, but for rounding; the lower one is exact.
    return low, np.where(failures == 0.0, 1.0, high)


def aspect_bins(
    aspects: ArrayLike, edges: tuple[float, ...] = EDGES
) -> tuple[tuple[str, ...], Integers]:
    """Sort aspects into bins named after the aspects they hold.

    Parameters
    ----------
    aspects : (aspect,) array_like
        Aspects [deg], in any order, from the first edge to 360.
    edges : tuple of float, default=(0, 30, 60, 90)
        Increasing bin edges [deg], from 0 to 360.

    Returns
    -------
    labels : tuple of str
        A name for each bin that holds an aspect, in increasing order: its lowest and highest
        aspect, "0-27", or its only one, "90".
    index : (aspect,) intp ndarray
        The bin of each aspect, as an index into `labels`.

    Raises
    ------
    ValueError
        When aspects are not a non-empty sequence within the first edge and 360, or the edges
        do not increase within 0 and 360.

    Notes
    -----
    A bin holds its lower edge, [30, 60), and the last one both, [60, 90], as in the source's
    tables: 0, 3, ... 90 deg fall into 0-27, 30-57 and 60-90. Beyond the last edge bins of
    30 deg follow, each closed at its upper edge in turn, (90, 120], so that the aspects astern
    are binned as the mirror image of those ahead. An aspect's bin never depends on the others.
    """
    values = np.round(np.asarray(aspects, float), 9)  # 0.1 * 300 is 30, not a bit above it
    bounds = np.asarray(edges, float)
    if bounds.ndim != 1 or len(bounds) < 2 or not np.all(np.diff(bounds) > 0.0):
        raise ValueError(f"edges must be two or more increasing aspects, got {edges!r}.")
    if not (bounds[0] >= 0.0 and bounds[-1] <= 360.0):
        raise ValueError(f"edges must lie within 0 and 360 deg, got {edges!r}.")
    if values.ndim != 1 or values.size == 0:
        raise ValueError(f"aspects must be a non-empty sequence, got shape {values.shape}.")
    if not np.all((values >= bounds[0]) & (values <= 360.0)):
        raise ValueError(
            f"aspects must lie within {bounds[0]:g} and 360 deg, got {values.min():g} "
            f"to {values.max():g}."
        )
    beyond = np.arange(bounds[-1], 360.0, BIN_WIDTH)
    bins = np.searchsorted(bounds[1:-1], values, side="right")
    bins += np.searchsorted(beyond, values, side="left")
    occupied, index = np.unique(bins, return_inverse=True)
    labels = tuple(_span(values[bins == k]) for k in occupied)
    return labels, index.astype(np.intp)


def accuracy_by_aspect(
    correct: ArrayLike,
    aspects: ArrayLike,
    *,
    answered: ArrayLike = True,
    edges: tuple[float, ...] = EDGES,
    confidence: float = 0.95,
) -> AspectAccuracy:
    """Fraction of correct answers in each aspect bin and overall.

    Parameters
    ----------
    correct : (..., ship, aspect) array_like of bool
        Whether each answer was right, e.g. with leading axes pulse width and frame count.
    aspects : (aspect,) array_like
        Aspects [deg].
    answered : array_like of bool, default=True
        Which answers count, broadcast to `correct`; the others, of views that could not be
        had, are left out.
    edges : tuple of float
        See `aspect_bins`.
    confidence : float, default=0.95
        See `wilson_interval`.

    Returns
    -------
    AspectAccuracy
        With the axes (..., bin), the bin "overall" last.

    Raises
    ------
    ValueError
        When `correct` is not boolean or its last axis does not match the aspects.

    Notes
    -----
    All ships and aspects of a bin are pooled. "Overall" pools all answers, so that bins weigh
    by their number of aspects: 10, 10 and 11 of the source's 31.
    """
    labels, index = aspect_bins(aspects, edges)
    right = np.asarray(correct)
    if right.dtype != np.bool_:
        raise ValueError(f"correct must be boolean, got {right.dtype}.")
    if right.ndim < 2 or right.shape[-1] != len(index):
        raise ValueError(
            f"correct must have the axes (..., ship, aspect) with {len(index)} aspects, "
            f"got shape {right.shape}."
        )
    counted = np.broadcast_to(np.asarray(answered, dtype=bool), right.shape)
    member = np.ones((len(index), len(labels) + 1), dtype=np.intp)
    member[:, :-1] = index[:, None] == np.arange(len(labels))
    hits = (right & counted).sum(axis=-2) @ member
    n = counted.sum(axis=-2) @ member
    low, high = wilson_interval(hits, n, confidence=confidence)
    fraction = np.divide(hits, n, out=np.full(hits.shape, np.nan), where=n > 0)
    return AspectAccuracy((*labels, OVERALL), fraction, low, high, n)


def _span(aspects: Floats) -> str:
    """ "0-27" for the aspects 0 to 27, "90" for one alone, to a tenth of a degree."""
    low, high = (f"{round(float(end), 1):g}" for end in (aspects.min(), aspects.max()))
    return low if low == high else f"{low}-{high}"
