"""Calibration of scores on templates that are left out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_labels
from ncti.classify.bands import coloured
from ncti.classify.between import CIRCLE, every_other, halves
from ncti.classify.fusion import STEPS, label_posterior

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

UNKNOWN_ERROR = 1.0  # if there are too few templates to leave some out: the residual's full scale
CALIBRATED_AT = 16  # frames in the averages used for calibration
WITHIN = 1e-4, 1e2  # bounds of the template error
FRESH = 1 / 12  # mean square of the distance of a new aspect, over that of one left out
NEARBY = 15.0  # standard deviation of the weight of answers by their distance in aspect [deg]
ANYWHERE = 0.05  # weight of answers at any distance, relative to those at the same aspect
LEAST_DOUBT = 1e-6
CERTAIN = 0.999  # largest doubt at an aspect left out
BISECTIONS = 40

Floats = NDArray[np.float64]


def calibrated_error(templates: GaussianTemplates, rng: np.random.Generator) -> float:
    """Return the template error that maximises the likelihood of templates left out.

    Parameters
    ----------
    templates : GaussianTemplates
        Classifier with aspects and some template error.
    rng : numpy.random.Generator
        Draws an average of 16 frames from every second template of a label.

    Returns
    -------
    float
        Template error from 1e-4 to 100, to 5 %, with the largest mean log density of an average
        under the two neighbouring templates of its label. 1 if no label has five templates.
    """
    # Imported here because scipy.optimize takes half a second.
    from scipy.optimize import minimize_scalar

    out, beside = every_other(templates.labels_, templates.aspect_)
    if not out.any():
        return UNKNOWN_ERROR
    samples, rest = _drawn(templates, out, CALIBRATED_AT, rng), templates.without(out)
    priors = np.array([[templates.gain_sigma, templates.floor_sigma]])
    answering = [(t, rows) for t, rows in enumerate(beside.T) if rows.any()]

    def surprise(log_error: float) -> float:
        """Return the mean negative log density of the averages."""
        rest.template_error_ = math.exp(log_error)
        logs = np.full(beside.shape, -np.inf)
        for t, rows in answering:
            frames = np.full(rows.sum(), float(CALIBRATED_AT))
            logs[rows, t] = rest.density(t, samples[rows], frames, priors)[0, 0]
        return -float(np.logaddexp.reduce(logs, axis=1).mean())

    bounds = tuple(map(math.log, WITHIN))
    found = minimize_scalar(surprise, bounds=bounds, method="bounded", options={"xatol": 0.05})
    return math.exp(float(found.x))


def fit_doubt(
    templates: GaussianTemplates,
    frame_count: int,
    rng: np.random.Generator,
    *,
    gain_sigma: ArrayLike | None = None,
) -> Floats:
    """Return the probability at each template that a likelihood carries no information.

    Parameters
    ----------
    templates : GaussianTemplates
        Fitted classifier.
    frame_count : int
        Number of frames in each average.
    rng : numpy.random.Generator
        Draws an average from every template that is left out.
    gain_sigma : (...) array_like, optional
        See `GaussianTemplates.log_likelihood`.

    Returns
    -------
    (..., template) float64 ndarray
        Probability, for each gain prior and template; 0 if templates are exact, or too few to
        leave some out.

    See Also
    --------
    ncti.classify.fusion.doubted : Scores that allow for this probability.
    fit_sharpness_and_doubt : The same for scores that are not log densities.

    Notes
    -----
    A covariance with tangents of a curve does not model every glint, and densities of 250 bins
    are overconfident. Averages drawn from every second template are therefore classified by those
    that remain, then those between by the first, and e maximises the likelihood of their true
    labels, (1 - e) p + e / labels, p being the posterior. One right and one wrong answer are
    added, as in `ncti.classify.fit_sharpness`.

    Profiles change faster with aspect abeam than at the bow, so e depends on the aspect: answers
    have weight 0.05 + exp(-x^2 / 2) at a distance of x times 15 degrees, and those added the mean
    weight of all. Width and weight were fitted to right answers of fusion at random aspects.

    A template left out lies a whole step from the next one, a new aspect up to half a step, and at
    a template there is no doubt. Failures are taken as independent chances that grow with the
    square of the distance, whose mean is 1/12: of e remains 1 - (1 - e)^(1/12).

    Examples
    --------
    Exact templates leave no doubt:

    >>> import numpy as np
    >>> from ncti.classify import GaussianTemplates, lower_band
    >>> from ncti.classify.calibration import fit_doubt
    >>> band = lower_band(np.stack([np.eye(3)] * 2))
    >>> exact = GaussianTemplates().fit([[0, 1, 0], [1, 0, 0]], band, ["duncan", "roberts"], 0)
    >>> fit_doubt(exact, 16, np.random.default_rng(0))
    array([0., 0.])
    """
    require("frame_count", frame_count, whole=True, minimum=1)
    given = np.asarray(templates.gain_sigma if gain_sigma is None else gain_sigma)
    doubt = np.zeros((*given.shape, len(templates.labels_)))
    if not templates.template_error_:
        return doubt
    sets = halves(templates.labels_, templates.aspect_)
    if not sets:
        return doubt
    # Probabilities of the true labels of templates left out, for each gain prior.
    true = []
    for out in sets:
        samples, rest = _drawn(templates, out, frame_count, rng), templates.without(out)
        own = templates.labels_[out]  # every label keeps templates
        logs = rest.log_likelihood(samples, frame_count, gain_sigma=given.ravel())
        posteriors = [label_posterior(one, rest.labels_)[1] for one in logs]
        true.append([posterior[np.arange(len(own)), own] for posterior in posteriors])
    answers = np.concatenate(true, axis=1)
    # Their weights at the aspect of each template.
    left = np.concatenate([templates.aspect_[out] for out in sets])
    places, place = np.unique(templates.aspect_, return_inverse=True)
    apart = np.abs(places[:, None] - left) % CIRCLE
    apart = np.minimum(apart, CIRCLE - apart)
    weight = ANYWHERE + np.exp(-((apart / NEARBY) ** 2) / 2)
    labels = len(templates.classes_)
    for g, one in enumerate(answers):
        found = likely_doubt(one, labels, weight, added=weight.mean(axis=1))
        fresh = -np.expm1(FRESH * np.log1p(-np.minimum(found, CERTAIN)))
        doubt.reshape(-1, len(place))[g] = fresh[place]
    return doubt


def likely_doubt(
    probability: Floats, labels: int, weight: Floats, *, added: ArrayLike = 1.0
) -> Floats:
    """Return the doubt that maximises the likelihood of true labels.

    Parameters
    ----------
    probability : (sample,) float64 ndarray
        Posterior probability of the true label of each sample.
    labels : int
        Number of labels, two or more.
    weight : (..., sample) float64 ndarray
        Weight of each sample.
    added : (...) array_like, default=1.0
        Weight of a right and of a wrong answer that are added.

    Returns
    -------
    (...) float64 ndarray
        The e in [1e-6, 1] that maximises the weighted sum of log((1 - e) p + e / labels), p being
        the probability: the sum is concave in e, so its derivative is bisected.
    """
    more = np.broadcast_to(added, weight.shape[:-1])[..., None]
    weights = np.concatenate([weight, more, more], axis=-1)
    answers = np.append(probability, [1.0, 0.0])
    low, high = (np.full(weights.shape[:-1], end) for end in (LEAST_DOUBT, 1.0))
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        mixed = answers + middle[..., None] * (1 / labels - answers)
        rising = (weights * (1 / labels - answers) / mixed).sum(axis=-1) > 0
        low, high = np.where(rising, middle, low), np.where(rising, high, middle)
    return high


def fit_sharpness_and_doubt(
    scores: ArrayLike, labels: ArrayLike, truth: ArrayLike, *, weight: ArrayLike = 1.0
) -> tuple[float, float]:
    """Return the factor that turns scores into log densities, and their doubt, fitted together.

    Parameters
    ----------
    scores, labels, truth
        See `ncti.classify.fit_sharpness`.
    weight : float or (sample,) array_like, default=1.0
        Weight of each sample.

    Returns
    -------
    sharpness : float
        Factor above 0, in the inverse unit of the scores; 0 if every sample has one score for all
        templates, or all templates have the same label.
    doubt : float
        Probability that the scores of a sample carry no information, in [0, 1].

    Raises
    ------
    ValueError
        If shapes do not match, there is no sample, a score is not finite, a weight is negative, or
        a true label has no template.

    See Also
    --------
    ncti.classify.fit_sharpness : The factor alone, which has to be smaller.
    ncti.classify.fusion.doubted : Scores that allow for the doubt.

    Notes
    -----
    A factor alone must be small enough for the worst answers, so it discards what the others
    contain, and yet leaves wrong answers that are too sure. Here the probability of the true label
    is (1 - e) p + e / labels, with p the posterior at the sharpness s; s and e maximise its
    likelihood, with one right and one wrong answer added.

    Examples
    --------
    One answer in ten is of another ship altogether:

    >>> import numpy as np
    >>> from ncti.classify.calibration import fit_sharpness_and_doubt
    >>> rng = np.random.default_rng(0)
    >>> truth = rng.integers(4, size=4000)
    >>> shown = np.where(rng.random(4000) < 0.1, rng.integers(4, size=4000), truth)
    >>> seen = 4.0 * np.eye(4)[shown] + rng.normal(size=(4000, 4))
    >>> logs = -((seen[:, None] - 4.0 * np.eye(4)) ** 2).sum(axis=2) / 2
    >>> sharpness, doubt = fit_sharpness_and_doubt(logs / 10, np.arange(4), truth)
    >>> print(f"{sharpness:.0f} {doubt:.2f}")
    10 0.11
    """
    values, names = require_all("scores", scores), require_labels("labels", labels)
    true, weights = require_labels("truth", truth), require_all("weight", weight, minimum=0)
    if weights.shape not in ((), true.shape):
        raise ValueError(f"weight has shape {weights.shape}, but must be {true.shape}")
    weights = np.broadcast_to(weights, true.shape)
    classes, _ = label_posterior(values, names)
    if true.shape != values.shape[:1] or not true.size or not np.isin(true, classes).all():
        raise ValueError(
            f"truth has shape {true.shape}, but must be one label of a template for each of "
            f"{len(values)} samples, one or more"
        )
    spread = float(np.ptp(values, axis=1).mean()) if len(classes) > 1 else 0.0
    if spread == 0.0:
        return 0.0, 0.0
    # Imported here because scipy.optimize takes half a second.
    from scipy.optimize import minimize_scalar

    at = np.arange(len(true)), np.searchsorted(classes, true)

    def fitted(log_sharpness: float) -> tuple[float, float]:
        """Return the best doubt at a sharpness, and the negative log-likelihood."""
        probability = label_posterior(math.exp(log_sharpness) * values, names)[1][at]
        doubt = float(likely_doubt(probability, len(classes), weights))
        answers = np.append(probability, [1.0, 0.0])
        mixed = (1 - doubt) * answers + doubt / len(classes)
        return doubt, -float(np.append(weights, [1.0, 1.0]) @ np.log(mixed))

    # Coarse steps first, because there may be several local maxima.
    steps = np.log(STEPS / spread)
    lowest = int(np.argmin([fitted(step)[1] for step in steps]))
    bounds = (steps[max(lowest - 1, 0)], steps[min(lowest + 1, len(steps) - 1)])
    found = float(minimize_scalar(lambda x: fitted(x)[1], bounds=bounds, method="bounded").x)
    return math.exp(found), fitted(found)[0]


def _drawn(
    templates: GaussianTemplates, which: NDArray[np.bool_], frames: int, rng: np.random.Generator
) -> Floats:
    """Return (sample, bin) averages, one drawn from the moments of each chosen template."""
    factors = templates.cholesky_[which]
    noise = rng.standard_normal((len(factors), templates.mean_.shape[1]))
    drawn = np.array([coloured(*pair) for pair in zip(factors, noise, strict=True)])
    return templates.mean_[which] + drawn / math.sqrt(frames)
