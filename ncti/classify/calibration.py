"""Calibration of scores on held-out templates."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.classify.between import halves, separation
from ncti.classify.blocks import row_blocks
from ncti.classify.fusion import label_posterior, members, posterior_of

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

NEW_ASPECT_RATIO = 1 / 12  # mean squared distance of a new aspect over that of a held-out one
ASPECT_SIGMA = 15.0  # spread of the weight of answers by their distance in aspect [deg]
DISTANT_WEIGHT = 0.05  # weight of answers at any distance, relative to those at the same aspect
MIN_OUTLIERS = 1e-6
MAX_OUTLIERS = 0.999  # largest outlier fraction at a held-out aspect
BISECTIONS = 40
STEPS = np.geomspace(1e-4, 1e10, 31)
"""Products of inverse temperature and the spread of scores, searched first."""
EXCLUDED_COSINE = -1.0  # cosine to excluded templates, below the cosine of any map

Floats = NDArray[np.float64]


def fit_outlier_fraction(
    templates: GaussianTemplates,
    frame_count: int,
    rng: np.random.Generator,
    *,
    gain_sigma: float | None = None,
) -> Floats:
    """Return the probability (template,) that a likelihood carries no information.

    It is 0 if templates are exact, or too few to leave some out. A covariance with tangents of a
    curve does not model every glint, and densities of 250 bins are overconfident. The remaining
    templates therefore classify averages of `frame_count` frames drawn from every second template,
    then from those between, and e maximises the likelihood of the true labels, (1 - e) p +
    e / labels, p being the posterior. One right and one wrong answer are added, as in
    `fit_temperature_and_outliers`.

    Profiles change faster with aspect abeam than at the bow, so e depends on the aspect: answers
    have weight 0.05 + exp(-x^2 / 2) at a distance of x times 15 degrees, and added ones the mean
    weight. Width and weight were fitted to right answers of fusion at random aspects.

    A held-out template lies a whole step from the next one, a new aspect up to half a step, and at
    a template there is no outlier fraction. Failures are taken as independent events whose rate
    grows with the square of the distance. Its mean is 1/12 of that at a held-out template, so that
    e becomes 1 - (1 - e)^(1/12).
    """
    sets = halves(templates.labels_, templates.aspect_) if templates.template_error_ else []
    if not sets:
        return np.zeros(len(templates.labels_))
    # Probabilities of the true labels of held-out templates.
    correct = []
    for out in sets:
        samples, rest = templates.draw_averages(out, frame_count, rng), templates.without(out)
        truth = templates.labels_[out]  # every label keeps templates
        logs = rest.log_likelihood(samples, frame_count, gain_sigma=gain_sigma)
        _, posterior = label_posterior(logs, rest.labels_)
        correct.append(posterior[np.arange(len(truth)), truth])
    # Their weights at the aspect of each template.
    held_out = np.concatenate([templates.aspect_[out] for out in sets])
    places, place = np.unique(templates.aspect_, return_inverse=True)
    distance = separation(places[:, None], held_out)
    weight = DISTANT_WEIGHT + np.exp(-((distance / ASPECT_SIGMA) ** 2) / 2)
    fraction = likely_outlier_fraction(
        np.concatenate(correct), len(templates.classes_), weight, added=weight.mean(axis=1)
    )
    at_new_aspects = -np.expm1(NEW_ASPECT_RATIO * np.log1p(-np.minimum(fraction, MAX_OUTLIERS)))
    return at_new_aspects[place]


def likely_outlier_fraction(
    probability: Floats, labels: int, weight: Floats, *, added: ArrayLike = 1.0
) -> Floats:
    """Return the outlier fraction (...) that maximises the likelihood of true labels.

    `probability` (sample,) is the posterior p of each true label, among two or more `labels`;
    `weight` (..., sample) weighs them, and `added` (...) one more right and one more wrong answer.
    e in [1e-6, 1] maximises the weighted sum of log((1 - e) p + e / labels), which is concave, by
    bisection of its derivative.
    """
    extra = np.broadcast_to(added, weight.shape[:-1])[..., None]
    weights = np.concatenate([weight, extra, extra], axis=-1)
    answers = np.append(probability, [1.0, 0.0])
    losses = 1 / labels - answers
    slopes = weights * losses
    low, high = (np.full(weights.shape[:-1], end) for end in (MIN_OUTLIERS, 1.0))
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        rising = (slopes / (answers + middle[..., None] * losses)).sum(axis=-1) > 0
        low, high = np.where(rising, middle, low), np.where(rising, high, middle)
    return high


def fit_temperature_and_outliers(
    pieces: Sequence[Callable[[], Floats]],
    labels: NDArray[np.intp],
    truth: NDArray[np.intp],
    weights: Floats,
) -> tuple[float, float]:
    """Return the factor that turns scores into log densities, and their outlier fraction.

    Each piece returns scores (sample, template) of some samples. `labels` (template,) and `truth`
    (sample,) are numbers from 0, every true label has a template, and `weights` are (sample,). The
    factor is 0 if no sample has two different scores, or all templates have one label.

    Temperature scaling (Guo et al., ICML 2017, arXiv:1706.04599) fits the factor on samples other
    than those it is applied to; it does not change the order of templates, but decides the weight
    of one sensor against another. Log densities have the factor 1 and need no fit. A factor alone
    must be small enough for the worst answers, so it discards information in the others, and still
    leaves wrong answers overconfident. Here the probability of the true label is (1 - e) p + e /
    labels, with p the posterior at the inverse temperature s; s and e maximise its likelihood, with
    one right and one wrong answer added, as n correct answers in n do not make the next one certain
    (Platt, in Advances in Large Margin Classifiers, MIT Press 1999).
    """
    classes = int(labels.max()) + 1
    ptp = np.concatenate([np.ptp(piece(), axis=1) for piece in pieces])
    spread = float(ptp.mean()) if classes > 1 else 0.0
    if spread == 0.0:
        return 0.0, 0.0
    member, included = members(labels), np.ones((1, labels.size), np.bool_)

    def fraction_and_loss(log_inverse_temperature: float) -> tuple[float, float]:
        """Return the best outlier fraction at an inverse temperature, and the loss."""
        factor = math.exp(log_inverse_temperature)
        posterior = np.concatenate(
            [posterior_of(factor * piece(), member, included) for piece in pieces]
        )
        probability = posterior[np.arange(len(truth)), truth]
        outlier_fraction = float(likely_outlier_fraction(probability, classes, weights))
        answers = np.append(probability, [1.0, 0.0])
        mixed = (1 - outlier_fraction) * answers + outlier_fraction / classes
        return outlier_fraction, -float(np.append(weights, [1.0, 1.0]) @ np.log(mixed))

    from scipy.optimize import minimize_scalar

    def loss(log_inverse_temperature: float) -> float:
        """Return the loss at an inverse temperature."""
        return fraction_and_loss(log_inverse_temperature)[1]

    # Coarse steps first, because means over templates may add a local maximum before the minimum.
    steps = np.log(STEPS / spread)
    lowest = int(np.argmin([loss(step) for step in steps]))
    bounds = (steps[max(lowest - 1, 0)], steps[min(lowest + 1, len(steps) - 1)])
    logarithm = float(minimize_scalar(loss, bounds=bounds, method="bounded").x)
    return math.exp(logarithm), fraction_and_loss(logarithm)[0]


def fit_held_out_phases(
    scores: NDArray[np.float32], labels: NDArray[np.intp], aspect: NDArray[Any]
) -> Floats:
    """Return (2, phase) inverse temperatures and outlier fractions, fitted to the other phases.

    `scores` (phase, template, template) are cosines of a sample of every template to all, at two or
    more places on the detector, `labels` (template,), and `aspect` (template,) or its number.
    Samples count 11/12 with the templates of their own aspect, and 1/12 without: similarity falls
    with the square of the distance in aspect.
    """
    phases, views, _ = scores.shape
    _, names = np.unique(labels, return_inverse=True)

    def piece(phase: int, rows: slice, left_out: bool) -> Floats:
        """Return rows of scores, with or without the templates of their own aspects."""
        similarity = scores[phase, rows].astype(np.float64)
        excluded = left_out & (aspect[rows, None] == aspect)
        return np.where(excluded, EXCLUDED_COSINE, similarity)

    weight = np.repeat([1 - NEW_ASPECT_RATIO, NEW_ASPECT_RATIO], (phases - 1) * views)
    truth = np.tile(names, 2 * (phases - 1))
    constants = np.empty((2, phases))
    for phase in range(phases):
        parts = product((False, True), np.delete(np.arange(phases), phase), row_blocks(views))
        pieces = [partial(piece, other, rows, left_out) for left_out, other, rows in parts]
        constants[:, phase] = fit_temperature_and_outliers(pieces, names, truth, weight)
    return constants
