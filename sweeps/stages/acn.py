"""The Adaptive Clustering Network, trained without noise and tested on averages of frames.

Of the laser radar these are range profiles, of the infrared imager silhouettes, both presented in
one order or several. The map of an empty silhouette is zero everywhere,
matches no category and so names no ship, which counts as wrong.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify.vigilance_sweep import Clustering, Similarities, cluster
from ncti.evaluate import category_formation
from sweeps.engine.seeds import cell_rng
from sweeps.engine.settings import Run, Settings, count, draws, number, switch, word
from sweeps.engine.stage import Output, in_memory, inner, plain
from sweeps.stages import classifier
from sweeps.stages.classifier import GATHERED, NONE, VIEW, Ships, Views
from sweeps.stages.infrared import LOOK, OF_SILHOUETTES, Infrared
from sweeps.stages.views import INFRARED, RANGE, Arrays, Floats, Grid, Profiles

if TYPE_CHECKING:
    from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork

NAME = "acn"
IMPORTS = ("ncti.classify.adaptive_clustering",)  # by its stages, when they are called; takes long
Indices = NDArray[np.intp]


class Network(Settings, key="classifier", noted=True):
    """The Adaptive Clustering Network."""

    learning_rate = number(0.1, 1e-6, 1, label="learning rate in training")
    max_passes = count(
        200, 1, 10**6, label="largest number of presentations of the training set", noted=False
    )
    learn_in_test = switch(
        False,
        label="learning during the test",
        help="test vectors move categories, as in the source; unknown ships are presented last",
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

    (view, feature) vectors, zero for missing views, with their similarities; the (ship,
    aspect) mask of existing views; and the function from profiles or maps to vectors.
    """

    vectors: Floats
    similarities: Similarities
    valid: Views
    see: Callable[[NDArray[Any]], NDArray[Any]]

    @classmethod
    def of(cls, seen: NDArray[Any], valid: Views, see: Callable[..., NDArray[Any]]) -> TrainingSet:
        """Return the training set of (ship, aspect, ...) profiles or maps."""
        vectors = see(seen).astype(np.float64)
        return cls(vectors, Similarities.of(vectors), valid, see)


def presentation_order(views: int, order: int, seed: int) -> Indices:
    """Return an order of presentation of all views: the grid's own, or of a number from 1 on."""
    if order == 0:
        return np.arange(views)
    return cell_rng(seed, stage="presentation_order", order=order).permutation(views)


def form_categories(
    training_set: TrainingSet,
    training_views: Views,
    presentation: tuple[int, int],
    vigilance: float,
    learning_rate: float,
    max_passes: int,
    label_rule: str,
) -> Arrays:
    """Train with the existing training views, in the order of presentation of a number and seed.

    A category has the name of the ship of most members, or of the first one presented.

    Returns
    -------
    dict of str to ndarray
        names : (view,), ships by category, -1 beyond the last one;
        training_correct : (ship, aspect), 1 where a view's category has its ship's name;
        training_category, training_confused : (ship, aspect), negative outside training;
        passes : (), negative where the categories did not settle;
        weights : (view, view) float64, a row a category, zero below the last of them;
        turn : (view,), the order of all views; taught_by : vigilance, learning rate, passes
    """
    known = training_views & training_set.valid
    ship, aspect = np.indices(known.shape).reshape(2, -1)
    turn = presentation_order(known.size, *presentation)
    found = cluster(
        training_set.similarities,
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
        order=turn[known.reshape(-1)[turn]],
    )
    formed = category_formation(found.labels, ship, aspect)
    count = len(found.weights)
    names, weights = np.full(known.size, NONE), np.zeros((known.size, known.size))
    by_first = label_rule == "first"
    names[:count] = found.first_names(ship, turn) if by_first else found.names(ship)
    weights[:count] = found.weights
    right = ships_named(names, formed.category) == ship.reshape(known.shape)
    return {
        "training_category": formed.category,
        "training_confused": np.where(known, formed.confused, NONE),
        "training_correct": np.where(known, right, NONE),
        "passes": np.array(found.passes if found.converged else -found.passes),
        "names": names,
        "weights": weights,
        "turn": turn,
        "taught_by": np.array([vigilance, learning_rate, max_passes]),
    }


