"""Accuracy by aspect bin for repeated answers to the same views."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_flags, require_labels, require_shape
from ncti.evaluate.scores import (
    OVERALL,
    AspectAccuracy,
    aspect_bins,
    checked_answers,
    wilson_interval,
)

CONFIDENCE = 0.95
AT_ONCE = 2**18  # answers per block, to bound the memory of counts by view and bin

Floats = NDArray[np.float64]


def replicated_accuracy(
    correct: ArrayLike,
    aspects: ArrayLike,
    *,
    draws: int = 1,
    answered: ArrayLike = True,
    confidence: float = CONFIDENCE,
) -> AspectAccuracy:
    """Return the fraction of correct answers by aspect bin over repeated draws of the same views.

    Parameters
    ----------
    correct : (..., draw, ..., ship, aspect) array_like of bool
        True for correct answers. The axes are any leading axes, one or more kinds of draws (of
        noise, of a grid phase, of the order of presentation), and the views.
    aspects : (aspect,) array_like
        Aspects [deg].
    draws : int, default=1
        Number of axes that are draws.
    answered : array_like of bool, default=True
        False for answers to leave out; broadcast to `correct`.
    confidence : float, default=0.95
        Probability that an interval covers the true fraction, in (0, 1).

    Returns
    -------
    AspectAccuracy
        Arrays with the axes (..., bin), the bin "overall" last; `n` is the number of answers.

    Raises
    ------
    ValueError
        If the axes do not match, `correct` is not boolean, or the confidence is not in (0, 1).

    See Also
    --------
    accuracy_by_aspect : Accuracy with one answer per view.
    wilson_interval : The interval for independent answers.

    Notes
    -----
    Answers to one view are correlated, and so are all answers of one draw: a poor training is
    wrong about many views. N answers are therefore equivalent to N / D independent ones, with the
    design effect [1]_ of several crossed factors k, the views and every kind of draw,

        D = (s_e^2 + sum_k m_k s_k^2) / (s_e^2 + sum_k s_k^2),  m_k = sum_l n_kl^2 / N,

    n_kl the number of answers at level l. The variances are estimated by analysis of variance from
    the mean squares M_k of the main effects and the residual M_e, s_k^2 = (M_k - M_e) / m'_k, not
    below 0. With V views and R draws of one kind the variance of the mean is then
    (M_v + M_d - M_e) / (V R), as for readers and cases [2]_. The bins share one estimate, with
    views compared to others of their bin; "overall" has its own, with all views.

    If all answers agree, their correlation cannot be estimated, and with few exceptions only
    poorly. One imaginary view is therefore added to the squares between views, whose answers all
    agree and are of the rarer kind: answers to one view count as one until they are seen to differ.

    The Wilson interval is computed for N / D answers. The variance of few draws is uncertain:
    Student's t replaces the normal quantile, with degrees of freedom by Satterthwaite's rule for
    the share of the draws in the variance. With one draw the interval is that of
    `accuracy_by_aspect`.

    References
    ----------
    .. [1] L. Kish, Survey Sampling, Wiley, 1965, section 5.4.
    .. [2] D. D. Dorfman, K. S. Berbaum and C. E. Metz, "Receiver operating characteristic rating
       analysis", Investigative Radiology 27, 723-731 (1992),
       doi:10.1097/00004424-199209000-00015.

    Examples
    --------
    Eight draws whose answers to each of 124 views are all the same contain no more than one
    draw: the interval of 992 answers is that of 124:

    >>> import numpy as np
    >>> from ncti.evaluate import accuracy_by_aspect, replicated_accuracy
    >>> aspects = np.arange(0, 91, 3)
    >>> once = np.ones((4, 31), dtype=bool)
    >>> once[:2, 20:] = False
    >>> accuracy = replicated_accuracy(np.stack([once] * 8), aspects)
    >>> int(accuracy.n[-1]), accuracy.ci_low[-1].round(2), accuracy.ci_high[-1].round(2)
    (992, np.float64(0.75), np.float64(0.88))
    >>> accuracy_by_aspect(once, aspects).ci_low[-1].round(2)
    np.float64(0.75)
    """
    require("draws", draws, whole=True, minimum=0)
    require("confidence", confidence, positive=True, below=1.0)
    labels, index = aspect_bins(aspects)
    right = checked_answers(correct, len(index), draws)

    member = np.ones((len(index), len(labels) + 1))
    member[:, :-1] = index[:, None] == np.arange(len(labels))
    flags = np.broadcast_to(require_flags("answered", answered, right.shape), right.shape)

    # Cells on the leading axes are independent: process them in blocks, to bound the memory of
    # counts by view and bin.
    lead, inner = right.shape[: right.ndim - 2 - draws], right.shape[right.ndim - 2 - draws :]
    step = max(1, AT_ONCE // max(math.prod(inner), 1))
    number = math.prod(lead)
    right_cells, flag_cells = right.reshape(number, *inner), flags.reshape(number, *inner)
    blocks = []
    for first in range(0, max(number, 1), step):
        cells = slice(first, first + step)
        blocks.append(_accuracy(right_cells[cells], flag_cells[cells], member, draws, confidence))
    fraction, low, high, n = (
        np.concatenate(parts).reshape(*lead, len(labels) + 1) for parts in zip(*blocks, strict=True)
    )
    counts = np.rint(n).astype(np.intp)
    return AspectAccuracy((*labels, OVERALL), fraction, low, high, counts, confidence)


def _accuracy(
    right: NDArray[np.bool_],
    answered: NDArray[np.bool_],
    member: Floats,
    draws: int,
    confidence: float,
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return (cell, bin) fractions of right answers, the ends of their intervals, and answers.

    `right` and `answered` are (cell, draw, ..., ship, aspect), with `draws` axes of draws; `member`
    (aspect, bin) is 1 where an aspect lies in a bin, and the last bin holds all.
    """
    # Counts of answers, and of right ones, by bin at every level of every factor.
    count = answered.astype(float)
    hits = right * count
    kinds = tuple(range(-2 - draws, -2))

    def count_by_level(kind: int | None) -> tuple[Floats, Floats]:
        """Return (..., level, bin) counts of answers and of right ones by view or by draw."""
        if kind is None:
            return _views(count.sum(axis=kinds), member), _views(hits.sum(axis=kinds), member)
        axes = (*(other for other in kinds if other != kind), -2)
        return count.sum(axis=axes) @ member, hits.sum(axis=axes) @ member

    return _level_accuracy([count_by_level(kind) for kind in (None, *kinds)], confidence)


