"""Maximum likelihood from the exact mean and covariance of range profiles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.classify.fusion import label_posterior
from sweeps.engine.settings import Choices, Settings, number
from sweeps.engine.stage import Output, Stage, in_memory, stage
from sweeps.stages import classifier
from sweeps.stages.classifier import (
    GATHERED,
    NONE,
    Arrays,
    Classifier,
    Floats,
    Naming,
    Profiles,
    Views,
)
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import RANGE, Grid

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

IMPORTS = ("ncti.classify.likelihood",)  # by its stages, when they are called; takes long
NAME = "likelihood"
NAMING = Naming(NAME, classifier.names_by(NAME, RANGE))


class Likelihood(Settings, key="classifier"):
    """What is known beforehand of profiles."""

    gain_sigma = number(
        *(1.0, 0, 1000),
        label="prior standard deviation of the target's gain",
        help="0: it is known",
        noted=True,
    )
    nugget = number(
        1e-3, 1e-9, 1000, label="noise allowed for besides the model's, over its variance"
    )
    template_error = number(
        *(None, 0, 1000),
        label="variance of profiles between templates, over that of half their second difference",
        help="0: templates are exact; null: calibrated on aspects left out",
    )


@stage(
    Output("calibrated_error", dtype="f8"),
    uses=(Grid, Likelihood),
    gather=GATHERED,
    stream=(Grid.pulse_width, Grid.range, Ladar.target_free_ifovs),
)
def calibrated_error(
    expected: Profiles,
    covariance: Profiles,
    there: Views,
    taught: Views,
    aspect: tuple[float, ...],
    nugget: float,
    template_error: float | None,
    rng: np.random.Generator,
) -> Floats:
    """Return the template error, of templates that are left out where it is not given."""
    known = there & taught
    if template_error is None and known.any():
        templates = _templates(expected, covariance, known, aspect, nugget, None, rng)
        return np.array(templates.template_error_)
    return np.array(template_error or 0.0)


@in_memory(uses=(Grid, Likelihood), gather=GATHERED, keep=2)
def profile_moments(
    expected: Profiles,
    covariance: Profiles,
    there: Views,
    taught: Views,
    aspect: tuple[float, ...],
    nugget: float,
    calibrated_error: Floats,
) -> tuple[GaussianTemplates, Views]:
    """Return templates of all views that are learned, and the (ship, aspect) views of these."""
    known = there & taught
    error = float(calibrated_error)
    return _templates(expected, covariance, known, aspect, nugget, error), known


def _templates(
    expected: Profiles,
    covariance: Profiles,
    known: Views,
    aspect: tuple[float, ...],
    nugget: float,
    template_error: float | None,
    rng: np.random.Generator | None = None,
) -> GaussianTemplates:
    """Return templates of some views.

    Their floor, which the target's gain leaves alone, is what the window's edge holds: noise, the
    ship's own IFOVs' among it.
    """
    # Imported where it is used: scikit-learn takes a second.
    from ncti.classify.likelihood import GaussianTemplates

    means = expected[known]
    ship, column = known.nonzero()
    templates = GaussianTemplates(nugget=nugget, template_error=template_error)
    at = np.array(aspect)[column]
    return templates.fit(means, covariance[known], ship, floor=means[:, :1], aspect=at, rng=rng)


@stage(
    Output("profile_scores", ("view", "template"), "f8"),
    uses=(Grid, Likelihood),
    along=(Likelihood.gain_sigma, Grid.frame_count),
    gather=GATHERED,
)
def profile_scores(
    profile_moments: tuple[GaussianTemplates, Views],
    averaged: Profiles,
    there: Views,
    gain_sigma: tuple[float, ...],
    frame_count: tuple[int, ...],
) -> Floats:
    """(gain_sigma, frame_count, view, template): log-likelihoods.

    NaN where a view is not there, or the template is not learned. The gain is as well known as
    `gain_sigma` says.
    """
    templates, known = profile_moments
    views = there.reshape(-1)
    scores = np.full((len(gain_sigma), len(frame_count), views.size, views.size), np.nan)
    for f, count in enumerate(frame_count):
        logs = templates.log_likelihood(averaged[f][there], count, gain_sigma=gain_sigma)
        scores[:, f, views[:, None] & known.reshape(-1)] = logs.reshape(len(gain_sigma), -1)
    return scores


@NAMING.answers(
    Output("probability", classifier.VIEW, label="posterior probability of the true ship"),
    Output("calibrated_error", label="template error, as given or as calibrated"),
    uses=(Grid, Classifier, Likelihood),
    along=(Likelihood.gain_sigma, Classifier.left_out, Grid.frame_count),
    dims=(*classifier.OF_PROFILES, "gain_sigma", "left_out", "replicate", "frame_count"),
)
def likelihood(
    profile_moments: tuple[GaussianTemplates, Views],
    profile_scores: Floats,
    averaged: Profiles,
    there: Views,
    gain_sigma: tuple[float, ...],
    left_out: tuple[bool, ...],
    frame_count: tuple[int, ...],
) -> Arrays:
    """Return the most probable ship, one number of frames at a time.

    Where the true aspect is left out, templates of all ships at it are, and cells of those beside
    it reach as far as it.
    """
    templates, known = profile_moments
    classifier.require_another_aspect(known, left_out)
    (true, of_view), (of_ship, of_template) = np.nonzero(there), np.nonzero(known)
    places: tuple[Any, ...] = (slice(None), *np.ix_(there.reshape(-1), known.reshape(-1)))
    whole = (len(gain_sigma), len(left_out), len(frame_count), *there.shape)
    named, probability = np.full(whole, NONE), np.full(whole, np.nan)
    for k, f in np.ndindex(whole[1:3]):
        logs = profile_scores[:, f][places]
        exclude = (of_view[:, None] == of_template) & left_out[k]
        if left_out[k] and templates.template_error_:
            seen = averaged[f][there]
            for column in np.unique(of_view):
                rows, others = of_view == column, of_template != column
                rest = templates.without(~others)
                logs[(slice(None), *np.ix_(rows, others))] = rest.log_likelihood(
                    seen[rows], frame_count[f], gain_sigma=gain_sigma
                )
        for g, one in enumerate(logs):
            named[g, k, f, there], probability[g, k, f, there] = classifier.most_probable(
                label_posterior(one, of_ship, exclude=exclude), true
            )
    error = np.full(whole[:3], templates.template_error_)
    return classifier.judged(named, there) | {"probability": probability, "calibrated_error": error}


def check(choices: Choices) -> Choices:
    """Refuse other receivers, whose moments nobody knows, and to leave all aspects out."""
    if NAMING.when(choices):
        classifier.check_receiver(choices, NAME)
        classifier.check_left_out(choices)
    return choices


SETTINGS: tuple[type[Settings], ...] = (Likelihood,)
STAGES: tuple[Stage, ...] = (calibrated_error, profile_moments, profile_scores, likelihood)
TABLES = NAMING.tables()