def ships_named(names: Ships, category: Ships) -> Ships:
    """Return the ship of each category; `NONE` for a vector without a category."""
    return np.where(category >= 0, names[np.maximum(category, 0)], NONE)


def answer_tests(
    training_set: TrainingSet,
    training: Arrays,
    tests: NDArray[Any],
    valid: Views,
    score_rule: str,
    learn_in_test: bool,
) -> Arrays:
    """Return the answers of (...) trainings, as of `form_categories`, to (frame_count, ...) tests.

    By the rule `ship` the ship must be right; by `category` the category must be that of the same
    view, and views outside training are not asked for.

    Returns
    -------
    dict of str to ndarray
        category, similarity (cosine to it), predicted, correct, cell :
        (..., frame_count, ship, aspect)
    """
    lead = training["passes"].shape
    whole = (*lead, len(tests), *valid.shape)
    answers = {name: np.full(whole, NONE) for name in ("category", "predicted", "correct")}
    answers["similarity"] = np.full(whole, np.nan)
    ship = np.indices(valid.shape)[0]
    shown = [training_set.see(seen).astype(np.float64) for seen in tests]
    similarities = [training_set.similarities.to(vectors) for vectors in shown]
    for at in np.ndindex(*lead):
        formed = {name: values[at] for name, values in training.items()}
        taught, labels = formed["training_confused"] >= 0, formed["training_category"]
        weights = formed["weights"][: labels.max() + 1]
        clustering = Clustering(labels.reshape(-1), weights, int(abs(formed["passes"])), True)
        network = network_of(training_set.vectors, formed) if learn_in_test else None
        for f, vectors in enumerate(shown):
            if network is None:
                category, cosine = clustering.match(similarities[f])
            else:
                category, cosine = match_learning(network, vectors, formed)
            category = np.where(valid, category.reshape(valid.shape), NONE)
            named = ships_named(formed["names"], category)
            if score_rule == "ship":
                asked, right = valid, named == ship
            else:
                asked, right = valid & taught, (category == labels) & (category != NONE)
            answers["category"][*at, f] = category
            answers["similarity"][*at, f] = np.where(valid, cosine.reshape(valid.shape), np.nan)
            answers["predicted"][*at, f] = named
            answers["correct"][*at, f] = np.where(asked, right, NONE)
    return answers | {"cell": classifier.state(answers["correct"], valid)}


