"""The Adaptive Clustering Network, trained without noise and tested on averages of frames.

Tests are averaged range profiles or silhouettes; training presents them in one order or several.
The map of an empty silhouette is zero everywhere and matches no category, so that its answer counts
as wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify.blocks import HELD_ROWS, row_blocks
from ncti.classify.clustering import Clustering, Similarities, cluster, move_categories
from ncti.classify.directions import MAX_PASSES, NO_CATEGORY, unit_vectors
from ncti.evaluate import category_formation
from sweeps.engine.declare.settings import Run, Settings, count, draws, number, switch, word
from sweeps.engine.declare.stage import At, Output, derived, in_memory, inner
from sweeps.engine.resolve.streams import cell_rng
from sweeps.stages import classifier
from sweeps.stages.classifier import (
    GATHERED,
    NO_ANSWER,
    VIEW,
    Indices,
    Integers,
    Mask,
    read_in_blocks,
)
from sweeps.stages.infrared import LOOK, OF_SILHOUETTES, Infrared
from sweeps.stages.views import INFRARED, Arrays, Floats, Grid, Profiles

NAME = "acn"


class Network(Settings, key="classifier", role="coordinate"):
    """The Adaptive Clustering Network."""

    learning_rate = number(0.1, 1e-6, 1, label="learning rate in training")
    max_passes = count(
        MAX_PASSES, 1, 10**6, label="largest number of presentations of the training set", role=""
    )
    learn_in_test = switch(
        False,
        label="learning during the test",
        help="test vectors move categories, as in the article; unknown ships are presented last",
    )
    orders = draws(
        1,
        label="order of presentation of the profiles; 0 is the order of the grid",
        dimension="order",
    )
    label_rule = word(
        "majority",
        ("majority", "first"),
        label="rule that labels a category with a ship: majority, or first of its members",
    )
    score_rule = word(
        "ship",
        ("ship", "category"),
        label="rule that scores an answer: the right ship, or the right category",
        help="views absent from training are scored by ship",
    )


@dataclass(frozen=True)
class TrainingSet:
    """Training views and their similarities, shared by all trainings on them.

    Attributes: similarities of the learned views' vectors; the ascending indices of these views;
    the (ship, aspect) mask of existing views; and the function from profiles or maps to vectors.
    """

    similarities: Similarities
    views: Indices
    valid: Mask
    to_vectors: Callable[[NDArray[Any]], NDArray[Any]]

    @classmethod
    def of_views(
        cls, inputs: NDArray[Any], valid: Mask, training_views: Mask, to_vectors: Callable[..., Any]
    ) -> TrainingSet:
        """Return the training set of (ship, aspect, ...) profiles or maps."""
        flat = inputs.reshape(1, -1, *inputs.shape[2:])
        views = np.flatnonzero(valid & training_views)
        vectors = to_vectors(flat[:, views]).astype(np.float64)
        return cls(Similarities.of(vectors), views, valid, to_vectors)

    def rows_of(self, views: Indices) -> Indices:
        """Return the rows in `similarities` of learned views, given by index."""
        return np.searchsorted(self.views, views)

    def matches(
        self, clusterings: Sequence[Clustering], tests: NDArray[Any], number: int
    ) -> Iterable[tuple[Indices, Floats]]:
        """Return (view,) categories and cosines of (..., view, ...) tests, by clustering.

        The tests are those at index `number` of the first axis, read in blocks.
        """
        count = tests.shape[1]
        category = np.empty((len(clusterings), count), dtype=np.intp)
        cosine = np.empty((len(clusterings), count))
        for rows in row_blocks(count):
            vectors = self.to_vectors(tests[number : number + 1, rows])
            similarities = self.similarities.with_tests(vectors.astype(np.float64))
            for c, clustering in enumerate(clusterings):
                category[c, rows], cosine[c, rows] = clustering.match(similarities)
        return zip(category, cosine, strict=True)

    def reader(self, tests: NDArray[Any], number: int) -> Callable[[Indices], Floats]:
        """Return a function from view indices to (view, feature) vectors, as for `matches`.

        Read a small set of tests once, and keep it in memory for all calls.
        """

        def vectors(views: Indices) -> Floats:
            return self.to_vectors(tests[number : number + 1, views]).astype(np.float64)

        if tests.shape[1] > HELD_ROWS:
            return vectors
        return vectors(np.arange(tests.shape[1])).__getitem__


def presentation_order(views: int, order: int, seed: int) -> Indices:
    """Return an order of presentation of all views: the grid's for 0, else a random one."""
    if order == 0:
        return np.arange(views)
    return cell_rng(seed, stage="presentation_order", order=order).permutation(views)


