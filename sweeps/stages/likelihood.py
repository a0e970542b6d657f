"""Maximum likelihood from the exact mean and covariance of range profiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

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


@in_memory(uses=(Likelihood,), gather=GATHERED, keep=2)
def profile_moments(
    expected: Profiles, covariance: Profiles, there: Views, nugget: float
) -> tuple[GaussianTemplates, Views]:
    """Return templates of all views that are there, and the (ship, aspect) views that these are.

    Their floor, which the target's gain leaves alone, is what the window's edge holds: noise, the
    ship's own IFOVs' among it.
    """
    # Imported where it is used: scikit-learn takes a second.
    from ncti.classify.likelihood import GaussianTemplates

    means = expected[there]
    templates = GaussianTemplates(nugget=nugget)
    templates.fit(means, covariance[there], np.nonzero(there)[0], floor=means[:, :1])
    return templates, there


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
    """(gain_sigma, frame_count, view, template): log-likelihoods, NaN where a view is not there.

    Every view is a template, of a gain as well known as `gain_sigma` says.
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
    profile_scores: Floats,
    taught: Views,
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    left_out: tuple[bool, ...],
) -> Arrays:
    """Return the most probable ship, one number of frames at a time.

    Where the true aspect is left out, templates of all ships at it are.
    """
    shape = len(ship), len(aspect)
    scored = np.isfinite(profile_scores[0, 0])
    there, known = (scored.any(axis=axis).reshape(shape) for axis in (1, 0))
    classifier.require_another_aspect(taught & known, left_out)
    (true, of_view), (of_ship, of_template) = np.nonzero(there), np.nonzero(known)
    untaught, same = ~taught[known], of_view[:, None] == of_template
    whole = (len(profile_scores), len(left_out), profile_scores.shape[1], *shape)
    named, probability = np.full(whole, NONE), np.full(whole, np.nan)
    for g, k, f in np.ndindex(whole[:3]):
        logs = profile_scores[g, f, scored].reshape(true.size, -1)
        exclude = untaught | (same & left_out[k])
        named[g, k, f, there], probability[g, k, f, there] = classifier.most_probable(
            label_posterior(logs, of_ship, exclude=exclude), true
        )
    return classifier.judged(named, there) | {"probability": probability}


def check(choices: Choices) -> Choices:
    """Refuse other receivers, whose moments nobody knows, and to leave all aspects out."""
    if NAMING.when(choices):
        classifier.check_receiver(choices, NAME)
        classifier.check_left_out(choices)
    return choices


SETTINGS: tuple[type[Settings], ...] = (Likelihood,)
STAGES: tuple[Stage, ...] = (profile_moments, profile_scores, likelihood)
TABLES = NAMING.tables()
