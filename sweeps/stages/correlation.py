"""Correlation with the training profiles: nearest neighbour by cosine."""

from __future__ import annotations

import numpy as np

from sweeps.engine.settings import Choices, Settings, word
from sweeps.engine.stage import Output, in_memory
from sweeps.stages import classifier
from sweeps.stages.classifier import NONE, Classifier, Views
from sweeps.stages.views import Arrays, Floats, Grid, Profiles, refuse

IMPORTS = ("ncti.classify.baselines",)  # by its stages, when they are called; takes long
NAME = "correlation"
ANSWERS = classifier.of_profiles(NAME, "training", "left_out")
EXPECTED, NOISY = "expected", "noisy"


class Correlation(Settings, key="classifier", noted=True):
    """Nearest neighbour by correlation."""

    training = word(
        EXPECTED,
        (EXPECTED, NOISY),
        label="training profiles: expected ones, or other draws of noisy ones",
        help="used by correlation; noisy needs grid.replicate of 2 or more",
    )


@in_memory(gather=(Grid.replicate, *classifier.GATHERED), keep=4)
def profile_draws(averaged: Profiles) -> Floats:
    """Return (replicate, view, bin) vectors of all draws of profiles of as many frames."""
    return classifier.profile_vectors(averaged)


@ANSWERS.answers(
    Output("similarity", classifier.VIEW, label="cosine similarity to the nearest profile"),
    uses=(Grid, Classifier, Correlation),
)
def correlation(
    profile_draws: Floats,
    training_views: Views,
    expected: Profiles,
    averaged: Profiles,
    valid: Views,
    replicate: int,
    training: str,
    left_out: bool,
) -> Arrays:
    """Return the ship of the most similar training profile.

    Notes
    -----
    Similarity is the cosine of profile vectors. Of noisy profiles those of all other replicates
    of the same number of frames are learned. Where the true aspect is left out, profiles of all
    ships at it are. A profile that nowhere rises above its floor has no direction: it names no
    ship, which counts as wrong, and as a training profile it matches none.
    """
    known = training_views & valid
    classifier.require_another_aspect(known, left_out)
    if training == NOISY:
        training_set = np.delete(profile_draws, replicate, axis=0)
    else:
        training_set = classifier.profile_vectors(expected)[None]
    return match_views(training_set, classifier.profile_vectors(averaged), valid, known, left_out)


def match_views(
    training_set: Floats,
    tests: Floats,
    valid: Views,
    training_views: Views,
    left_out: bool,
) -> Arrays:
    """Return the ship of the training vector most similar to each test, (ship, aspect).

    The training set is (draw, view, bin) vectors of all views, zero where one is missing, and tests
    are (view, bin) ones; templates of a test's own aspect may be left out.
    """
    # Imported here because scikit-learn takes a second.
    from ncti.classify.baselines import NO_TEMPLATE, CorrelationNeighbour

    ship, aspect = np.indices(valid.shape).reshape(2, -1)
    vectors = training_set.reshape(-1, training_set.shape[-1])
    # View of each training vector.
    view = np.tile(np.arange(valid.size), len(training_set))
    untrained = ~training_views.reshape(-1)[view]
    same = (aspect[:, None] == aspect[view]) & left_out
    neighbour = CorrelationNeighbour().fit(vectors, ship[view])
    best, cosine = neighbour.match(tests, exclude=untrained | same)
    named = np.where(best == NO_TEMPLATE, NONE, ship[view[best]]).reshape(valid.shape)
    similarity = np.where(valid, cosine.reshape(valid.shape), np.nan)
    return classifier.judged(named, valid) | {"similarity": similarity}


def check(choices: Choices) -> Choices:
    """Refuse training on the test noise, and leaving all aspects out."""
    if ANSWERS.when(choices):
        replicates = len(choices[Grid.replicate])
        if NOISY in choices[Correlation.training] and replicates < 2:
            learned = "classifier.training has noisy: what is learned must not be what is tested"
            refuse(Grid.replicate, replicates, f"at least 2 where {learned}")
        classifier.check_left_out(choices)
    return choices


TABLES = ANSWERS.tables(rejecting=True)
