"""The most similar range profile that is learned: nearest neighbour by cosine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Settings, word
from sweeps.engine.stage import Output, Stage, Table, in_memory, stage
from sweeps.stages.classifier import (
    NONE,
    STATE,
    Classifier,
    check_left_out,
    learned,
    names_by,
    profile_vectors,
    require_another_aspect,
    state,
)
from sweeps.stages.rejection import rejection_table
from sweeps.stages.scores import tabulate_answers
from sweeps.stages.views import RANGE, Grid

Arrays = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]

NAME = "correlation"
GROUP = "classification/correlation"
VIEW = ("ship", "aspect")
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
    """Vectors of all draws of averaged profiles.

    Attributes
    ----------
    vectors : (replicate, view, bin) float64 ndarray
        Those of the first ship first; zero where one is not there.
    replicates : tuple of int
        Numbers of the draws.
    """

    vectors: Floats
    replicates: tuple[int, ...]

    def without(self, replicate: int) -> Floats:
        """(replicate, view, bin): the vectors of all other draws."""
        return self.vectors[[number != replicate for number in self.replicates]]


@in_memory(uses=(Grid,), gather=(Grid.replicate, Grid.ship, Grid.aspect), keep=4)
def profile_draws(averaged: NDArray[np.float32], replicate: tuple[int, ...]) -> Draws:
    """Return the vectors of all draws of profiles of as many frames."""
    return Draws(profile_vectors(averaged), replicate)


@stage(
    Output("predicted", VIEW, "i2", label="ship named, as an index into the ship axis"),
    Output("correct", VIEW, "i1", label="1 where the answer is right"),
    Output("similarity", VIEW, label="cosine to the most similar profile learned"),
    Output(
        "cell",
        VIEW,
        "i1",
        label=f"state of a cell of {NAME}",
        failed=0,
        group=f"status_{NAME}",
        attrs=STATE,
    ),
    uses=(Grid, Classifier, Correlation),
    along=(Classifier.left_out,),
    gather=(Grid.ship, Grid.aspect),
    group=GROUP,
    dims=(
        *("pulse_width", "range", "target_free_ifovs"),
        *("training", "left_out", "replicate", "frame_count"),
    ),
    when=names_by(NAME, RANGE),
    status="-",
)
def correlation(
    profile_draws: Draws,
    expected: NDArray[np.float32],
    averaged: NDArray[np.float32],
    there: NDArray[np.bool_],
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    replicate: int,
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
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
    taught = learned(ship, aspect, unknown, training_aspect) & there
    require_another_aspect(taught, left_out)
    lessons = {
        EXPECTED: lambda: profile_vectors(expected)[None],
        NOISY: lambda: profile_draws.without(replicate),
    }
    return match_views(lessons[training](), profile_vectors(averaged), there, taught, left_out)


def match_views(
    lessons: Floats,
    tests: Floats,
    there: NDArray[np.bool_],
    taught: NDArray[np.bool_],
    left_out: tuple[bool, ...],
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
    predicted = np.where(there, named, NONE)
    correct = np.where(there, predicted == ship.reshape(there.shape), NONE)
    return {
        "predicted": predicted,
        "correct": correct,
        "similarity": np.array(cosines),
        "cell": state(correct, there),
    }


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
TABLES: tuple[Table, ...] = (
    Table(f"tables/{NAME}", (GROUP,), tabulate_answers, names_by(NAME, RANGE)),
    rejection_table(NAME, GROUP, names_by(NAME, RANGE)),
)