def network_of(vectors: Floats, formed: Arrays) -> AdaptiveClusteringNetwork:
    """Return the network that formed the categories of (view, feature) vectors."""
    # Imported here because scikit-learn takes a second.
    from sklearn.exceptions import ConvergenceWarning

    from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork

    training_views, turn = formed["training_confused"] >= 0, formed["turn"]
    presented = turn[training_views.reshape(-1)[turn]]
    vigilance, learning_rate, passes = formed["taught_by"].tolist()
    network = AdaptiveClusteringNetwork(
        vigilance=vigilance, learning_rate=learning_rate, max_passes=int(passes)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # `passes` and the table tell
        network.fit(vectors[presented], np.indices(training_views.shape)[0].reshape(-1)[presented])
    return network


def match_learning(
    network: AdaptiveClusteringNetwork, tests: Floats, formed: Arrays
) -> tuple[Indices, Floats]:
    """Return (view,) categories and cosines of (view, feature) tests that move categories.

    They are presented in the order of the training, known ships first, so that unknown ones move
    no category before these are compared with it.
    """
    training_views, turn = formed["training_confused"] >= 0, formed["turn"]
    unknown = np.repeat(~training_views.any(axis=1), training_views.shape[1])
    category, similarity = np.empty(len(tests), dtype=np.intp), np.empty(len(tests))
    order = turn[np.argsort(unknown[turn], kind="stable")]
    category[order], similarity[order] = network.match(tests[order], learning=True)
    return category, similarity


# Declarations


@in_memory(gather=GATHERED, keep=4)
def profile_training_set(expected: Profiles, valid: Views) -> TrainingSet:
    """Return the training views and similarities of expected profiles, shared by all trainings."""
    return TrainingSet.of(expected, valid, classifier.profile_vectors)


@in_memory(gather=GATHERED, keep=4)
def silhouette_training_set(template_log_polar: NDArray[np.uint8], valid: Views) -> TrainingSet:
    """Return the training views and similarities of silhouettes, shared by all trainings."""
    return TrainingSet.of(template_log_polar, valid, classifier.map_vectors)


@plain(uses=(Network, Run))
def profile_order(orders: int, seed: int) -> tuple[int, int]:
    """Return the number and seed of an order of presentation; order 0, the grid's own, has none."""
    return orders, seed if orders else 0


silhouette_order = replace(profile_order, name="silhouette_order", uses=(Infrared, Run))


LEARNED = ("order", "learning_rate", "vigilance", "label_rule", "score_rule", "learn_in_test")
OF_RANGE = classifier.ClassifierGroup.of(
    NAME,
    classifier.names_by(NAME, RANGE),
    (*classifier.OF_PROFILES, *LEARNED, *classifier.TESTED),
    states="status",
)
OF_INFRARED = classifier.ClassifierGroup.of(
    "acn_infrared",
    classifier.names_by(NAME, INFRARED),
    (*OF_SILHOUETTES, "phase", *LEARNED, *LOOK),
    states="status_infrared",
)
RULES = ("label_rule", "score_rule")
SEEN = {"training_set": "profile_training_set", "presentation": "profile_order"}
acn_training = OF_RANGE.stage(
    Output("training_category", VIEW, "i4", "category of the training view", without=RULES[:1]),
    Output(
        "training_confused",
        VIEW,
        "i1",
        "1 where views of another ship share that category",
        without=RULES[:1],
    ),
    Output(
        "passes",
        (),
        "i4",
        "presentations until the categories settled, negative if they did not",
        fill=0,
        without=RULES[:1],
    ),
    Output("training_correct", VIEW, "i1", "1 where that category is labelled with the true ship"),
    inner("names", ("category",), "i2"),
    inner("weights", ("category", "view"), "f8"),
    inner("turn", ("view",), "i8"),
    inner("taught_by", ("setting",), "f8"),
    uses=(Grid, Network),
    reads=SEEN,
    name="acn_training",
)(form_categories)
acn = OF_RANGE.answers(
    Output("category", VIEW, "i4", "category that the test falls into", without=RULES),
    Output("similarity", VIEW, label="cosine similarity to that category", without=RULES),
    without=RULES[1:],
    uses=(Grid, Network),
    reads=SEEN | {"training": "acn_training", "tests": "averaged"},
    along=(Network.orders, Grid.vigilance, Grid.frame_count),
    name=NAME,
)(answer_tests)

SILHOUETTES: dict[str, Any] = {"group": OF_INFRARED, "uses": (Infrared, Network)}
SEEN_INFRARED = {"training_set": "silhouette_training_set", "presentation": "silhouette_order"}
acn_infrared_training = replace(
    acn_training, name="acn_infrared_training", reads=SEEN_INFRARED, **SILHOUETTES
)
acn_infrared = replace(
    acn,
    name="acn_infrared",
    reads=SEEN_INFRARED | {"training": "acn_infrared_training", "tests": "log_polar"},
    along=(Infrared.orders, Infrared.vigilance, Infrared.frame_count),
    **SILHOUETTES,
)


TABLES = (
    *OF_RANGE.tables(rejecting=True, forming=True),
    *OF_INFRARED.tables(
        partial(classifier.tabulate_answers, shown="silhouettes"),
        rejecting=True,
        forming=True,
        labels={"classifier": NAME, "channel": INFRARED},
    ),
)
