"""Fractions of correct answers where every view was answered several times."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.evaluate.scores import (
    EDGES,
    OVERALL,
    AspectAccuracy,
    aspect_bins,
    wilson_interval,
)

Floats = NDArray[np.float64]


def replicated_accuracy(
    correct: ArrayLike,
    aspects: ArrayLike,
    *,
    answered: ArrayLike = True,
    edges: tuple[float, ...] = EDGES,
    confidence: float = 0.95,
) -> AspectAccuracy:
    """Fraction of correct answers by aspect bin, with independent noise in every replicate.

    Parameters
    ----------
    correct : (..., replicate, ship, aspect) array_like of bool
        Whether each answer was right.
    aspects : (aspect,) array_like
        Aspects [deg].
    answered : array_like of bool, default=True
        Which answers count, broadcast to `correct`; a view counts in all replicates or in none.
    edges, confidence
        As for `accuracy_by_aspect`.

    Returns
    -------
    AspectAccuracy
        With the axes (..., bin), the bin "overall" last; `n` is the number of answers.

    Raises
    ------
    ValueError
        When the axes do not match, `correct` is not boolean, or a view counts in some replicates
        only.

    Notes
    -----
    Answers to one view resemble each other, so R replicates of V views are worth fewer than R V
    independent answers: R V / (1 + (R - 1) rho), Kish's design effect [1]_. The intraclass
    correlation rho is estimated by analysis of variance, with the mean squares between and
    within views,

        rho = (B - W) / (B + (R - 1) W),  held in [0, 1],

    for the bins together, whose views are compared with others of their bin, and for "overall"
    with all. Where all answers are equal they tell nothing of rho, and a few unequal ones little:
    to B is added one imaginary view whose answers are all alike and the rarer ones, so that rho
    is 1 until answers to one view are seen to differ, and many of them count for more. The
    Wilson interval is taken for that many answers. With one replicate it is that of
    `accuracy_by_aspect`.

    .. [1] L. Kish, Survey Sampling, Wiley 1965, section 5.4.
    """
    right = np.asarray(correct)
    if right.dtype != np.bool_:
        raise ValueError(f"correct must be boolean, got {right.dtype}.")
    labels, index = aspect_bins(aspects, edges)
    if right.ndim < 3 or right.shape[-1] != len(index):
        raise ValueError(
            f"correct must have the axes (..., replicate, ship, aspect) with {len(index)} aspects, "
            f"got shape {right.shape}."
        )
    counted = np.broadcast_to(np.asarray(answered, dtype=bool), right.shape)
    there = counted[..., 0, :, :]
    if (counted != there[..., None, :, :]).any():
        raise ValueError("answered must be the same in every replicate of a view.")
    replicates = right.shape[-3]
    member = np.ones((len(index), len(labels) + 1), dtype=np.intp)
    member[:, :-1] = index[:, None] == np.arange(len(labels))

    def pooled(views: Floats) -> Floats:
        """Sums over the views of every bin."""
        total: Floats = np.where(there, views, 0.0).sum(axis=-2) @ member
        return total

    share = right.mean(axis=-3)
    views = pooled(np.ones(share.shape))
    fraction = pooled(share) / np.maximum(views, 1.0)
    # Sums of squares between and within the views of a bin.
    between = replicates * np.maximum(pooled(share**2) - views * fraction**2, 0.0)
    within = replicates * pooled(share * (1.0 - share))
    rarer = replicates * np.maximum(fraction[..., -1], 1.0 - fraction[..., -1]) ** 2
    alike = np.empty(fraction.shape)
    for bins in (slice(0, -1), slice(-1, None)):  # those of aspects, the whole
        seen = views[..., bins]
        freedom = np.maximum((seen - (seen > 0)).sum(axis=-1), 1.0)
        mean_between = (between[..., bins].sum(axis=-1) + rarer) / freedom
        mean_within = within[..., bins].sum(axis=-1) / np.maximum(
            seen.sum(axis=-1) * (replicates - 1), 1.0
        )
        rho = (mean_between - mean_within) / (mean_between + (replicates - 1) * mean_within)
        alike[..., bins] = np.clip(rho, 0.0, 1.0)[..., None]
    worth = views * replicates / (1.0 + (replicates - 1) * alike)
    low, high = wilson_interval(np.minimum(fraction * worth, worth), worth, confidence=confidence)
    fraction = np.where(views > 0, fraction, np.nan)
    n = np.rint(views * replicates).astype(np.intp)
    return AspectAccuracy((*labels, OVERALL), fraction, low, high, n)
