"""Maximum likelihood from the exact mean and covariance of range profiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ncti.classify.fusion import label_posterior
from ncti.features.profile import estimated_floor
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Settings, number, switch
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


KNOWN = "classifier.aspect_known has True, but must be false where {}"


class Likelihood(Settings, key="classifier"):
    """Prior knowledge of profiles."""

    gain_sigma = number(
        *(1.0, 0, 1000),
        label="prior standard deviation of the target's gain",
        help="0: known",
        noted=True,
    )
    floor_sigma = number(
        *(1.0, 0, 1000),
        label="prior standard deviation of the noise floor, relative to that of one frame",
        help="0: known",
    )
    floor_estimated = switch(
        False,
        label="noise floor estimated from the edges of the window",
        help="used by the likelihood; with floor_sigma 0 the estimate counts as exact",
    )
    aspect_known = switch(
        False,
        label="restriction to exact templates at the true aspect",
        help="used by the likelihood, as if a track gave the heading",
    )
    nugget = number(
        1e-3, 1e-9, 1000, label="variance of noise beyond the model, relative to the model's"
    )
    template_error = number(
        *(None, 0, 1000),
        label="variance of profiles between templates, relative to half their second difference",
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
    training_views: Views,
    aspect: tuple[float, ...],
    nugget: float,
    floor_sigma: float,
    template_error: float | None,
    aspect_known: bool,
    rng: np.random.Generator,
    floor_estimated: bool = False,
) -> Floats:
    """Return the template error, calibrated on templates left out unless it is given."""
    known = there & training_views
    if aspect_known:
        return np.array(0.0)
    if template_error is None and known.any():
        priors = nugget, floor_sigma
        means = _levelled(expected, floor_estimated)
        templates = _templates(means, covariance, known, aspect, priors, None, rng)
        return np.array(templates.template_error_)
    return np.array(template_error or 0.0)


@in_memory(uses=(Grid, Likelihood), gather=GATHERED, keep=2)
def profile_moments(
    expected: Profiles,
    covariance: Profiles,
    there: Views,
    training_views: Views,
    aspect: tuple[float, ...],
    nugget: float,
    floor_sigma: float,
    calibrated_error: Floats,
    floor_estimated: bool = False,
) -> tuple[GaussianTemplates, Views]:
    """Return the templates of all training views, and their (ship, aspect) mask."""
    known = there & training_views
    error, priors = float(calibrated_error), (nugget, floor_sigma)
    means = _levelled(expected, floor_estimated)
    return _templates(means, covariance, known, aspect, priors, error), known


def _levelled(profiles: Profiles, floor_estimated: bool) -> Profiles | Floats:
    """Return profiles with their floors removed where these are estimated."""
    return profiles - estimated_floor(profiles) if floor_estimated else profiles


def _templates(
    expected: Profiles | Floats,
    covariance: Profiles,
    known: Views,
    aspect: tuple[float, ...],
    priors: tuple[float, float],
    template_error: float | None,
    rng: np.random.Generator | None = None,
) -> GaussianTemplates:
    """Return templates of some views, of a nugget and a prior of the floor.

    Their floor, which the target's gain leaves alone, is what the window's edge holds: noise, the
    ship's own IFOVs' among it.
    """
    # Imported here because scikit-learn takes a second.
    from ncti.classify.likelihood import GaussianTemplates

    means = expected[known]
    ship, column = known.nonzero()
    nugget, floor_sigma = priors
    templates = GaussianTemplates(
        nugget=nugget, floor_sigma=floor_sigma, template_error=template_error
    )
    at = np.array(aspect)[column]
    return templates.fit(means, covariance[known], ship, floor=means[:, :1], aspect=at, rng=rng)


@stage(
    Output("log_density", ("view", "template"), "f8"),
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
    floor_estimated: bool = False,
) -> Floats:
    """Return (gain_sigma, frame_count, view, template) log densities.

    NaN for missing views and for templates that are not learned. `gain_sigma` is the prior
    standard deviation of the gain.
    """
    templates, known = profile_moments
    views = there.reshape(-1)
    whole = len(gain_sigma), len(frame_count), views.size, views.size
    found = np.full(whole, np.nan)
    for f, count in enumerate(frame_count):
        seen = _levelled(averaged[f][there], floor_estimated)
        one = templates.log_likelihood(seen, count, gain_sigma=gain_sigma)
        found[:, f, views[:, None] & known.reshape(-1)] = one.reshape(len(gain_sigma), -1)
    return found


@NAMING.answers(
    Output("probability", classifier.VIEW, label="posterior probability of the true ship"),
    Output("similarity", classifier.VIEW, label="posterior probability of the predicted ship"),
    Output("calibrated_error", label="template error, given or calibrated"),
    uses=(Grid, Classifier, Likelihood),
    along=(Likelihood.gain_sigma, Classifier.left_out, Grid.frame_count),
    dims=(
        *classifier.OF_PROFILES,
        "gain_sigma",
        "left_out",
        "replicate",
        "ifov_phase",
        "frame_count",
    ),
)
def likelihood(
    profile_moments: tuple[GaussianTemplates, Views],
    profile_scores: Floats,
    averaged: Profiles,
    there: Views,
    gain_sigma: tuple[float, ...],
    left_out: tuple[bool, ...],
    frame_count: tuple[int, ...],
    aspect_known: bool,
    floor_estimated: bool = False,
) -> Arrays:
    """Return the most probable ship, one number of frames at a time.

    Where the true aspect is left out, templates of all ships at it are, and cells of those beside
    it reach as far as it.
    """
    templates, known = profile_moments
    classifier.require_another_aspect(known, left_out)
    (true, of_view), (of_ship, of_template) = np.nonzero(there), np.nonzero(known)
    rows_of, columns_of = np.ix_(there.reshape(-1), known.reshape(-1))
    whole = (len(gain_sigma), len(left_out), len(frame_count), *there.shape)
    named, probability = np.full(whole, NONE), np.full(whole, np.nan)
    similarity = np.full(whole, np.nan)
    for k, f in np.ndindex(whole[1:3]):
        compared = profile_scores[:, f, rows_of, columns_of]
        same = of_view[:, None] == of_template
        exclude = (same & left_out[k]) | (~same & aspect_known)
        if left_out[k] and templates.template_error_:
            seen = _levelled(averaged[f][there], floor_estimated)
            for column in np.unique(of_view):
                rows, others = of_view == column, of_template != column
                rest = templates.without(~others)
                compared[(..., *np.ix_(rows, others))] = rest.log_likelihood(
                    seen[rows], frame_count[f], gain_sigma=gain_sigma
                )
        for g, logs in enumerate(compared):
            posterior = label_posterior(logs, of_ship, exclude=exclude)
            answer = named[g, k, f], probability[g, k, f], similarity[g, k, f]
            answer[0][there], answer[1][there] = classifier.most_probable(posterior, true)
            answer[2][there] = posterior[1].max(axis=1)
    error = np.full(whole[:3], templates.template_error_)
    return classifier.judged(named, there) | {
        "probability": probability,
        "similarity": similarity,
        "calibrated_error": error,
    }


def check(choices: Choices) -> Choices:
    """Refuse receivers with unknown moments, and leaving all aspects out."""
    if NAMING.when(choices):
        classifier.check_receiver(choices, NAME)
        classifier.check_left_out(choices)
        if any(choices[Likelihood.aspect_known]):
            if any(choices[Classifier.left_out]):
                raise ConfigurationError(KNOWN.format("classifier.left_out has True"))
            if not classifier.learned_of(choices).any(axis=0).all():
                raise ConfigurationError(KNOWN.format("an aspect of the grid is not learned"))
    return choices


SETTINGS: tuple[type[Settings], ...] = (Likelihood,)
STAGES: tuple[Stage, ...] = (calibrated_error, profile_moments, profile_scores, likelihood)
TABLES = NAMING.tables(rejecting=True)
