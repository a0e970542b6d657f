"""How sure a likelihood may be, learned from templates that are left out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.classify.bands import coloured
from ncti.classify.between import every_other

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

UNKNOWN_ERROR = 1.0  # where templates are too few to leave some out: all of the residual's scale
CALIBRATED_AT = 16  # frames of the averages that the error is calibrated on
WITHIN = 1e-4, 1e2  # error
FRESH = 0.25  # mean step of a fresh aspect from its template, over that of one left out
LEAST_DOUBT = 1e-6

Floats = NDArray[np.float64]


def calibrated_error(templates: GaussianTemplates, rng: np.random.Generator) -> float:
    """Template error that makes the most of averages drawn of templates left out.

    Parameters
    ----------
    templates : GaussianTemplates
        With aspects and some template error.
    rng : numpy.random.Generator
        Draws an average of 16 frames of every second template of a label.

    Returns
    -------
    float
        From 1e-4 to 100, within 5 %: the one of the largest mean log density of an average under
        the two templates of its label beside it. 1 where no label has five templates.
    """
    # Imported where it is used: scipy.optimize takes half a second.
    from scipy.optimize import minimize_scalar

    out, beside = every_other(templates.labels_, templates.aspect_)
    if not out.any():
        return UNKNOWN_ERROR
    samples, rest = _drawn(templates, out, CALIBRATED_AT, rng), templates.without(out)
    priors = np.array([[templates.gain_sigma, templates.floor_sigma]])
    answering = [(t, rows) for t, rows in enumerate(beside.T) if rows.any()]

    def surprise(log_error: float) -> float:
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
    """Probability that a likelihood, for all it knows of its error, says nothing of a label.

    Parameters
    ----------
    templates : GaussianTemplates
        Fitted.
    frame_count : int
        Frames in each average.
    rng : numpy.random.Generator
        Draws an average of every second template of a label.
    gain_sigma : (...) array_like, optional
        As for `GaussianTemplates.log_likelihood`.

    Returns
    -------
    (...) float64 ndarray
        0 where templates are exact or too few to leave some out.

    Notes
    -----
    A covariance with two tangents of a curve is no model of every glint, and densities of 250
    bins are sure of what they say. So averages of templates left out are named by those that
    remain: e makes the most of their true labels as (1 - e) p + e / labels, p the probability
    found. One right and one wrong answer are added, as in `ncti.classify.fit_sharpness`.

    What is left out lies a whole step from the next template, a fresh aspect a quarter of a step
    on average, and what lies at a template is not in doubt: in between e is linear.
    """
    given = np.asarray(templates.gain_sigma if gain_sigma is None else gain_sigma)
    doubt = np.zeros(given.shape)
    if not templates.template_error_:
        return doubt
    out, _ = every_other(templates.labels_, templates.aspect_)
    if not out.any():
        return doubt
    # Imported where it is used: scipy.optimize takes half a second.
    from scipy.optimize import minimize_scalar

    samples, rest = _drawn(templates, out, frame_count, rng), templates.without(out)
    logs = rest.log_likelihood(samples, frame_count, gain_sigma=given.ravel())
    classes = len(np.unique(rest.labels_))
    own = np.searchsorted(np.unique(rest.labels_), templates.labels_[out])
    for g, one in enumerate(logs):
        true = rest.posterior_of(one)[np.arange(len(own)), own]
        answers = np.append(true, [0.0, 1.0])

        def surprise(log_doubt: float, answers: Floats = answers) -> float:
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
    """(sample, bin): an average of each of some templates, by its own moments."""
    factors = templates.cholesky_[which]
    noise = rng.standard_normal((len(factors), templates.mean_.shape[1]))
    drawn = np.array([coloured(*pair) for pair in zip(factors, noise, strict=True)])
    return templates.mean_[which] + drawn / math.sqrt(frames)
