"""Calibration of likelihoods on templates that are left out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.classify.bands import coloured
from ncti.classify.between import every_other
from ncti.classify.fusion import label_posterior

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

UNKNOWN_ERROR = 1.0  # if there are too few templates to leave some out: the residual's full scale
CALIBRATED_AT = 16  # frames in the averages used for calibration
WITHIN = 1e-4, 1e2  # bounds of the template error
FRESH = 0.25  # mean distance of a new aspect from its template, over that of one left out
LEAST_DOUBT = 1e-6

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
    """Return the probability that a likelihood carries no information on the label.

    Parameters
    ----------
    templates : GaussianTemplates
        Fitted classifier.
    frame_count : int
        Number of frames in each average.
    rng : numpy.random.Generator
        Draws an average from every second template of a label.
    gain_sigma : (...) array_like, optional
        See `GaussianTemplates.log_likelihood`.

    Returns
    -------
    (...) float64 ndarray
        Probability, for each gain prior; 0 if templates are exact, or too few to leave some out.

    See Also
    --------
    ncti.classify.fusion.doubted : Scores that allow for this probability.

    Notes
    -----
    A covariance with tangents of a curve does not model every glint, and densities of 250 bins
    are overconfident. Averages drawn from the templates left out are therefore classified by those
    that remain, and e maximises the likelihood of their true labels, (1 - e) p + e / labels, p
    being the posterior. One right and one wrong answer are added, as in
    `ncti.classify.fit_sharpness`.

    A template left out lies a whole step from the next one, a new aspect a quarter of a step on
    average, and at a template there is no doubt: e is taken as linear in between.

    Examples
    --------
    Exact templates leave no doubt:

    >>> import numpy as np
    >>> from ncti.classify import GaussianTemplates, lower_band
    >>> from ncti.classify.calibration import fit_doubt
    >>> band = lower_band(np.stack([np.eye(3)] * 2))
    >>> exact = GaussianTemplates().fit([[0, 1, 0], [1, 0, 0]], band, ["duncan", "roberts"])
    >>> float(fit_doubt(exact, 16, np.random.default_rng(0)))
    0.0
    """
    given = np.asarray(templates.gain_sigma if gain_sigma is None else gain_sigma)
    doubt = np.zeros(given.shape)
    if not templates.template_error_:
        return doubt
    out, _ = every_other(templates.labels_, templates.aspect_)
    if not out.any():
        return doubt
    # Imported here because scipy.optimize takes half a second.
    from scipy.optimize import minimize_scalar

    # Probabilities of the true labels of templates left out, for each gain prior.
    samples, rest = _drawn(templates, out, frame_count, rng), templates.without(out)
    logs = rest.log_likelihood(samples, frame_count, gain_sigma=given.ravel())
    classes, own = len(rest.classes_), templates.labels_[out]  # every label keeps templates
    for g, one in enumerate(logs):
        true = label_posterior(one, rest.labels_)[1][np.arange(len(own)), own]
        answers = np.append(true, [0.0, 1.0])

        def surprise(log_doubt: float, answers: Floats = answers) -> float:
            """Return the mean negative log probability of the true labels."""
            share = math.exp(log_doubt)
            return -float(np.log((1 - share) * answers + share / classes).mean())

        bounds = (math.log(LEAST_DOUBT), 0.0)
        doubt.flat[g] = FRESH * math.exp(
            minimize_scalar(surprise, bounds=bounds, method="bounded").x
        )
    return doubt


def _drawn(
    templates: GaussianTemplates, which: NDArray[np.bool_], frames: int, rng: np.random.Generator
) -> Floats:
    """Return (sample, bin) averages, one drawn from the moments of each chosen template."""
    factors = templates.cholesky_[which]
    noise = rng.standard_normal((len(factors), templates.mean_.shape[1]))
    drawn = np.array([coloured(*pair) for pair in zip(factors, noise, strict=True)])
    return templates.mean_[which] + drawn / math.sqrt(frames)
