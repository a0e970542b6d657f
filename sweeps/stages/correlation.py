"""Correlation with the training profiles: nearest neighbour by cosine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ncti.classify.blocks import row_blocks
from sweeps.engine.declare.settings import Choices, Settings, word
from sweeps.engine.declare.stage import Output, in_memory
from sweeps.stages import classifier
from sweeps.stages.classifier import NO_ANSWER, Classifier, Indices, Mask
from sweeps.stages.refusals import refuse
from sweeps.stages.views import Arrays, Floats, Grid, Profiles

IMPORTS = ("ncti.classify.baselines",)
NAME = "correlation"
ANSWERS = classifier.of_profiles(NAME, "training", "left_out")
EXPECTED, NOISY = "expected", "noisy"


class Correlation(Settings, key="classifier", role="coordinate"):
    """Nearest neighbour by correlation."""

    training = word(
        EXPECTED,
        (EXPECTED, NOISY),
        label="training profiles: expected ones, or other draws of noisy ones",
        help="used by correlation; noisy needs grid.replicate of 2 or more",
    )


@in_memory(
    uses=(Correlation,),
    gather=(Grid.replicate, *classifier.GATHERED),
    reads=classifier.read_in_blocks("averaged"),
    keep=4,
)
def profile_draws(averaged: Profiles, valid: Mask, training: str) -> Profiles | Floats:
    """Return (replicate, view, bin) averaged profiles for noisy training, else an empty array.

    Missing profiles are zero.
    """
    draws = classifier.stack_views(averaged)
    if training != NOISY:
        return draws[:0].copy()  # a copy, so that the others can be freed
    missing = ~valid.reshape(len(valid), -1)
    return np.where(missing[..., None], 0, draws[:]) if missing.any() else draws[:]


@ANSWERS.answers(
    Output("similarity", classifier.VIEW, label="cosine similarity to the nearest profile"),
    uses=(Grid, Classifier, Correlation),
    reads=classifier.read_in_blocks("expected", "averaged"),
)
def correlation(
    profile_draws: Profiles | Floats,
    training_views: Mask,
    expected: Profiles,
    averaged: Profiles,
    valid: Mask,
    replicate: int,
    training: str,
    left_out: bool,
) -> Arrays:
    """Return the ship of the most similar training profile.

    Notes
    -----
    Similarity is the cosine of profile vectors. Noisy training learns the profiles of all other
    replicates with the same number of frames. If the true aspect is left out, exclude the profiles
    of all ships at that aspect. A profile that nowhere rises above its floor has no direction: as a
    test it names no ship and counts as wrong, and as a training profile it never matches.
    """
    known = training_views & valid
    classifier.require_another_aspect(known, left_out)
    if training == NOISY:
        training_set = np.delete(profile_draws, replicate, axis=0)
    else:
        training_set = expected.reshape(1, -1, expected.shape[-1])
    tests = classifier.stack_views(averaged)
    return match_views(training_set, tests, valid, known, left_out, classifier.to_vectors)


def match_views(
    training_set: Profiles | Floats,
    tests: Profiles | Floats,
    valid: Mask,
    training_views: Mask,
    left_out: bool,
    to_vectors: Callable[[Profiles | Floats], Floats] = np.asarray,
) -> Arrays:
    """Return the ship of the training vector most similar to each test, (ship, aspect).

    The training set is (draw, view, bin) vectors of all views, zero for missing ones, and tests are
    (view, bin) vectors; or `to_vectors` converts both, block by block. `left_out` excludes
    templates of a test's own aspect.
    """
    from ncti.classify.baselines import NO_TEMPLATE, CorrelationNeighbour

    ship, aspect = np.indices(valid.shape).reshape(2, -1)

    def templates_of(views: Indices) -> Floats:
        return to_vectors(training_set[:, views].reshape(-1, training_set.shape[-1]))

    # Compare with learned views only. If all are zero, take all views: none matches.
    views = np.flatnonzero(training_views)
    templates = templates_of(views)
    if not templates.any():
        views = np.arange(valid.size)
        templates = templates_of(views)
    # View of each template.
    view = np.tile(views, len(training_set))
    neighbour = CorrelationNeighbour().fit(templates, ship[view])
    untrained = ~training_views.reshape(-1)[view]
    best, cosine = np.empty(len(tests), dtype=np.intp), np.empty(len(tests))
    for rows in row_blocks(len(tests)):
        same_aspect = (aspect[rows, None] == aspect[view]) if left_out else np.False_
        best[rows], cosine[rows] = neighbour.match(
            to_vectors(tests[rows]), exclude=untrained | same_aspect
        )
    predicted = np.where(best == NO_TEMPLATE, NO_ANSWER, ship[view[best]]).reshape(valid.shape)
    similarity = np.where(valid, cosine.reshape(valid.shape), np.nan)
    return classifier.mark_answers(predicted, valid) | {"similarity": similarity}


def check(choices: Choices) -> None:
    """Refuse training on the test noise, and leaving all aspects out."""
    if ANSWERS.when(choices):
        replicates = len(choices[Grid.replicate])
        if NOISY in choices[Correlation.training] and replicates < 2:
            learned = "classifier.training has noisy: what is learned must not be what is tested"
            refuse(Grid.replicate, replicates, f"at least 2 where {learned}")
        classifier.check_left_out(choices)


STAGES = (
    profile_draws,
    correlation,
)
TABLES = ANSWERS.tables(rejecting=True)
