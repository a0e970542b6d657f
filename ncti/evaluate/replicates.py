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
    draws: int = 1,
    answered: ArrayLike = True,
    edges: tuple[float, ...] = EDGES,
    confidence: float = 0.95,
) -> AspectAccuracy:
    """Fraction of correct answers by aspect bin, a mean over draws that see the same views.

    Parameters
    ----------
    correct : (..., draw, ..., ship, aspect) array_like of bool
        Whether each answer was right: leading axes, one or more kinds of draws (of noise, of a
        phase, of an order of presentation), and the views.
    aspects : (aspect,) array_like
        Aspects [deg].
    draws : int, default=1
        Number of axes that are draws.
    answered : array_like of bool, default=True
        Which answers count, broadcast to `correct`.
    edges, confidence
        As for `accuracy_by_aspect`.

    Returns
    -------
    AspectAccuracy
        With the axes (..., bin), the bin "overall" last; `n` is the number of answers.

    Raises
    ------
    ValueError
        When the axes do not match, or `correct` is not boolean.

    Notes
    -----
    Answers to one view resemble each other, and so do all answers of one draw: a training that
    went badly is wrong about many views. N answers are worth fewer independent ones, N / D, with
    the design effect [1]_ of several crossed factors k, the views and every kind of draws,

        D = (s_e^2 + sum_k m_k s_k^2) / (s_e^2 + sum_k s_k^2),  m_k = sum_l n_kl^2 / N,

    n_kl the answers at level l. The variances are estimated by analysis of variance, the mean
    squares M_k of main effects against that of what is left, s_k^2 = (M_k - M_e) / m'_k, none below
    0; with V views and R draws of one kind the variance of the mean is then
    (M_v + M_d - M_e) / (V R), as for readers and cases [2]_. It is done for the bins together,
    whose views are compared with others of their bin, and for "overall" with all.

    Where all answers are equal they tell nothing of their likeness, and a few unequal ones little:
    to the squares between views is added one imaginary view whose answers are all alike and the
    rarer ones, so that answers to one view count as one until they are seen to differ.

    The Wilson interval is taken for N / D answers. Few draws tell little of their own variance:
    the normal quantile is replaced by that of Student's t, with the degrees of freedom that
    Satterthwaite's rule gives the share of the draws in the variance. With one draw it is the
    interval of `accuracy_by_aspect`.

    .. [1] L. Kish, Survey Sampling, Wiley 1965, section 5.4.
    .. [2] D. D. Dorfman, K. S. Berbaum and C. E. Metz, Invest. Radiol. 27, 723 (1992),
       doi:10.1097/00004424-199209000-00015.
    """
    right = np.asarray(correct)
    if right.dtype != np.bool_:
        raise ValueError(f"correct must be boolean, got {right.dtype}.")
    labels, index = aspect_bins(aspects, edges)
    if right.ndim < draws + 2 or right.shape[-1] != len(index):
        names = "replicate" if draws == 1 else f"{draws} kinds of draws"
        raise ValueError(
            f"correct must have the axes (..., {names}, ship, aspect) with {len(index)} aspects, "
            f"got shape {right.shape}."
        )
    member = np.ones((len(index), len(labels) + 1))
    member[:, :-1] = index[:, None] == np.arange(len(labels))
    count = np.broadcast_to(np.asarray(answered, dtype=bool), right.shape).astype(float)
    hits = right * count
    kinds = tuple(range(-2 - draws, -2))

    def by_level(kind: int | None) -> tuple[Floats, Floats]:
        """(..., level, bin): answers, and right ones, of every view or of every draw of a kind."""
        if kind is None:
            return _views(count.sum(axis=kinds), member), _views(hits.sum(axis=kinds), member)
        gone = (*(other for other in kinds if other != kind), -2)
        return count.sum(axis=gone) @ member, hits.sum(axis=gone) @ member

    levels = [by_level(kind) for kind in (None, *kinds)]
    n, k = (array.sum(axis=-2) for array in levels[0])
    fraction = k / np.maximum(n, 1.0)
    worth = np.empty(n.shape)
    for bins in (slice(0, -1), slice(-1, None)):  # those of aspects, the whole
        those = [(answers[..., bins], rights[..., bins]) for answers, rights in levels]
        worth[..., bins] = _worth(those, fraction[..., -1], confidence)
    low, high = wilson_interval(np.minimum(fraction * worth, worth), worth, confidence=confidence)
    fraction = np.where(n > 0, fraction, np.nan)
    return AspectAccuracy((*labels, OVERALL), fraction, low, high, np.rint(n).astype(np.intp))


def _views(values: Floats, member: Floats) -> Floats:
    """(..., view, bin): values of (..., ship, aspect) views in the bins that these are in."""
    inside = values[..., None] * member
    return inside.reshape(*values.shape[:-2], -1, member.shape[-1])


def _worth(levels: list[tuple[Floats, Floats]], share: Floats, confidence: float) -> Floats:
    """(..., bin): as how many independent answers those of some bins count; see the Notes above.

    Of answers, and right ones, at the (..., level, bin) levels of views, which come first, and of
    every kind of draws; and the (...,) share of right ones in all.
    """
    # Imported where it is used: scipy takes a tenth of a second.
    from scipy.special import ndtri, stdtrit

    n, k = (array.sum(axis=-2) for array in levels[0])
    some = np.maximum(n, 1.0)
    sizes, squares, freedoms, spreads = [], [], [], []  # m_k by bin; of all bins together
    for answers, rights in levels:
        size = (answers**2).sum(axis=-2) / some
        within = (rights**2 / np.maximum(answers, 1.0)).sum(axis=-2) - k**2 / some
        sizes.append(size)
        squares.append(np.maximum(within, 0.0).sum(axis=-1))
        freedoms.append(np.maximum((answers > 0).sum(axis=-2) - 1, 0).sum(axis=-1))
        spreads.append((n - size).sum(axis=-1))
    left = np.maximum((k - k**2 / some).sum(axis=-1) - sum(squares), 0.0)
    freedom = np.maximum(n - 1.0, 0.0).sum(axis=-1) - sum(freedoms)
    error = left / np.maximum(freedom, 1.0)
    # The imaginary view has as many answers as another.
    views = (levels[0][0] > 0).sum(axis=(-2, -1))
    squares[0] += n.sum(axis=-1) / np.maximum(views, 1) * np.maximum(share, 1.0 - share) ** 2
    whole, mean, uncertain = error, error[..., None], np.zeros(n.shape)
    for kind, (size, square, free) in enumerate(zip(sizes, squares, freedoms, strict=True)):
        between = np.maximum(square / np.maximum(free, 1) - error, 0.0)
        variance = np.where(free > 0, between * free / np.maximum(spreads[kind], 1e-9), 0.0)
        part = size * variance[..., None]
        whole, mean = whole + variance, mean + part
        if kind > 0:
            uncertain = uncertain + part**2 / np.maximum(free, 1)[..., None]
    effect = np.where(whole[..., None] > 0, mean / np.where(whole > 0, whole, 1.0)[..., None], 1.0)
    # Wilson's interval depends on z^2 / n alone: another quantile is another number.
    with np.errstate(divide="ignore", invalid="ignore"):
        free = np.where(uncertain > 0, np.maximum(mean**2 / uncertain, 1.0), np.inf)
    tail = 0.5 + 0.5 * confidence
    wider: Floats = np.maximum(stdtrit(free, tail) / ndtri(tail), 1.0)
    worth: Floats = np.maximum(n / np.maximum(effect, 1.0) / wider**2, np.minimum(n, 1.0))
    return worth