def form_categories(
    training_set: TrainingSet,
    training_views: Mask,
    presentation: tuple[int, int],
    vigilance: float,
    learning_rate: float,
    max_passes: int,
    label_rule: str,
) -> Arrays:
    """Train with the existing training views, in an order given by its number and seed.

    A category is named after the ship of most members, or of the first member presented.

    Returns
    -------
    dict of str to ndarray
        names : (sample,), ships by category, -1 beyond the last one;
        training_correct : (ship, aspect), 1 where a view's category has its ship's name;
        training_category, training_confused : (ship, aspect), negative outside training;
        passes : (), negative where the categories did not settle;
        weights, lengths : (sample, coordinate) and (sample,) float64, of `Clustering`, zero
        beyond the last category;
        view_order : (view,), the order of presentation
    """
    known = training_views & training_set.valid
    ship, aspect = np.indices(known.shape).reshape(2, -1)
    view_order = presentation_order(known.size, *presentation)
    views = training_set.views
    order = training_set.rows_of(view_order[known.reshape(-1)[view_order]])
    clustering = cluster(
        training_set.similarities,
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
        order=order,
    )
    labels = np.full(known.size, NO_CATEGORY)
    labels[views] = clustering.labels
    formed = category_formation(labels, ship, aspect)
    count, ships = len(clustering.weights), ship[views]
    names = np.full(views.size, NO_ANSWER)
    weights = np.zeros((views.size, clustering.weights.shape[1]))
    lengths = np.zeros(views.size)
    by_first = label_rule == "first"
    names[:count] = (
        clustering.first_labels(ships, order) if by_first else clustering.majority_labels(ships)
    )
    weights[:count], lengths[:count] = clustering.weights, clustering.lengths
    right = category_ships(names, formed.category) == ship.reshape(known.shape)
    return {
        "training_category": formed.category,
        "training_confused": np.where(known, formed.confused, NO_ANSWER),
        "training_correct": np.where(known, right, NO_ANSWER),
        "passes": np.array(clustering.passes if clustering.converged else -clustering.passes),
        "names": names,
        "weights": weights,
        "lengths": lengths,
        "view_order": view_order,
    }


def category_ships(names: Integers, category: Integers) -> Integers:
    """Return the ship of each category; `NO_ANSWER` for a vector without a category."""
    return np.where(category >= 0, names[np.maximum(category, 0)], NO_ANSWER)


def answer_tests(
    training_set: TrainingSet,
    training: Arrays,
    tests: NDArray[Any],
    valid: Mask,
    score_rule: str,
    learn_in_test: bool,
    learning_rate: float,
) -> Arrays:
    """Return the answers of (...) trainings by `form_categories` to (frame_count, ...) tests.

    By the rule `ship` an answer is right if its ship is; by `category`, if its category is the one
    of the same view in training, and views outside training are not scored.

    Returns
    -------
    dict of str to ndarray
        category, similarity (cosine to it), predicted, correct, cell :
        (..., frame_count, ship, aspect)
    """
    lead = training["passes"].shape
    indices = [*np.ndindex(*lead)]
    shape = (*lead, len(tests), *valid.shape)
    answers = {name: np.full(shape, NO_ANSWER) for name in ("category", "predicted", "correct")}
    answers["similarity"] = np.full(shape, np.nan)
    ship = np.indices(valid.shape)[0]
    trainings = [{name: values[index] for name, values in training.items()} for index in indices]
    clusterings = [_clustering(formed) for formed in trainings]
    flat = tests.reshape(len(tests), -1, *tests.shape[3:])
    for f in range(len(flat)):
        if learn_in_test:
            reader = training_set.reader(flat, f)
            matches: Iterable[tuple[Indices, Floats]] = (
                match_learning(training_set, formed, reader, learning_rate) for formed in trainings
            )
        else:
            matches = training_set.matches(clusterings, flat, f)
        for index, formed, (category, cosine) in zip(indices, trainings, matches, strict=True):
            labels = formed["training_category"]
            category = np.where(valid, category.reshape(valid.shape), NO_ANSWER)
            predicted = category_ships(formed["names"], category)
            if score_rule == "ship":
                scored, right = valid, predicted == ship
            else:
                is_training_view = formed["training_confused"] >= 0
                scored = valid & is_training_view
                right = (category == labels) & (category != NO_ANSWER)
            answers["category"][*index, f] = category
            answers["similarity"][*index, f] = np.where(valid, cosine.reshape(valid.shape), np.nan)
            answers["predicted"][*index, f] = predicted
            answers["correct"][*index, f] = np.where(scored, right, NO_ANSWER)
    return answers | {"cell": classifier.answer_state(answers["correct"], valid)}


def _clustering(formed: Arrays) -> Clustering:
    """Return the categories of one training."""
    labels = formed["training_category"]
    count, passes = labels.max() + 1, int(formed["passes"])
    weights, lengths = formed["weights"][:count], formed["lengths"][:count]
    return Clustering(labels.reshape(-1), weights, lengths, abs(passes), passes > 0)


