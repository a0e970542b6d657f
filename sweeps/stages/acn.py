"""The Adaptive Clustering Network, trained on expected range profiles and tested on averages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify.vigilance_sweep import Similarities
from sweeps.engine.settings import Settings, count, number, switch, word
from sweeps.engine.stage import Output, Stage, Table, in_memory, stage
from sweeps.stages.categories import (
    answer_tests,
    clustering_of,
    form_categories,
    match_learning,
    name_categories,
)
from sweeps.stages.classifier import (
    NONE,
    STATE,
    Classifier,
    learned,
    names_by,
    profile_vectors,
    state,
)
from sweeps.stages.rejection import rejection_table
from sweeps.stages.scores import tabulate_answers
from sweeps.stages.views import RANGE, Grid

Arrays = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]
Places = NDArray[np.intp]

NAME = "acn"
GROUP = "classification/acn"
LABEL_RULES, SCORE_RULES = ("majority", "first"), ("ship", "category")


class Network(Settings, key="classifier"):
    """The Adaptive Clustering Network."""

    learning_rate = number(0.1, 1e-6, 1, label="learning rate in training", noted=True)
    max_passes = count(200, 1, 1_000_000, label="presentations of the training set at most")
    learn_in_test = switch(
        False,
        label="1 where test vectors move categories, too",
        help="as in the source; those of unknown ships come last",
    )
    label_rule = word(
        "majority",
        LABEL_RULES,
        label="how a category gets its ship: most, or first of its members",
        noted=True,
    )
    score_rule = word(
        "ship",
        SCORE_RULES,
        label="what is right: the ship, or the category of the same view",
        help="of views that are not learned, only the ship is asked for",
        noted=True,
    )


@dataclass(frozen=True)
class Lessons:
    """What all trainings with the same vectors share.

    Attributes
    ----------
    vectors : (view, feature) float64 ndarray
        Training vectors, those of the first ship first; zero where a view is not there.
    similarities : Similarities
        Of these.
    there : (ship, aspect) bool ndarray
        Views that are there.
    """

    vectors: Floats
    similarities: Similarities
    there: NDArray[np.bool_]

    @property
    def order(self) -> Places:
        """(view,): the grid's own order of presentation."""
        return np.arange(self.there.size)


@in_memory(gather=(Grid.ship, Grid.aspect), keep=4)
def profile_lessons(expected: NDArray[np.float32], there: NDArray[np.bool_]) -> Lessons:
    """Return what all trainings with expected profiles share."""
    training = profile_vectors(expected)
    return Lessons(training, Similarities.of(training), there)


@stage(
    Output("training_category", ("ship", "aspect"), "i4", label="category of the expected profile"),
    Output(
        "training_confused",
        ("ship", "aspect"),
        "i1",
        label="1 where views of another ship share that category",
    ),
    Output(
        "passes",
        dtype="i4",
        fill=0,
        label="presentations until the categories settled, negative if they did not",
    ),
    Output("weights", ("category", "view"), "f8", stored=False),
    uses=(Grid, Classifier, Network),
    gather=(Grid.ship, Grid.aspect),
    group=GROUP,
    dims=("pulse_width", "range", "target_free_ifovs", "learning_rate", "vigilance"),
    when=names_by(NAME, RANGE),
    status="-",
)
def acn_training(
    profile_lessons: Lessons,
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
    vigilance: float,
    learning_rate: float,
    max_passes: int,
) -> Arrays:
    """Return the categories that expected profiles form."""
    return form_categories(
        profile_lessons.similarities,
        learned(ship, aspect, unknown, training_aspect) & profile_lessons.there,
        profile_lessons.order,
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
    )