def _level_accuracy(
    levels: list[tuple[Floats, Floats]], confidence: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return (..., bin) fractions of right answers, the ends of their intervals, and answers.

    `levels` are as of `_equivalent_answers`; the last bin holds all.
    """
    n, k = (array.sum(axis=-2) for array in levels[0])
    fraction = k / np.maximum(n, 1.0)
    # Equivalent number of independent answers, for the bins together and for the last bin.
    equivalent = np.empty(n.shape)
    for bins in (slice(0, -1), slice(-1, None)):
        subset = [(answers[..., bins], rights[..., bins]) for answers, rights in levels]
        equivalent[..., bins] = _equivalent_answers(subset, fraction[..., -1], confidence)
    low, high = wilson_interval(
        np.minimum(fraction * equivalent, equivalent), equivalent, confidence=confidence
    )
    return np.where(n > 0, fraction, np.nan), low, high, n


def grouped_accuracy(correct: ArrayLike, aspects: ArrayLike, groups: ArrayLike) -> AspectAccuracy:
    """Return the fraction of correct answers by aspect bin over rows that may share views.

    Parameters
    ----------
    correct : (row,) array_like of bool
        True for correct answers.
    aspects : (row,) array_like
        Aspects [deg].
    groups : (row,) array_like
        View of each row: a number or text, in any order and of any number of rows.

    Returns
    -------
    AspectAccuracy
        Arrays with the axis (bin), the bin "overall" last; `n` is the number of answers.

    Raises
    ------
    ValueError
        If the lengths differ, or `correct` is not boolean.

    See Also
    --------
    replicated_accuracy : The same for a full grid of views and draws.

    Notes
    -----
    The interval is that of `replicated_accuracy` with one factor, the views, since rows of
    different views share no draw. A view may lie in several bins, if its aspect is not stated
    exactly.

    Examples
    --------
    Fifty views with eight answers each, all alike, contain no more than fifty answers:

    >>> import numpy as np
    >>> from ncti.evaluate import grouped_accuracy, wilson_interval
    >>> view = np.repeat(np.arange(50), 8)
    >>> accuracy = grouped_accuracy(view < 40, np.full(400, 45.0), view)
    >>> int(accuracy.n[-1]), accuracy.ci_low[-1].round(2), accuracy.ci_high[-1].round(2)
    (400, np.float64(0.67), np.float64(0.89))
    >>> low, high = wilson_interval(40, 50)
    >>> low.round(2), high.round(2)
    (np.float64(0.67), np.float64(0.89))
    """
    right = require_flags("correct", correct).ravel()
    labels, index = aspect_bins(aspects)
    views, view = np.unique(require_labels("groups", groups), return_inverse=True)
    for name, values in (("aspects", index), ("groups", view)):
        require_shape(name, values, right.shape)
    count, hits = np.zeros((2, len(views), len(labels) + 1))
    for array, rows in ((count, slice(None)), (hits, right)):
        np.add.at(array, (view[rows], index[rows]), 1.0)
        array[:, -1] = array[:, :-1].sum(axis=1)
    fraction, low, high, n = _level_accuracy([(count, hits)], CONFIDENCE)
    return AspectAccuracy((*labels, OVERALL), fraction, low, high, np.rint(n).astype(np.intp))


def paired_difference(
    first: ArrayLike,
    second: ArrayLike,
    aspects: ArrayLike,
    *,
    draws: int = 1,
    answered: ArrayLike = True,
    confidence: float = CONFIDENCE,
) -> AspectAccuracy:
    """Return a second fraction of correct answers to the same views less the first.

    Parameters
    ----------
    first, second : (..., draw, ..., ship, aspect) array_like of bool
        True for correct answers, with the axes of `replicated_accuracy`.
    aspects, draws, answered, confidence
        As of `replicated_accuracy`.

    Returns
    -------
    AspectAccuracy
        Second fraction less the first, from -1 to 1, with the ends of its interval.

    Raises
    ------
    ValueError
        As of `replicated_accuracy`, or if the shapes differ.

    See Also
    --------
    replicated_accuracy : Each fraction alone.

    Notes
    -----
    Newcombe's method 10 [1]_ on the intervals of both fractions. With p the fractions, l and u
    their lower and upper ends, the lower end is below the difference by

        sqrt((p2 - l2)^2 - 2 phi (p2 - l2) (u1 - p1) + (u1 - p1)^2),

    and the upper end likewise. For several draws phi is the correlation of the means of the views
    of a bin; for one, it is that of the answers. A positive phi is corrected for continuity; an
    undefined one counts as 0.

    References
    ----------
    .. [1] R. G. Newcombe, "Improved confidence intervals for the difference between binomial
       proportions based on paired data", Statistics in Medicine 17, 2635-2650 (1998),
       doi:10.1002/(SICI)1097-0258(19981130)17:22<2635::AID-SIM954>3.0.CO;2-C.

    Examples
    --------
    Of 40 views the second classifier identifies four more, and none less:

    >>> import numpy as np
    >>> from ncti.evaluate import paired_difference
    >>> first = np.arange(40).reshape(1, 1, 40) < 30
    >>> second = np.arange(40).reshape(1, 1, 40) < 34
    >>> more = paired_difference(first, second, np.full(40, 45.0))
    >>> [float(figure[-1].round(2)) for figure in (more.fraction, more.ci_low, more.ci_high)]
    [0.1, -0.01, 0.22]
    """
    labels, index = aspect_bins(aspects)
    require("draws", draws, whole=True, minimum=0)
    pair = [checked_answers(right, len(index), draws) for right in (first, second)]
    require_shape("second", pair[1], pair[0].shape)
    before, after = (
        replicated_accuracy(right, aspects, draws=draws, answered=answered, confidence=confidence)
        for right in pair
    )
    count = np.broadcast_to(np.asarray(answered), pair[0].shape).astype(float)
    kinds = tuple(range(-2 - draws, -2))
    answers = max(np.prod([count.shape[kind] for kind in kinds]), 1)  # per view
    per_view = count.sum(axis=kinds)
    means = [(right * count).sum(axis=kinds) / np.maximum(per_view, 1.0) for right in pair]
    phi = np.zeros(before.fraction.shape)
    for k in range(len(labels) + 1):
        inside = (per_view > 0) & ((index == k) | (k == len(labels)))
        size = np.maximum(inside.sum(axis=(-2, -1), keepdims=True), 1)
        a, b = (
            np.where(inside, mean - (mean * inside).sum(axis=(-2, -1), keepdims=True) / size, 0.0)
            for mean in means
        )
        squares = (a**2).sum(axis=(-2, -1)) * (b**2).sum(axis=(-2, -1))
        product = (a * b).sum(axis=(-2, -1))
        product = np.where(product > 0, np.maximum(product - 0.5 / answers, 0.0), product)
        phi[..., k] = np.where(squares > 0, product / np.sqrt(np.maximum(squares, 1e-300)), 0.0)

    def interval_reach(up: Floats, down: Floats) -> Floats:
        return np.sqrt(np.maximum(up**2 - 2.0 * phi * up * down + down**2, 0.0))

    difference = after.fraction - before.fraction
    low = difference - interval_reach(
        after.fraction - after.ci_low, before.ci_high - before.fraction
    )
    high = difference + interval_reach(
        after.ci_high - after.fraction, before.fraction - before.ci_low
    )
    return AspectAccuracy(
        before.labels, difference, low, high, before.n, confidence, is_difference=True
    )


def _views(values: Floats, member: Floats) -> Floats:
    """Return (..., view, bin) values from (..., ship, aspect) ones, zero outside a view's bin."""
    inside = values[..., None] * member
    return inside.reshape(*values.shape[:-2], -1, member.shape[-1])


def _equivalent_answers(
    levels: list[tuple[Floats, Floats]], share: Floats, confidence: float
) -> Floats:
    """Return the (..., bin) equivalent number of independent answers; see `replicated_accuracy`.

    `levels` has (..., level, bin) answers and right answers of each factor, the views, then each
    kind of draw; `share` (...) is the share of right answers in all bins.
    """
    from scipy.special import ndtri, stdtrit

    n, k = (array.sum(axis=-2) for array in levels[0])
    divisor = np.maximum(n, 1.0)
    # Main effects: m_k of every bin; squares, degrees of freedom and m'_k over the bins.
    sizes, squares, freedoms, spreads = [], [], [], []
    for answers, rights in levels:
        size = (answers**2).sum(axis=-2) / divisor
        within = (rights**2 / np.maximum(answers, 1.0)).sum(axis=-2) - k**2 / divisor
        sizes.append(size)
        squares.append(np.maximum(within, 0.0).sum(axis=-1))
        freedoms.append(np.maximum((answers > 0).sum(axis=-2) - 1, 0).sum(axis=-1))
        spreads.append((n - size).sum(axis=-1))
    # Residual, and the imaginary view with an average number of answers.
    remainder = np.maximum((k - k**2 / divisor).sum(axis=-1) - sum(squares), 0.0)
    freedom = np.maximum(n - 1.0, 0.0).sum(axis=-1) - sum(freedoms)
    error = remainder / np.maximum(freedom, 1.0)
    views = (levels[0][0] > 0).sum(axis=(-2, -1))
    squares[0] += n.sum(axis=-1) / np.maximum(views, 1) * np.maximum(share, 1.0 - share) ** 2
    # Variance components, the design effect, and the part of the variance that draws contribute.
    total, mean, uncertain = error, error[..., None], np.zeros(n.shape)
    for kind, (size, square, free) in enumerate(zip(sizes, squares, freedoms, strict=True)):
        between = np.maximum(square / np.maximum(free, 1) - error, 0.0)
        variance = np.where(free > 0, between * free / np.maximum(spreads[kind], 1e-9), 0.0)
        component = size * variance[..., None]
        total, mean = total + variance, mean + component
        if kind > 0:
            uncertain = uncertain + component**2 / np.maximum(free, 1)[..., None]
    effect = np.where(total[..., None] > 0, mean / np.where(total > 0, total, 1.0)[..., None], 1.0)
    # The Wilson interval depends only on z^2 / n, so a wider quantile is a smaller number.
    with np.errstate(divide="ignore", invalid="ignore"):
        free = np.where(uncertain > 0, np.maximum(mean**2 / uncertain, 1.0), np.inf)
    tail = 0.5 + 0.5 * confidence
    wider: Floats = np.maximum(stdtrit(free, tail) / ndtri(tail), 1.0)
    return np.maximum(n / np.maximum(effect, 1.0) / wider**2, np.minimum(n, 1.0))
