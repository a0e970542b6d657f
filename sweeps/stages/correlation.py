"""The most similar range profile that is learned: nearest neighbour by cosine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Settings, word
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
    judged,
    names_by,
    profile_vectors,
    require_another_aspect,
    tables_of,
)
from sweeps.stages.views import RANGE, Grid

Floats = NDArray[np.float64]

NAME = "correlation"
EXPECTED, NOISY = "expected", "noisy"


class Correlation(Settings, key="classifier"):
    """Nearest neighbour by correlation."""

    training = word(
        EXPECTED,
        (EXPECTED, NOISY),
        label="what is learned: expected profiles, or other draws of noisy ones",
        help="of correlation; noisy needs grid.replicate of 2 or more",
        noted=True,
    )


@dataclass(frozen=True)
class Draws:
    """(replicate, view, bin) vectors of all draws of averaged profiles, and their numbers."""

    vectors: Floats
    replicates: tuple[int, ...]

    def without(self, replicate: int) -> Floats:
        """(replicate, view, bin): the vectors of all other draws."""
        return self.vectors[[number != replicate for number in self.replicates]]


@in_memory(uses=(Grid,), gather=(Grid.replicate, *GATHERED), keep=4)
def profile_draws(averaged: NDArray[np.float32], replicate: tuple[int, ...]) -> Draws:
    """Return the vectors of all draws of profiles of as many frames."""
    return Draws(profile_vectors(averaged), replicate)


@stage(
    *answers(
        NAME,
        f"status_{NAME}",
        Output("similarity", VIEW, label="cosine to the most similar profile learned"),
    ),
    uses=(Grid, Classifier, Correlation),
    along=(Classifier.left_out,),
    gather=GATHERED,
    group=f"classification/{NAME}",
    dims=(*OF_PROFILES, "training", "left_out", "replicate", "frame_count"),
    when=names_by(NAME, RANGE),
    status="-",
)
def correlation(
    profile_draws: Draws,
    taught: Views,
    expected: NDArray[np.float32],
    averaged: NDArray[np.float32],
    there: Views,
    replicate: int,
    training: str,
    left_out: tuple[bool, ...],
) -> Arrays:
    """Return the ship of the most similar profile that is learned.

    Notes
    -----
    Similarity is the cosine of profile vectors. Of noisy profiles those of all other replicates
    of the same number of frames are learned. Where the true aspect is left out, profiles of all
    ships at it are. A profile that nowhere rises above its floor has no direction: it names no
    ship, which counts as wrong, and what is learned of it answers for none.
    """
    known = taught & there
    require_another_aspect(known, left_out)
    noisy = training == NOISY
    lessons = profile_draws.without(replicate) if noisy else profile_vectors(expected)[None]
    return match_views(lessons, profile_vectors(averaged), there, known, left_out)


def match_views(
    lessons: Floats, tests: Floats, there: Views, taught: Views, left_out: tuple[bool, ...]
) -> Arrays:
    """Name the ship of the lesson that is most similar to each test.

    Parameters
    ----------
    lessons : (draw, view, bin) float64 ndarray
        Vectors to learn, of all views, zero where one is not there.
    tests : (view, bin) float64 ndarray
        Vectors to name.
    there, taught : (ship, aspect) bool ndarray
        Views that are there, and those that are learned.
    left_out : tuple of bool
        Whether lessons of a test's own aspect are left out.

    Returns
    -------
    dict of str to ndarray
        predicted, correct, similarity, cell : (left_out, ship, aspect)
    """
    # Imported where it is used: scikit-learn takes a second.
    from ncti.classify.baselines import NO_TEMPLATE, CorrelationNeighbour

    ship, aspect = np.indices(there.shape).reshape(2, -1)
    known, of_lesson = np.tile(ship, len(lessons)), np.tile(aspect, len(lessons))
    neighbour = CorrelationNeighbour().fit(lessons.reshape(-1, lessons.shape[-1]), known)
    untaught = np.tile(~taught.reshape(-1), len(lessons))
    same = aspect[:, None] == of_lesson
    named, cosines = [], []
    for leave in left_out:
        best, cosine = neighbour.match(tests, exclude=untaught | (same & leave))
        named.append(np.where(best == NO_TEMPLATE, NONE, known[best]).reshape(there.shape))
        cosines.append(np.where(there, cosine.reshape(there.shape), np.nan))
    return judged(np.array(named), there) | {"similarity": np.array(cosines)}


def check(choices: Choices) -> Choices:
    """Refuse to learn the noise that is tested, and to leave all aspects out.

    Raises
    ------
    ConfigurationError
        Naming the key.
    """
    if names_by(NAME, RANGE)(choices):
        replicates = len(choices[Grid.replicate])
        if NOISY in choices[Correlation.training] and replicates < 2:
            raise ConfigurationError(
                f"grid.replicate is {replicates}, but must be at least 2 where "
                "classifier.training has noisy: what is learned must not be what is tested"
            )
        check_left_out(choices)
    return choices


SETTINGS: tuple[type[Settings], ...] = (Correlation,)
STAGES: tuple[Stage, ...] = (profile_draws, correlation)
TABLES = tables_of(NAME, names_by(NAME, RANGE), rejecting=True)
