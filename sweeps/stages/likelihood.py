"""Maximum likelihood from the exact mean and covariance of range profiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.classify.fusion import label_posterior
from sweeps.engine.settings import Choices, Settings, number
from sweeps.engine.stage import Output, Stage, in_memory, stage
from sweeps.stages.classifier import (
    GATHERED,
    NONE,
    OF_PROFILES,
    VIEW,
    Arrays,
    Classifier,
    Views,
    answers,
    check_left_out,
    check_receiver,
    judged,
    most_probable,
    names_by,
    require_another_aspect,
    tables_of,
)
from sweeps.stages.views import RANGE, Grid

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

NAME = "likelihood"


class Likelihood(Settings, key="classifier"):
    """What is known beforehand of profiles."""

    gain_sigma = number(
        1.0,
        0,
        1000,
        label="prior standard deviation of the target's gain",
        help="0: it is known",
        noted=True,
    )
    nugget = number(
        1e-3, 1e-9, 1000, label="noise allowed for besides the model's, over its variance"
    )


@dataclass(frozen=True)
class Moments:
    """Templates of all (ship, aspect) views that are there."""

    templates: GaussianTemplates
    there: Views


@in_memory(uses=(Likelihood,), gather=GATHERED, keep=2)
def profile_moments(
    expected: NDArray[np.float32], covariance: NDArray[np.float32], there: Views, nugget: float
) -> Moments:
    """Return templates of all views.

    Their floor, which the target's gain leaves alone, is what the window's edge holds: noise, the
    ship's own IFOVs' among it.
    """
    # Imported where it is used: scikit-learn takes a second.
    from ncti.classify.likelihood import GaussianTemplates

    means = expected[there]
    templates = GaussianTemplates(nugget=nugget)
    templates.fit(means, covariance[there], np.nonzero(there)[0], floor=means[:, :1])
    return Moments(templates, there)


@stage(
    Output("profile_scores", ("view", "template"), "f8"),
    uses=(Grid, Likelihood),
    along=(Likelihood.gain_sigma, Grid.frame_count),
    gather=GATHERED,
)
def profile_scores(
    profile_moments: Moments,
    averaged: NDArray[np.float32],
    there: Views,
    gain_sigma: tuple[float, ...],
    frame_count: tuple[int, ...],
) -> NDArray[np.float64]:
    """(gain_sigma, frame_count, view, template): log-likelihoods, NaN where a view is not there.

    Every view is a template, of a gain as well known as `gain_sigma` says.
    """
    views, known = there.reshape(-1), profile_moments.there.reshape(-1)
    scores = np.full((len(gain_sigma), len(frame_count), views.size, views.size), np.nan)
    for f, count in enumerate(frame_count):
        logs = profile_moments.templates.log_likelihood(
            averaged[f][there], count, gain_sigma=gain_sigma
        )
        scores[:, f, views[:, None] & known] = logs.reshape(len(gain_sigma), -1)
    return scores


@stage(
    *answers(
        NAME,
        f"status_{NAME}",
        Output("probability", VIEW, label="posterior probability of the true ship"),
    ),
    uses=(Grid, Classifier, Likelihood),
    along=(Likelihood.gain_sigma, Classifier.left_out, Grid.frame_count),
    gather=GATHERED,
    group=f"classification/{NAME}",
    dims=(*OF_PROFILES, "gain_sigma", "left_out", "replicate", "frame_count"),
    when=names_by(NAME, RANGE),
    status="-",
)
def likelihood(
    profile_scores: NDArray[np.float64],
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
    require_another_aspect(taught & known, left_out)
    (true, of_view), (of_ship, of_template) = np.nonzero(there), np.nonzero(known)
    untaught, same = ~taught[known], of_view[:, None] == of_template
    whole = (len(profile_scores), len(left_out), profile_scores.shape[1], *shape)
    named, probability = np.full(whole, NONE), np.full(whole, np.nan)
    for g, k, f in np.ndindex(whole[:3]):
        logs = profile_scores[g, f, scored].reshape(true.size, -1)
        exclude = untaught | (same & left_out[k])
        named[g, k, f, there], probability[g, k, f, there] = most_probable(
            label_posterior(logs, of_ship, exclude=exclude), true
        )
    return judged(named, there) | {"probability": probability}


def check(choices: Choices) -> Choices:
    """Refuse other receivers, whose moments nobody knows, and to leave all aspects out."""
    if names_by(NAME, RANGE)(choices):
        check_receiver(choices, NAME)
        check_left_out(choices)
    return choices


SETTINGS: tuple[type[Settings], ...] = (Likelihood,)
STAGES: tuple[Stage, ...] = (profile_moments, profile_scores, likelihood)
TABLES = tables_of(NAME, names_by(NAME, RANGE))
