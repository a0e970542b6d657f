"""Maximum likelihood from the exact mean and covariance of range profiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Settings, number
from sweeps.engine.stage import Output, Stage, Table, in_memory, stage
from sweeps.stages.classifier import (
    NONE,
    STATE,
    Classifier,
    check_left_out,
    learned,
    names_by,
    require_another_aspect,
    state,
)
from sweeps.stages.ladar import FULL, Ladar
from sweeps.stages.scores import tabulate_answers
from sweeps.stages.views import RANGE, Grid

if TYPE_CHECKING:
    from ncti.classify.likelihood import GaussianTemplates

Arrays = dict[str, NDArray[Any]]

NAME = "likelihood"
GROUP = "classification/likelihood"
VIEW = ("ship", "aspect")


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
    """Every view that is there as a template.

    Attributes
    ----------
    templates : GaussianTemplates
        Fitted, ships as their labels.
    there : (ship, aspect) bool ndarray
        Views that they are of.
    """

    templates: GaussianTemplates
    there: NDArray[np.bool_]


@in_memory(uses=(Likelihood,), gather=(Grid.ship, Grid.aspect), keep=2)
def profile_moments(
    expected: NDArray[np.float32],
    covariance: NDArray[np.float32],
    there: NDArray[np.bool_],
    nugget: float,
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
    Output("predicted", VIEW, "i2", label="ship named, as an index into the ship axis"),
    Output("correct", VIEW, "i1", label="1 where the answer is right"),
    Output("probability", VIEW, label="posterior probability of the true ship"),
    Output(
        "cell",
        VIEW,
        "i1",
        label=f"state of a cell of {NAME}",
        failed=0,
        group=f"status_{NAME}",
        attrs=STATE,
    ),
    uses=(Grid, Classifier, Likelihood),
    along=(Likelihood.gain_sigma, Classifier.left_out, Grid.frame_count),
    gather=(Grid.ship, Grid.aspect),
    group=GROUP,
    dims=(
        *("pulse_width", "range", "target_free_ifovs"),
        *("gain_sigma", "left_out", "replicate", "frame_count"),
    ),
    when=names_by(NAME, RANGE),
    status="-",
)
def likelihood(
    profile_moments: Moments,
    averaged: NDArray[np.float32],
    there: NDArray[np.bool_],
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
    gain_sigma: tuple[float, ...],
    left_out: tuple[bool, ...],
    frame_count: tuple[int, ...],
) -> Arrays:
    """Return the most probable ship, one number of frames at a time.

    Notes
    -----
    Every view is a template, of a gain as well known as `gain_sigma` says. Where the true aspect
    is left out, templates of all ships at it are.
    """
    moments = profile_moments
    taught = learned(ship, aspect, unknown, training_aspect)
    require_another_aspect(taught & moments.there, left_out)
    untaught = ~taught[moments.there]
    _, of_template = np.nonzero(moments.there)
    true, of_test = np.nonzero(there)
    same = of_test[:, None] == of_template
    whole = (len(gain_sigma), len(left_out), len(frame_count), *there.shape)
    predicted, probability = np.full(whole, NONE), np.full(whole, np.nan)
    for f, count in enumerate(frame_count):
        logs = moments.templates.log_likelihood(averaged[f][there], count, gain_sigma=gain_sigma)
        for g, of_gain in enumerate(logs):
            for k, leave in enumerate(left_out):
                posterior = moments.templates.posterior_of(
                    of_gain, exclude=untaught | (same & leave)
                )
                labels = moments.templates.classes_
                predicted[g, k, f, there] = labels[posterior.argmax(axis=-1)]
                # 0 for a ship that is not learned.
                probability[g, k, f, there] = (posterior * (labels == true[:, None])).sum(axis=-1)
    correct = np.where(there, predicted == np.indices(there.shape)[0], NONE)
    return {
        "predicted": predicted,
        "correct": correct,
        "probability": probability,
        "cell": state(correct, there),
    }


def check(choices: Choices) -> Choices:
    """Refuse other receivers, whose moments nobody knows, and to leave all aspects out.

    Raises
    ------
    ConfigurationError
        Naming the key.
    """
    if names_by(NAME, RANGE)(choices):
        check_receiver(choices, NAME)
        check_left_out(choices)
    return choices


def check_receiver(choices: Choices, name: str) -> None:
    """Refuse receivers whose moments are not known to a classifier.

    Raises
    ------
    ConfigurationError
        Naming the first of them.
    """
    for receiver in choices[Ladar.receiver]:
        if receiver != FULL:
            raise ConfigurationError(
                f"ladar.receiver is {receiver!r}, but must be {FULL} for the classifier {name}, "
                "which knows the moments of no other"
            )


SETTINGS: tuple[type[Settings], ...] = (Likelihood,)
STAGES: tuple[Stage, ...] = (profile_moments, likelihood)
TABLES: tuple[Table, ...] = (
    Table(f"tables/{NAME}", (GROUP,), tabulate_answers, names_by(NAME, RANGE)),
)