@stage(
    Output(
        "training_correct",
        ("ship", "aspect"),
        "i1",
        label="1 where that category has the ship's name",
    ),
    Output("names", ("category",), "i2", stored=False),
    uses=(Network,),
    group=GROUP,
    dims=("pulse_width", "range", "target_free_ifovs", "learning_rate", "vigilance", "label_rule"),
    when=names_by(NAME, RANGE),
    status="-",
)
def acn_names(acn_training: Arrays, label_rule: str) -> Arrays:
    """Return the ship of every category, and whether it is the right one."""
    order = np.arange(acn_training["training_category"].size)
    names, correct = name_categories(acn_training, order, label_rule)
    return {"training_correct": correct, "names": names}


@stage(
    Output(
        "category",
        ("ship", "aspect"),
        "i4",
        label="category that the averaged profile falls into",
        without=("label_rule", "score_rule"),
    ),
    Output(
        "similarity",
        ("ship", "aspect"),
        "f4",
        label="cosine to that category",
        without=("label_rule", "score_rule"),
    ),
    Output(
        "predicted",
        ("ship", "aspect"),
        "i2",
        label="ship named, as an index into the ship axis",
        without=("score_rule",),
    ),
    Output("correct", ("ship", "aspect"), "i1", label="1 where the answer is right"),
    Output(
        "cell",
        ("ship", "aspect"),
        "i1",
        label="state of a cell of the grid",
        failed=0,
        group="status",
        attrs=STATE,
    ),
    uses=(Grid, Network),
    along=(Grid.vigilance, Grid.frame_count, Network.label_rule, Network.score_rule),
    gather=(Grid.ship, Grid.aspect),
    group=GROUP,
    dims=(
        *("pulse_width", "range", "target_free_ifovs", "learning_rate", "vigilance"),
        *("label_rule", "score_rule", "replicate", "frame_count"),
    ),
    when=names_by(NAME, RANGE),
    status="-",
)
def acn(
    profile_lessons: Lessons,
    acn_training: Arrays,
    acn_names: Arrays,
    averaged: NDArray[np.float32],
    there: NDArray[np.bool_],
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    vigilance: tuple[float, ...],
    frame_count: tuple[int, ...],
    label_rule: tuple[str, ...],
    score_rule: tuple[str, ...],
    learning_rate: float,
    max_passes: int,
    learn_in_test: bool,
) -> Arrays:
    """Return what averaged profiles are named, one number of frames and vigilance at a time."""
    whole = (len(vigilance), len(frame_count), len(label_rule), len(score_rule), *there.shape)
    answers: Arrays = {
        "category": np.full(whole, NONE),
        "similarity": np.full(whole, np.nan),
        "predicted": np.full(whole, NONE),
        "correct": np.full(whole, NONE),
    }
    for f in range(len(frame_count)):
        tests = profile_vectors(averaged[f])
        seen = profile_lessons.similarities.to(tests)
        for v, level in enumerate(vigilance):
            formed = {name: values[v] for name, values in acn_training.items()}
            if learn_in_test:
                category, cosine = match_learning(
                    profile_lessons.vectors,
                    tests,
                    formed["training_confused"] >= 0,
                    profile_lessons.order,
                    vigilance=level,
                    learning_rate=learning_rate,
                    max_passes=max_passes,
                )
            else:
                category, cosine = clustering_of(formed).match(seen)
            category = category.reshape(there.shape)
            answers["category"][v, f] = np.where(there, category, NONE)
            answers["similarity"][v, f] = np.where(there, cosine.reshape(there.shape), np.nan)
            for k in range(len(label_rule)):
                names = acn_names["names"][v, k]
                predicted, correct = answer_tests(category, there, formed, names, score_rule)
                answers["predicted"][v, f, k] = predicted
                answers["correct"][v, f, k] = correct
    return answers | {"cell": state(answers["correct"], there)}


SETTINGS: tuple[type[Settings], ...] = (Network,)
STAGES: tuple[Stage, ...] = (profile_lessons, acn_training, acn_names, acn)
TABLES: tuple[Table, ...] = (
    Table("tables/acn", (GROUP,), tabulate_answers, names_by(NAME, RANGE)),
    rejection_table(NAME, GROUP, names_by(NAME, RANGE)),
)
