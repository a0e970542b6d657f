"""Fusion of sensors: sums of calibrated scores for the same templates."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all, require_flags, require_labels

Floats = NDArray[np.float64]

STEPS = np.geomspace(1e-4, 1e10, 31)  # of sharpness times the spread of scores, searched first


def label_posterior(
    scores: ArrayLike, labels: ArrayLike, *, exclude: ArrayLike = False
) -> tuple[NDArray, Floats]:
    """Return the probability of each label from the scores of its templates.

    Parameters
    ----------
    scores : (sample, template) array_like
        Natural logarithm of the density of a sample under each template, up to a constant for each
        sample.
    labels : (template,) array_like
        Label of each template.
    exclude : (sample, template) or (template,) array_like of bool, default=False
        Templates to leave out for a sample, such as the one it was drawn from.

    Returns
    -------
    classes : (class,) ndarray
        The labels, sorted.
    posterior : (sample, class) float64 ndarray
        Probabilities; rows sum to 1. Labels have equal prior probabilities, and so have the
        remaining templates of a label. A label without templates has probability 0.

    Raises
    ------
    ValueError
        If shapes do not match, a score is not finite, or all templates of a sample are left out.

    See Also
    --------
    fuse : Scores of several sensors as one.
    fit_sharpness : Factor that turns scores into log densities.

    Examples
    --------
    A label with more templates is no more likely beforehand: a density of 0.6 under one of two
    templates counts as 0.3 for their label:

    >>> import numpy as np
    >>> from ncti.classify import label_posterior
    >>> density = np.array([[0.6, 1e-9, 0.1]])
    >>> classes, posterior = label_posterior(np.log(density), ["duncan", "duncan", "roberts"])
    >>> classes.tolist(), posterior.round(2).tolist()
    (['duncan', 'roberts'], [[0.75, 0.25]])
    """
    values, names, left_out = _checked(scores, labels, exclude)
    # One row if all samples have the same templates.
    answers = ~np.broadcast_to(left_out, values.shape if left_out.ndim == 2 else (1, names.size))
    if not answers.any(axis=1).all():
        raise ValueError("exclude leaves out all templates of a sample, but must leave one")
    classes, label = np.unique(names, return_inverse=True)
    member = (label[:, None] == np.arange(len(classes))).astype(np.float64)
    # The best template of a sample has weight 1, so that nothing overflows and no sum is 0.
    best = values.max(axis=1, keepdims=True, initial=-np.inf, where=answers)
    weights = np.exp(np.minimum(values - best, 0.0)) * answers
    by_class = (weights @ member) / np.maximum(answers @ member, 1.0)
    return classes, by_class / by_class.sum(axis=1, keepdims=True)


def fit_sharpness(scores: ArrayLike, labels: ArrayLike, truth: ArrayLike) -> float:
    """Return the factor that turns scores into log densities, fitted to known labels.

    Parameters
    ----------
    scores, labels
        See `label_posterior`; at least one sample.
    truth : (sample,) array_like
        True label of each sample.

    Returns
    -------
    float
        Factor above 0, in the inverse unit of the scores; 0 if every sample has one score for all
        templates, or all templates have the same label.

    Raises
    ------
    ValueError
        If shapes do not match, a score is not finite, or a true label has no template.

    See Also
    --------
    fuse : Sum of scores times their factors.
    label_posterior : Probabilities from log densities.

    Notes
    -----
    Temperature scaling [1]_: one number, fitted to samples other than those to be classified. It
    does not change the order of templates, but decides the weight of one sensor against another.

    If every true label has the best score, the likelihood grows with the factor without bound. But
    n correct answers in n do not make the next one certain, so the labels are fitted with
    probability (n + 1)/(n + 2) and the rest is spread over the other labels [2]_. This amounts to
    one wrong answer in total and errs towards a smaller factor: if no answer is wrong, the best
    label is about n times as likely as all others. Log densities have the factor 1 and need no
    fit.

    References
    ----------
    .. [1] C. Guo, G. Pleiss, Y. Sun and K. Q. Weinberger, "On calibration of modern neural
       networks", Proceedings of the 34th International Conference on Machine Learning (2017),
       arXiv:1706.04599.
    .. [2] J. C. Platt, "Probabilistic outputs for support vector machines and comparisons to
       regularized likelihood methods", in Advances in Large Margin Classifiers, MIT Press (1999).

    Examples
    --------
    Log densities that were divided by 10 get a factor of 10 back, within the error of the fit:

    >>> import numpy as np
    >>> from ncti.classify import fit_sharpness
    >>> rng = np.random.default_rng(0)
    >>> truth = rng.integers(3, size=5000)
    >>> signal = 2.0 * np.eye(3)
    >>> seen = signal[truth] + rng.normal(size=(5000, 3))
    >>> logs = -((seen[:, None] - signal) ** 2).sum(axis=2) / 2
    >>> print(f"{fit_sharpness(logs / 10, [0, 1, 2], truth):.0f}")
    10
    """
    spread, surprise = _surprise(scores, labels, truth)
    if surprise is None:
        return 0.0
    # Imported here because scipy.optimize takes half a second.
    from scipy.optimize import minimize_scalar

    # Factors for scores of any size, in coarse steps first, because means over templates may add a
    # local maximum before the minimum.
    steps = np.log(STEPS / spread)
    lowest = int(np.argmin([surprise(math.exp(step)) for step in steps]))
    bounds = (steps[max(lowest - 1, 0)], steps[min(lowest + 1, len(steps) - 1)])
    found = minimize_scalar(
        lambda logarithm: surprise(math.exp(logarithm)), bounds=bounds, method="bounded"
    )
    return math.exp(float(found.x))


def doubted(scores: ArrayLike, labels: ArrayLike, *, doubt: ArrayLike) -> Floats:
    """Return log densities of a sensor that carries no information with some probability.

    Parameters
    ----------
    scores : (sample, template) array_like
        Natural logarithm of the density of a sample under each template, up to a constant for each
        sample.
    labels : (template,) array_like
        Label of each template.
    doubt : float or (template,) array_like
        Probability that the scores carry no information, in [0, 1], of all templates or of each;
        see `ncti.classify.calibration.fit_doubt`.

    Returns
    -------
    (sample, template) float64 ndarray
        log((1 - doubt) p + doubt), with p the density relative to its mean over all labels. The
        most probable label remains the same if all templates have one doubt, but its lead over
        the others is bounded.

    Raises
    ------
    ValueError
        If shapes do not match, a score is not finite or the doubt is out of range.

    See Also
    --------
    ncti.classify.fuse : Combination with the scores of another sensor.
    ncti.classify.calibration.fit_doubt : Estimate of the probability.

    Examples
    --------
    Odds of a million to one become 19 to 1 at a doubt of 10 %:

    >>> import numpy as np
    >>> from ncti.classify.fusion import doubted
    >>> logs = doubted(np.log([[1e6, 1.0]]), ["duncan", "roberts"], doubt=0.1)
    >>> print(f"{np.exp(logs[0, 0] - logs[0, 1]):.1f}")
    19.0
    """
    values, names, _ = _checked(scores, labels)
    share = require_all("doubt", doubt, minimum=0, maximum=1)
    if share.shape not in ((), names.shape):
        raise ValueError(
            f"doubt has shape {share.shape}, but must be one number or one for each of "
            f"{names.size} templates"
        )
    best = values.max(axis=1, keepdims=True, initial=-np.inf)
    _, label, count = np.unique(names, return_inverse=True, return_counts=True)
    weight = 1.0 / (count[label] * len(count))
    mean = np.log(np.exp(values - best) @ weight)[:, None]
    with np.errstate(divide="ignore"):  # a doubt of 0 or 1, whose logarithm is -inf
        return np.logaddexp(np.log1p(-share) + values - best - mean, np.log(share))


def fuse(*scores: ArrayLike, sharpness: Sequence[float]) -> Floats:
    """Return the combined scores of several sensors.

    Parameters
    ----------
    *scores : (sample, template) array_like
        Scores of each sensor for the same samples and templates.
    sharpness : sequence of float
        Factor that turns the scores of each sensor into log densities: 1 for log densities, else
        from `fit_sharpness`.

    Returns
    -------
    (sample, template) float64 ndarray
        Sum of the scores, each less its maximum over templates and times its factor.

    Raises
    ------
    ValueError
        If shapes differ, the numbers of factors and scores differ, or a factor is negative or not
        finite.

    See Also
    --------
    fit_sharpness : Factor of a sensor, from samples with known labels.
    label_posterior : Probabilities from the combined scores.

    Notes
    -----
    The noise of different sensors is independent given the template, so their densities multiply. A
    template is a ship *at an aspect*, which all sensors share. They must therefore agree on the
    aspect too, which carries more information than two votes for a ship.

    Examples
    --------
    The profile leaves duncan at 0 or 90 degrees, the silhouette either ship at 90 degrees.
    Together they agree on one template:

    >>> import numpy as np
    >>> from ncti.classify import fuse, label_posterior
    >>> labels = ["duncan", "duncan", "roberts", "roberts"]  # at 0 and 90 degrees each
    >>> profile = np.log([[0.45, 0.45, 0.05, 0.05]])
    >>> silhouette = np.log([[0.05, 0.45, 0.05, 0.45]])
    >>> fused = fuse(profile, silhouette, sharpness=(1.0, 1.0))
    >>> int(fused.argmax()), label_posterior(fused, labels)[1].round(2).tolist()
    (1, [[0.9, 0.1]])
    """
    values = [require_all("scores", one) for one in scores]
    sharp = require_all("sharpness", sharpness, minimum=0)
    shapes = {one.shape for one in values}
    if sharp.shape != (len(values),) or len(shapes) != 1 or values[0].ndim != 2:
        listed = ", ".join(str(one.shape) for one in values)
        raise ValueError(
            f"scores have shapes {listed} for sharpness of shape {sharp.shape}, but must be as "
            "many of one shape (sample, template)"
        )
    total = np.zeros(values[0].shape)
    for one, step in zip(values, sharp, strict=True):
        total += step * (one - one.max(axis=1, keepdims=True, initial=-np.inf))
    return total


def _checked(
    scores: ArrayLike, labels: ArrayLike, exclude: ArrayLike = False
) -> tuple[Floats, NDArray, NDArray[np.bool_]]:
    """Return scores, labels and excluded templates as arrays of matching shapes."""
    values = require_all("scores", scores)
    names = require_labels("labels", labels)
    if values.ndim != 2 or names.shape != values.shape[1:]:
        raise ValueError(
            f"scores has shape {values.shape}, but must be (sample, template) with "
            f"{names.size} templates, one for each label"
        )
    left_out = require_flags("exclude", exclude)
    if left_out.shape not in ((), names.shape, values.shape):
        raise ValueError(
            f"exclude has shape {left_out.shape}, but must be {values.shape} or {names.shape}"
        )
    return values, names, left_out


def _surprise(
    scores: ArrayLike, labels: ArrayLike, truth: ArrayLike
) -> tuple[float, Callable[[float], float] | None]:
    """Return the spread of scores, and the loss at the true labels as a function of sharpness.

    The loss is the mean cross-entropy; None if the sharpness has no effect.
    """
    values, names, _ = _checked(scores, labels)
    true = require_labels("truth", truth)
    if true.shape != values.shape[:1] or not true.size:
        raise ValueError(
            f"truth has shape {true.shape}, but must be one label for each sample, "
            f"({len(values)},), and there must be a sample"
        )
    unknown = np.setdiff1d(true, names)
    if unknown.size:
        raise ValueError(f"truth has {unknown[0]!r}, but must be among the labels")
    # Imported here because scipy.special is slow to import.
    from scipy.special import logsumexp

    classes, label = np.unique(names, return_inverse=True)
    spread = float(np.ptp(values, axis=1).mean())
    if spread == 0.0 or len(classes) == 1:
        return spread, None
    share = (label[:, None] == np.arange(len(classes))) / np.bincount(label)
    # Best template of every label, and the others relative to it, so that no sum is 0.
    best = np.stack([values[:, label == k].max(axis=1) for k in range(len(classes))], axis=1)
    behind = values - best[:, label]
    lead = best - best.max(axis=1, keepdims=True)
    wrong = 1.0 / (len(values) + 2)
    wanted = np.where(true[:, None] == classes, 1.0 - wrong, wrong / (len(classes) - 1))

    def surprise(sharpness: float) -> float:
        """Return the mean cross-entropy of the wanted and the predicted probabilities."""
        density = sharpness * lead + np.log(np.exp(sharpness * behind) @ share)
        return float((logsumexp(density, axis=1) - (wanted * density).sum(axis=1)).mean())

    return spread, surprise
