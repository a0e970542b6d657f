"""The stages of the Adaptive Clustering Network answer as the library's network does."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from memory import peak_memory
from range_channel import ASPECTS, SHIPS, choose, made

from ncti.classify import AdaptiveClusteringNetwork, Similarities
from ncti.classify.blocks import row_blocks
from sweeps.engine.resolve.plan import Plan
from sweeps.experiment import EXPERIMENT
from sweeps.stages import acn
from sweeps.stages.acn import (
    TrainingSet,
    answer_tests,
    form_categories,
    match_learning,
    presentation_order,
)
from sweeps.stages.classifier import map_vectors, profile_vectors

TRAINED = {"learning_rate": 0.1, "max_passes": 200}


def unit(degrees):
    angles = np.radians(np.array(degrees, dtype=float))
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


@pytest.mark.parametrize("unknown", [0, 1])
def test_unknown_ships_move_no_category_of_known_ones(unknown):
    """It holds for two looks of the unknown ship, as the first and as the second ship."""
    known = 1 - unknown
    training_views = np.zeros((2, 2), dtype=bool)
    training_views[known] = True
    seen, valid = unit([[0.0, 90.0], [0.0, 90.0]]), training_views | True
    training_set = TrainingSet.of_views(
        seen, valid, training_views, lambda views: views.reshape(-1, 2)
    )
    formed = form_categories(training_set, training_views, (0, 0), 0.95, 0.5, 200, "first")

    def matched(angle):
        tests = np.array([[3.0, 80.0], [3.0, 80.0]])
        tests[unknown] = angle, angle + 1
        shown = unit(tests).reshape(4, 2).__getitem__
        matches = match_learning(training_set, formed, shown, 0.5)
        return tuple(values.reshape(2, 2) for values in matches)

    first, second = matched(40.0), matched(-20.0)
    for before, after in zip(first, second, strict=True):
        np.testing.assert_array_equal(before[known], after[known])
    np.testing.assert_allclose(first[1][known], np.cos(np.radians([3.0, 10.0])), atol=1e-12)
    # Unknown ones match categories that known ones moved half the way, from 0 to 1.5 deg.
    moved = np.cos(np.radians(40.0 - 1.5))
    assert first[1][unknown, 0] == pytest.approx(moved, abs=1e-6)


# The stages on profiles and maps

ORDERS = ((0, 7), (1, 7))
LEVELS = {"profiles": (0.5, 0.7, 0.9), "maps": (0.96, 0.97)}
SEE = {"profiles": profile_vectors, "maps": map_vectors}
of_both = pytest.mark.parametrize("kind", list(SEE))


def views_of(kind):
    """Return (ship, aspect, ...) views, and noisy (frame_count, ship, aspect, ...) tests."""
    if kind == "profiles":
        cell = made(noise=5.0)
        return cell.expected, cell.averaged[0]
    rng = np.random.default_rng(0)
    shape = (SHIPS, len(ASPECTS), 6, 4)
    templates = 80 + rng.integers(0, 100, shape)
    deviation = 25 * np.array([2.0, 1.0])[:, None, None, None, None]
    tests = np.clip(templates + deviation * rng.standard_normal((2, *shape)), 0, 255)
    return templates.astype(np.uint8), tests.astype(np.uint8)


def stacked(rows):
    """Return mappings of arrays, stacked to one mapping along a new first axis."""
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def trained(kind, views, label, training_views=None):
    """Return the training set and the categories formed, by order and level."""
    valid = np.ones(views.shape[:2], dtype=bool)
    training_views = np.ones_like(valid) if training_views is None else training_views
    training_set = {"profiles": acn.profile_training_set, "maps": acn.silhouette_training_set}[
        kind
    ](views, valid, training_views)
    formed = [
        stacked(
            [
                form_categories(training_set, training_views, order, level, 0.1, 200, label)
                for level in LEVELS[kind]
            ]
        )
        for order in ORDERS
    ]
    return training_set, stacked(formed)


def answered(kind, views, rules=("majority", "ship"), learn=False, training_views=None):
    """Return the arrays of the stage of tests, called as the engine calls it."""
    seen, tests = views
    valid = np.ones(seen.shape[:2], dtype=bool)
    label, score = rules
    known = trained(kind, seen, label, training_views)
    return answer_tests(*known, tests, valid, score, learn, TRAINED["learning_rate"])


@of_both
@pytest.mark.parametrize("learn", [False, "all read at once", "in blocks"])
def test_stages_match_the_network(kind, learn, monkeypatch):
    """The network is trained in each order, and tested with the same vectors one by one."""
    if learn == "in blocks":
        monkeypatch.setattr(acn, "HELD_ROWS", 1)
        monkeypatch.setattr(acn, "row_blocks", lambda count: row_blocks(count, 4))
    learn = bool(learn)
    seen, tests = views = views_of(kind)
    answers = answered(kind, views, learn=learn)
    _, formed = trained(kind, seen, "majority")
    ship = np.repeat(np.arange(SHIPS), len(ASPECTS))
    vectors, *test_vectors = (SEE[kind](images).astype(float) for images in (seen, *tests))
    shared = False
    for o, v in np.ndindex(len(ORDERS), len(LEVELS[kind])):
        turn = presentation_order(ship.size, *ORDERS[o])
        network = AdaptiveClusteringNetwork(vigilance=LEVELS[kind][v], **TRAINED)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            network.fit(vectors[turn], ship[turn])
        labels = formed["training_category"][o, v].ravel()
        np.testing.assert_array_equal(labels[turn], network.labels_)
        assert abs(formed["passes"][o, v]) == network.n_passes_
        shared |= SHIPS < labels.max() + 1 < ship.size
        for f, vectors_of_count in enumerate(test_vectors):
            if learn:
                network.fit(vectors[turn], ship[turn])
            category, cosine = np.empty(ship.size, int), np.empty(ship.size)
            category[turn], cosine[turn] = network.match(vectors_of_count[turn], learning=learn)
            index = (o, v, f)
            np.testing.assert_array_equal(answers["category"][index].ravel(), category)
            np.testing.assert_allclose(answers["similarity"][index].ravel(), cosine, atol=1e-12)
            predicted = network.category_labels_[category]
            np.testing.assert_array_equal(answers["predicted"][index].ravel(), predicted)
            np.testing.assert_array_equal(answers["correct"][index].ravel(), predicted == ship)
    assert shared
    assert 0 < answers["correct"].mean() < 1


@of_both
def test_category_scores_exclude_views_outside_training(kind):
    """They have categories all the same, and scores by ship count them."""
    training_views = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    training_views[1], training_views[:, 3] = False, False
    views = views_of(kind)
    for score, scored in (("category", training_views), ("ship", training_views | True)):
        answers = answered(kind, views, rules=("first", score), training_views=training_views)
        np.testing.assert_array_equal(
            answers["correct"] >= 0, np.broadcast_to(scored, answers["correct"].shape)
        )
        np.testing.assert_array_equal(
            answers["cell"], np.where(scored, 1, -1) + 0 * answers["cell"]
        )
        assert (answers["category"] >= 0).all()


def test_presentation_orders_after_the_first_depend_on_the_seed():
    def keys(seed):
        overrides = {"sensor": "range", "classifier__name": "acn", "classifier__orders": 2}
        plan = Plan(EXPERIMENT, choose(seed=seed, **overrides))
        return [plan.key(plan.bound["acn_training"], place) for place in (0, 1)]

    (of_grid, drawn), (same, other) = keys(0), keys(1)
    assert of_grid == same and drawn != other


# Many views in blocks


def few_learned(aspects, learned, seed=0):
    """Return (ship, aspect, bin) views of three ships, noisy tests, and a mask of those learned."""
    rng = np.random.default_rng(seed)
    views = np.abs(rng.standard_normal((3, aspects, 40))).astype(np.float32)
    tests = (views + 0.3 * rng.standard_normal(views.shape)).astype(np.float32)
    training_views = np.zeros((3, aspects), dtype=bool)
    training_views[:2, rng.permutation(aspects)[:learned]] = True
    return views, tests, training_views


@settings(deadline=None, max_examples=25)
@given(aspects=st.integers(3, 400), learned=st.integers(1, 40), seed=st.integers(0, 2**32 - 1))
def test_blockwise_learning_and_tests_equal_all_views_at_once(aspects, learned, seed):
    """The reference has all views in one training set, and matches all tests at once."""
    views, tests, training_views = few_learned(aspects, learned, seed)
    valid = np.random.default_rng(seed).random(training_views.shape) < 0.9
    valid[training_views.nonzero()[0][0], training_views.nonzero()[1][0]] = True
    options = ((1, 7), 0.8, 0.1, 200, "majority")
    training_set = TrainingSet.of_views(views, valid, training_views, profile_vectors)
    of_all = TrainingSet.of_views(views, valid, training_views | True, profile_vectors)
    of_all = acn.replace(
        of_all,
        similarities=Similarities.of(profile_vectors(views)),
        views=np.arange(valid.size),
    )
    formed, of_all_views = (
        form_categories(views_learned, training_views, *options)
        for views_learned in (training_set, of_all)
    )
    training = ("training_category", "training_confused", "training_correct")
    for name in (*training, "passes", "view_order"):
        np.testing.assert_array_equal(formed[name], of_all_views[name], err_msg=name)
    answers = answer_tests(training_set, formed, tests[None], valid, "ship", False, 0.1)
    [clustering] = [acn._clustering(of_all_views)]
    category, cosine = clustering.match(of_all.similarities.with_tests(profile_vectors(tests)))
    np.testing.assert_array_equal(
        answers["category"][0][valid], category.reshape(valid.shape)[valid]
    )
    assert np.isnan(answers["similarity"][0][~valid]).all()
    for name, absent in (("category", -1), ("predicted", -1), ("correct", -1), ("cell", 0)):
        assert (answers[name][0][~valid] == absent).all(), name
    # Rounding of sums over features or all views, with weights of 0 for views not learned.
    bound = 4 * valid.size * np.finfo(float).eps * max(1, np.abs(of_all_views["weights"]).max())
    cosine = cosine.reshape(valid.shape)[valid]
    np.testing.assert_allclose(answers["similarity"][0][valid], cosine, rtol=0, atol=bound)


def test_memory_is_linear_in_the_number_of_tests():
    def peak(aspects):
        views, tests, known = few_learned(aspects, 50)

        def answer():
            training_set = TrainingSet.of_views(views, known | True, known, profile_vectors)
            formed = form_categories(training_set, known, (0, 0), 0.8, 0.1, 200, "first")
            answer_tests(training_set, formed, tests[None], known | True, "ship", False, 0.1)

        return peak_memory(answer)

    peak(60)  # imports
    small, large = peak(500), peak(4_000)
    assert large < 8 * small  # 64 times, if it held cosines of all pairs of views
    assert large < 10 * 3 * 4_000 * 40 * 8
