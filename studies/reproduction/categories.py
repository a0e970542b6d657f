"""Categories of the Adaptive Clustering Network in several orders of presentation, and scores."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify import Similarities, cluster
from studies.reproduction.simulated import Simulated, percent_by_bin

PASSES = 100  # presentations, after which categories that still change are taken as they are

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]


def presentation_orders(
    order: str, ship: Indices, aspect: Floats, draws: int, rng: np.random.Generator
) -> list[Indices]:
    """Return (view,) orders of presentation, one for each draw if they are random, else one.

    `ships` presents all views of a ship, then those of the next; `aspects` all ships at an aspect.
    """
    if order == "random":
        return [rng.permutation(len(ship)) for _ in range(draws)]
    keys = (aspect, ship) if order == "ships" else (ship, aspect)
    return [np.lexsort(keys)]


def category_counts(vectors: Floats, orders: Sequence[Indices], **options: Any) -> Indices:
    """Return the (order,) numbers of categories of (view, feature) vectors.

    `options` are those of `cluster`.
    """
    similarities = Similarities.of(vectors)
    counts = [
        len(cluster(similarities, order=order, max_passes=PASSES, **options).weights)
        for order in orders
    ]
    return np.array(counts if len(counts) > 1 else 2 * counts)


def acn_scores(
    templates: Floats,
    tests: Floats,
    orders: Sequence[Indices],
    *,
    ship: Indices,
    aspect: Floats,
    label_rule: str,
    learn_in_test: bool,
    **options: Any,
) -> Simulated:
    """Return the network's percent correct by (row, bin): first of training, then of tests.

    `templates` (view, feature) are learned in each of the `orders`, one for each draw or one for
    all; `tests` (draw, test, view, feature) are presented in the order of their draw, and move
    categories if `learn_in_test`. `ship` (view,) are numbers, `aspect` (view,) [deg]; `label_rule`
    names a category after the `majority` of its members or the `first`; `options` has vigilance and
    learning rate. A vector without a category, such as the map of an empty silhouette, counts as
    wrong.
    """
    from sklearn.exceptions import ConvergenceWarning

    from ncti.classify import AdaptiveClusteringNetwork

    trained = []
    for order in orders:
        network = AdaptiveClusteringNetwork(max_passes=PASSES, **options)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # as it is after all passes
            network.fit(templates[order], ship[order])
        names = network.category_labels_
        if label_rule == "first":
            _, first_members = np.unique(network.labels_, return_index=True)
            names = ship[order][first_members]
        learned = np.empty(len(order), dtype=bool)
        learned[order] = names[network.labels_] == ship[order]
        trained.append((network, order, names, learned))
    right = np.empty((len(tests), 1 + tests.shape[1], len(ship)), dtype=bool)
    for draw, tested in enumerate(tests):
        network, order, names, learned = trained[draw % len(trained)]
        right[draw, 0] = learned
        for row, vectors in enumerate(tested, start=1):
            category, _ = network.match(vectors[order], learning=learn_in_test)
            right[draw, row, order] = (category >= 0) & (names[category] == ship[order])
    return Simulated.of(percent_by_bin(right, aspect))
