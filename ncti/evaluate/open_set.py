"""Scores of classifiers for tests with classes absent from training."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all, require_flags, require_shape


@dataclass(frozen=True)
class OpenSetScores:
    """Areas under two curves of a threshold that rejects answers of low similarity.

    Attributes
    ----------
    auroc : float
        Area under the receiver operating characteristic: known answers accepted over unknown ones
        accepted, in [0, 1]; 0.5 by chance.
    oscr : float
        Area under the open-set classification rate: known answers accepted and right over unknown
        ones accepted; at most the accuracy, and half of it by chance.

    See Also
    --------
    open_set_scores : Returns them.

    Examples
    --------
    >>> from ncti.evaluate import OpenSetScores
    >>> OpenSetScores(auroc=0.5, oscr=0.4).auroc
    0.5
    """

    auroc: float
    oscr: float


def open_set_scores(similarity: ArrayLike, correct: ArrayLike, known: ArrayLike) -> OpenSetScores:
    """Return AUROC and OSCR of answers, some of which are to classes absent from training.

    Parameters
    ----------
    similarity : (...) array_like
        Similarity of the samples to the classes named, higher where they are more alike.
    correct : (...) array_like of bool
        True where the class named is the true one; of unknown classes it is not read.
    known : (...) array_like of bool
        True where the true class was learned.

    Returns
    -------
    OpenSetScores
        NaN without an answer to a known class, or without one to an unknown class.

    Raises
    ------
    ValueError
        If the shapes differ, `correct` or `known` is not boolean, or a similarity is not finite.

    See Also
    --------
    accuracy_by_aspect : Fractions of correct answers to known classes.

    Notes
    -----
    Both areas are probabilities over pairs of an answer to a known class and one to an unknown
    class [1]_: that the known one is more similar, a tie counting half; and that it is also
    correct. The second curve is that of [2]_, with all answers to known classes counted.

    References
    ----------
    .. [1] J. A. Hanley and B. J. McNeil, "The meaning and use of the area under a receiver
       operating characteristic (ROC) curve", Radiology 143, 29-36 (1982).
    .. [2] A. R. Dhamija, M. Guenther and T. E. Boult, "Reducing network agnostophobia", Advances
       in Neural Information Processing Systems 31 (2018).

    Examples
    --------
    Of three known samples one is misnamed, and one is less similar than an unknown one:

    >>> from ncti.evaluate import open_set_scores
    >>> known = [True, True, True, False, False]
    >>> correct = [True, True, False, False, False]
    >>> scores = open_set_scores([0.9, 0.5, 0.8, 0.6, 0.2], correct, known)
    >>> round(scores.auroc, 3), scores.oscr
    (0.833, 0.5)
    """
    values = require_all("similarity", similarity)
    right = require_flags("correct", correct)
    learned = require_flags("known", known)
    for name, flags in (("correct", right), ("known", learned)):
        require_shape(name, flags, values.shape)
    ranked = np.sort(values[~learned])
    pairs = np.count_nonzero(learned) * ranked.size
    if not pairs:
        return OpenSetScores(auroc=np.nan, oscr=np.nan)
    # Unknown answers less similar than each known answer, ties counting half.
    below, up_to = (np.searchsorted(ranked, values[learned], side) for side in ("left", "right"))
    wins = (below + up_to) / 2
    return OpenSetScores(
        auroc=float(wins.sum() / pairs), oscr=float(wins[right[learned]].sum() / pairs)
    )


def rejection_thresholds(similarity: ArrayLike, shares: ArrayLike) -> NDArray[np.float64]:
    """Return the similarities up to which answers must be rejected to reject given shares.

    Parameters
    ----------
    similarity : (...) array_like
        Similarity of answers to classes absent from training.
    shares : (share,) array_like
        Least fractions of these answers to reject, in [0, 1].

    Returns
    -------
    (share,) float64 ndarray
        Largest similarity that is rejected; -infinity for a share of 0, NaN without an answer.

    Raises
    ------
    ValueError
        If a similarity is not finite, or a share is not in [0, 1].

    See Also
    --------
    open_set_scores : Areas under the curves of such thresholds.

    Notes
    -----
    The characteristic has a corner at every similarity of an answer to an unknown class. To reject
    a share of these answers, all answers up to a quantile of the similarity are rejected.

    Examples
    --------
    Of four answers two must be rejected for at least 30 percent:

    >>> from ncti.evaluate import rejection_thresholds
    >>> rejection_thresholds([0.9, 0.5, 0.8, 0.6], [0.0, 0.3, 1.0])
    array([-inf,  0.6,  0.9])
    """
    ranked = np.sort(require_all("similarity", similarity).ravel())
    share = require_all("shares", shares, minimum=0, maximum=1)
    if not ranked.size:
        return np.where(share > 0, np.nan, -np.inf)
    count = np.ceil(share * ranked.size - 1e-9).astype(int)
    return np.where(count > 0, ranked[np.maximum(count - 1, 0)], -np.inf)