def match_learning(
    training_set: TrainingSet,
    formed: Arrays,
    read_vectors: Callable[[Indices], Floats],
    learning_rate: float,
) -> tuple[Indices, Floats]:
    """Return (view,) categories and cosines of tests that move categories, read in blocks.

    Tests are presented in the order of training, known ships first, so that unknown ships move no
    category before the known ships are matched.
    """
    training_views, view_order = formed["training_confused"] >= 0, formed["view_order"]
    unknown = np.repeat(~training_views.any(axis=1), training_views.shape[1])
    category, similarity = np.empty(len(view_order), dtype=np.intp), np.empty(len(view_order))
    order = view_order[np.argsort(unknown[view_order], kind="stable")]
    directions, lengths = unit_vectors(
        _clustering(formed).category_vectors(training_set.similarities)
    )
    for rows in row_blocks(len(order)):
        matches = move_categories(directions, lengths, read_vectors(order[rows]), learning_rate)
        category[order[rows]], similarity[order[rows]] = matches
    return category, similarity


# Declarations


@in_memory(gather=GATHERED, keep=4, reads=read_in_blocks("expected"))
def profile_training_set(expected: Profiles, valid: Mask, training_views: Mask) -> TrainingSet:
    """Return the training views and similarities of expected profiles, shared by all trainings."""
    return TrainingSet.of_views(expected, valid, training_views, classifier.profile_vectors)


@in_memory(gather=GATHERED, keep=4, reads=read_in_blocks("template_log_polar"))
def silhouette_training_set(
    template_log_polar: NDArray[np.uint8], valid: Mask, training_views: Mask
) -> TrainingSet:
    """Return the training views and similarities of silhouettes, shared by all trainings."""
    return TrainingSet.of_views(template_log_polar, valid, training_views, classifier.map_vectors)


@derived(uses=(Network, Run))
def profile_order(orders: int, seed: int) -> tuple[int, int]:
    """Return the number and seed of an order of presentation; order 0, the grid's own, has none."""
    return orders, seed if orders else 0


silhouette_order = replace(profile_order, name="silhouette_order", uses=(Infrared, Run))


TRAINING_DIMS = ("order", "learning_rate", "vigilance", "label_rule", "score_rule", "learn_in_test")
OF_RANGE = classifier.of_profiles(NAME, *TRAINING_DIMS)
OF_INFRARED = classifier.ClassifierGroup.of_classifier(
    "acn_infrared",
    classifier.classifies_with(NAME, INFRARED),
    (*OF_SILHOUETTES, "phase", *TRAINING_DIMS, *LOOK),
)
RULES = ("label_rule", "score_rule")
PROFILE_READS = {"training_set": "profile_training_set", "presentation": "profile_order"}
acn_training = OF_RANGE.stage(
    Output(
        "training_category", VIEW, "i4", "category of the training view", without=("label_rule",)
    ),
    Output(
        "training_confused",
        VIEW,
        "i1",
        "1 where views of another ship share that category",
        without=("label_rule",),
    ),
    Output(
        "passes",
        (),
        "i4",
        "presentations until the categories settled, negative if they did not",
        without=("label_rule",),
    ),
    Output("training_correct", VIEW, "i1", "1 where that category is labelled with the true ship"),
    inner("names", ("category",), "i2"),
    inner("weights", ("category", "coordinate"), "f8"),
    inner("lengths", ("category",), "f8"),
    inner("view_order", ("view",), "i8"),
    uses=(Grid, Network),
    reads=PROFILE_READS,
    name="acn_training",
)(form_categories)
acn = OF_RANGE.answers(
    Output("category", VIEW, "i4", "category that the test falls into", without=RULES),
    Output("similarity", VIEW, label="cosine similarity to that category", without=RULES),
    without=("score_rule",),
    uses=(Grid, Network),
    reads=PROFILE_READS | {"training": "acn_training", "tests": At("averaged", in_blocks=True)},
    along=(Network.orders, Grid.vigilance, Grid.frame_count),
    name=NAME,
)(answer_tests)

SILHOUETTES: dict[str, Any] = {"group": OF_INFRARED, "uses": (Infrared, Network)}
SILHOUETTE_READS = {"training_set": "silhouette_training_set", "presentation": "silhouette_order"}
acn_infrared_training = replace(
    acn_training, name="acn_infrared_training", reads=SILHOUETTE_READS, **SILHOUETTES
)
acn_infrared = replace(
    acn,
    name="acn_infrared",
    reads=SILHOUETTE_READS
    | {"training": "acn_infrared_training", "tests": At("log_polar", in_blocks=True)},
    along=(Infrared.orders, Infrared.vigilance, Infrared.frame_count),
    **SILHOUETTES,
)
STAGES = (
    profile_training_set,
    silhouette_training_set,
    profile_order,
    silhouette_order,
    acn_training,
    acn,
    acn_infrared_training,
    acn_infrared,
)
TABLES = (
    *OF_RANGE.tables(rejecting=True, forming=True),
    *OF_INFRARED.tables(
        partial(classifier.tabulate_answers, source="silhouettes"),
        rejecting=True,
        forming=True,
        labels={"classifier": NAME, "channel": INFRARED},
    ),
)
