"""Fusion of sensors: sums of calibrated scores for the same templates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require_all, require_flags, require_labels, require_shape

Floats = NDArray[np.float64]


def label_posterior(
    scores: ArrayLike,
    labels: ArrayLike,
    *,
    exclude: ArrayLike = False,
    log_prior: ArrayLike = 0.0,
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
    log_prior : (sample, template) or (template,) array_like, default=0
        Natural logarithm of the prior probability of each template among those of its label, up to
        a constant for each sample and label; `aspect_prior` makes it of a track.

    Returns
    -------
    classes : (class,) ndarray
        The labels, sorted.
    posterior : (sample, class) float64 ndarray
        Probabilities; rows sum to 1. Labels have equal prior probabilities, and so have, without
        `log_prior`, the remaining templates of a label. A label without templates has
        probability 0.

    Raises
    ------
    ValueError
        If shapes do not match, a score is not finite, or all templates of a sample are left out.

    See Also
    --------
    fuse : Scores of several sensors as one.
    aspect_prior : Prior of the templates from a track.
    ncti.classify.calibration.fit_temperature_and_outliers : Log densities from other scores.

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
    values, names = require_all("scores", scores), require_labels("labels", labels)
    if values.ndim != 2 or names.shape != values.shape[1:]:
        raise ValueError(
            f"scores has shape {values.shape}, but must be (sample, template) with "
            f"{names.size} templates, one for each label"
        )
    left_out = require_flags("exclude", exclude)
    require_shape("exclude", left_out, (), names.shape, values.shape)
    # One row if all samples have the same templates.
    answers = ~np.broadcast_to(left_out, values.shape if left_out.ndim == 2 else (1, names.size))
    if not answers.any(axis=1).all():
        raise ValueError("exclude leaves out all templates of a sample, but must leave one")
    classes, label = np.unique(names, return_inverse=True)
    member = members(label)
    priors = require_all("log_prior", log_prior)
    require_shape("log_prior", priors, (), names.shape, values.shape)
    if priors.ndim:
        values = values + _normalise_priors(np.atleast_2d(priors), label, answers)
    return classes, posterior_of(values, member, answers)


def _normalise_priors(
    priors: Floats, label: NDArray[np.integer], answers: NDArray[np.bool_]
) -> Floats:
    """Normalise log priors so that the included templates of a label have mean prior 1."""
    masked = np.where(answers, priors, -np.inf)
    mean = np.zeros_like(masked)
    for number in range(label.max() + 1):
        templates = label == number
        total = np.logaddexp.reduce(masked[:, templates], axis=1, keepdims=True)
        answered = np.isfinite(total)  # true if a template of the label is included
        mean[:, templates] = np.where(
            answered,
            total - np.log(np.isfinite(masked[:, templates]).sum(1)[:, None] + ~answered),
            0,
        )
    return np.where(answers, priors - mean, 0.0)


def members(label: NDArray[np.integer]) -> Floats:
    """Return the (template, class) indicator matrix of numbered labels."""
    return (label[:, None] == np.arange(label.max(initial=-1) + 1)).astype(np.float64)


def posterior_of(values: Floats, member: Floats, answers: NDArray[np.bool_]) -> Floats:
    """Return the posterior of `label_posterior` from checked arguments.

    `values` (sample, template) are scores, `member` is (template, class), and `answers` (sample or
    1, template) false for templates left out.
    """
    # The best template of a sample has weight 1, so that nothing overflows and no sum is 0.
    best = values.max(axis=1, keepdims=True, initial=-np.inf, where=answers)
    weights = np.exp(np.minimum(values - best, 0.0)) * answers
    by_class = (weights @ member) / np.maximum(answers @ member, 1.0)
    return by_class / by_class.sum(axis=1, keepdims=True)


def add_outliers(scores: ArrayLike, labels: ArrayLike, *, outlier_fraction: ArrayLike) -> Floats:
    """Return log densities (sample, template) of a sensor that sometimes carries no information.

    `scores` (sample, template) are log densities up to a constant for each sample, `labels`
    (template,), and `outlier_fraction` the probability, of all templates or of each. The result is
    log((1 - e) p + e), with p the density over its mean over all labels. If e is common, the most
    probable label remains, but its lead is bounded.
    """
    values, share = np.asarray(scores, dtype=np.float64), np.asarray(outlier_fraction)
    best = values.max(axis=1, keepdims=True, initial=-np.inf)
    _, label, count = np.unique(labels, return_inverse=True, return_counts=True)
    weight = 1.0 / (count[label] * len(count))
    mean = np.log(np.exp(values - best) @ weight)[:, None]
    with np.errstate(divide="ignore"):  # an outlier fraction of 0 or 1, whose logarithm is -inf
        return np.logaddexp(np.log1p(-share) + values - best - mean, np.log(share))


def fuse(*scores: ArrayLike, inverse_temperature: Sequence[float]) -> Floats:
    """Return the combined scores of several sensors.

    Parameters
    ----------
    *scores : (sample, template) array_like
        Scores of each sensor for the same samples and templates.
    inverse_temperature : sequence of float
        Factor that turns the scores of each sensor into log densities: 1 for log densities, else
        from `ncti.classify.calibration.fit_temperature_and_outliers`.

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
    ncti.classify.calibration.fit_temperature_and_outliers : Factor of a sensor.
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
    >>> fused = fuse(profile, silhouette, inverse_temperature=(1.0, 1.0))
    >>> int(fused.argmax()), label_posterior(fused, labels)[1].round(2).tolist()
    (1, [[0.9, 0.1]])
    """
    values = [require_all("scores", score) for score in scores]
    factors = require_all("inverse_temperature", inverse_temperature, minimum=0)
    shapes = {value.shape for value in values}
    if factors.shape != (len(values),) or len(shapes) != 1 or values[0].ndim != 2:
        listed = ", ".join(str(value.shape) for value in values)
        raise ValueError(
            f"scores have shapes {listed} for inverse_temperature of shape {factors.shape}, but "
            "must be as many of one shape (sample, template)"
        )
    total = np.zeros(values[0].shape)
    for term, step in zip(values, factors, strict=True):
        total += step * (term - term.max(axis=1, keepdims=True, initial=-np.inf))
    return total


def similarity_between_phases(
    silhouettes: NDArray[np.float32], templates: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the largest cosine (phase, sample, template) to each template in all other phases.

    `silhouettes` (phase, sample, feature) and `templates` (phase, template, feature) are maps at
    two or more places on the detector; an empty map has 0. In use, no template has the silhouette's
    place on the detector, so its own place is left out.
    """
    phases, views, features = templates.shape
    known = _directions(templates)
    best = np.empty((phases, silhouettes.shape[1], views), dtype=np.float32)
    for phase, vectors in enumerate(_directions(silhouettes)):
        references = known[np.arange(phases) != phase].reshape(-1, features)
        best[phase] = (vectors @ references.T).reshape(-1, phases - 1, views).max(axis=1)
    return best


def _directions(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return vectors of unit length, or zero for zero vectors."""
    norm = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    return np.asarray(vectors / np.where(norm > 0, norm, np.float32(1)), dtype=np.float32)
