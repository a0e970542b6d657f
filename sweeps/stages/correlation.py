"""Correlation with the training profiles: nearest neighbour by cosine."""

from __future__ import annotations

import numpy as np

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Settings, word
from sweeps.engine.stage import Output, Stage, in_memory
from sweeps.stages import classifier
from sweeps.stages.classifier import NONE, Arrays, Classifier, Floats, Naming, Profiles, Views
from sweeps.stages.views import RANGE, Grid

IMPORTS = ("ncti.classify.baselines",)  # by its stages, when they are called; takes long
NAME = "correlation"
NAMING = Naming(NAME, classifier.names_by(NAME, RANGE))
EXPECTED, NOISY = "expected", "noisy"


class Correlation(Settings, key="classifier"):
    """Nearest neighbour by correlation."""

    training = word(
        EXPECTED,
        (EXPECTED, NOISY),
        label="training profiles: expected ones, or other draws of noisy ones",
        help="used by correlation; noisy needs grid.replicate of 2 or more",
        noted=True,
    )


@in_memory(gather=(Grid.replicate, *classifier.GATHERED), keep=4)
def profile_draws(averaged: Profiles) -> Floats:
    """Return (replicate, view, bin) vectors of all draws of profiles of as many frames."""
    return classifier.profile_vectors(averaged)


@NAMING.answers(
    Output(
        "similarity", classifier.VIEW, label="cosine similarity to the nearest training profile"
    ),
    uses=(Grid, Classifier, Correlation),
    along=(Classifier.left_out,),
    dims=(
        *classifier.OF_PROFILES,
        "training",
        "left_out",
        "replicate",
        "ifov_phase",
        "frame_count",
    ),
)
def correlation(
    profile_draws: Floats,
    training_views: Views,
    expected: Profiles,
    averaged: Profiles,
    there: Views,
    replicate: int,
    training: str,
    left_out: tuple[bool, ...],
) -> Arrays:
    """Return the ship of the most similar training profile.

    Notes
    -----
    Similarity is the cosine of profile vectors. Of noisy profiles those of all other replicates
    of the same number of frames are learned. Where the true aspect is left out, profiles of all
    ships at it are. A profile that nowhere rises above its floor has no direction: it names no
    ship, which counts as wrong, and as a training profile it matches none.
    """
    known = training_views & there
    classifier.require_another_aspect(known, left_out)
    if training == NOISY:
        lessons = np.delete(profile_draws, replicate, axis=0)
    else:
        lessons = classifier.profile_vectors(expected)[None]
    return match_views(lessons, classifier.profile_vectors(averaged), there, known, left_out)


def match_views(
    lessons: Floats, tests: Floats, there: Views, training_views: Views, left_out: tuple[bool, ...]
) -> Arrays:
    """Return the ship of the training vector most similar to each test, (left_out, ship, aspect).

    Lessons are (draw, view, bin) vectors of all views, zero where one is not there, and tests
    (view, bin) ones; lessons of a test's own aspect may be left out.
    """
    # Imported here because scikit-learn takes a second.
    from ncti.classify.baselines import NO_TEMPLATE, CorrelationNeighbour

    ship, aspect = np.indices(there.shape).reshape(2, -1)
    known, of_lesson = np.tile(ship, len(lessons)), np.tile(aspect, len(lessons))
    neighbour = CorrelationNeighbour().fit(lessons.reshape(-1, lessons.shape[-1]), known)
    untrained = np.tile(~training_views.reshape(-1), len(lessons))
    same = aspect[:, None] == of_lesson
    named, cosines = [], []
    for leave in left_out:
        best, cosine = neighbour.match(tests, exclude=untrained | (same & leave))
        named.append(np.where(best == NO_TEMPLATE, NONE, known[best]).reshape(there.shape))
        cosines.append(np.where(there, cosine.reshape(there.shape), np.nan))
    return classifier.judged(np.array(named), there) | {"similarity": np.array(cosines)}


def check(choices: Choices) -> Choices:
    """Refuse training on the test noise, and leaving all aspects out."""
    if NAMING.when(choices):
        replicates = len(choices[Grid.replicate])
        if NOISY in choices[Correlation.training] and replicates < 2:
            raise ConfigurationError(
                f"grid.replicate is {replicates}, but must be at least 2 where "
                "classifier.training has noisy: what is learned must not be what is tested"
            )
        classifier.check_left_out(choices)
    return choices


SETTINGS: tuple[type[Settings], ...] = (Correlation,)
STAGES: tuple[Stage, ...] = (profile_draws, correlation)
TABLES = NAMING.tables(rejecting=True)
