"""The Adaptive Clustering Network on a handful of vectors by hand, and its stages on profiles."""

import warnings

import numpy as np
import pytest
from range_channel import ASPECTS, FRAMES, NAMED, SHIPS, directions, made

from ncti.classify import AdaptiveClusteringNetwork, Similarities
from sweeps.engine.seeds import cell_rng
from sweeps.stages import acn
from sweeps.stages.categories import (
    answer_tests,
    clustering_of,
    form_categories,
    match_learning,
    name_categories,
)

TRAINED = {"learning_rate": 0.1, "max_passes": 200}


def unit(degrees):
    angles = np.radians(np.array(degrees, dtype=float))
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def judged(training, tests, taught, order, rule="majority", scores=("ship",)):
    """Category, ship named, answers right, and trainings right of (ship, aspect) directions."""
    taught = np.array(taught, dtype=bool)
    similarities = Similarities.of(unit(training))
    formed = form_categories(similarities, taught, np.array(order), vigilance=0.95, **TRAINED)
    names, training_correct = name_categories(formed, np.array(order), rule)
    category, _ = clustering_of(formed).match(similarities.to(unit(tests)))
    category = category.reshape(taught.shape)
    there = np.ones_like(taught)
    return category, *answer_tests(category, there, formed, names, scores), training_correct


@pytest.mark.parametrize(
    ("order", "east", "north"),
    [([0, 1, 2, 3], 0, 0), ([2, 1, 3, 0], 1, 0), ([3, 2, 1, 0], 1, 1)],
)
def test_categories_are_named_by_who_is_presented_first(order, east, north):
    """Four views in two directions, a ship each in both: the order alone decides."""
    views = [0, 90, 1, 91]
    _, named, (correct,), trained = judged(views, views, [[1, 1], [1, 1]], order, "first")
    np.testing.assert_array_equal(named, [[east, north], [east, north]])
    right = [[east == 0, north == 0], [east == 1, north == 1]]
    np.testing.assert_array_equal(correct, right)
    np.testing.assert_array_equal(trained, right)


def test_categories_are_named_by_most_of_their_members():
    views = [0, 1, 2, 90, 91, 3]
    _, named, _, _ = judged(views, views, [[1, 1, 1], [1, 1, 1]], [5, 4, 3, 2, 1, 0])
    np.testing.assert_array_equal(named, [[0, 0, 0], [1, 1, 0]])


def test_what_was_never_learned_has_no_category_to_fall_into():
    """A view between learned ones and a ship absent from training: named, but right by no rule."""
    category, _, (ship, same), trained = judged(
        training=[0, 45, 90, 2, 30, 60],
        tests=[90, 45, 90, 2, 30, 60],
        taught=[[1, 0, 1], [0, 0, 0]],
        order=range(6),
        scores=("ship", "category"),
    )
    np.testing.assert_array_equal(ship, [[1, 1, 1], [0, 0, 0]])
    np.testing.assert_array_equal(same, [[0, -1, 1], [-1, -1, -1]])
    np.testing.assert_array_equal(category, [[1, 0, 1], [0, 0, 1]])
    np.testing.assert_array_equal(trained, [[1, -1, 1], [-1, -1, -1]])


def test_views_are_confused_that_share_a_category_with_another_ship():
    formed = form_categories(
        Similarities.of(unit([0, 90, 1, 180])),
        np.ones((2, 2), dtype=bool),
        np.arange(4),
        vigilance=0.95,
        **TRAINED,
    )
    np.testing.assert_array_equal(formed["training_confused"], [[1, 0], [1, 0]])
    np.testing.assert_array_equal(formed["training_category"], [[0, 1], [0, 2]])


@pytest.mark.parametrize("unknown", [0, 1])
def test_unknown_ships_move_no_category_of_known_ones(unknown):
    """Whatever they look like, and wherever they stand among the ships."""
    known = 1 - unknown
    taught = np.zeros((2, 2), dtype=bool)
    taught[known] = True
    training = unit([[0.0, 90.0], [0.0, 90.0]]).reshape(4, 2)

    def matched(angle):
        tests = np.array([[3.0, 80.0], [3.0, 80.0]])
        tests[unknown] = angle, angle + 1
        settings = {"vigilance": 0.95, "learning_rate": 0.5, "max_passes": 200}
        category, cosine = match_learning(
            training, unit(tests).reshape(4, 2), taught, np.arange(4), **settings
        )
        return category.reshape(2, 2), cosine.reshape(2, 2)

    first, second = matched(40.0), matched(-20.0)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one[known], other[known])
    np.testing.assert_allclose(first[1][known], np.cos(np.radians([3.0, 10.0])), atol=1e-12)
    # They meet categories that known ones have moved half the way: from 0 to 1.5 deg.
    moved = np.cos(np.radians(40.0 - 1.5))
    assert first[1][unknown, 0] == pytest.approx(moved, abs=1e-6)


def trained(cell, vigilance, unknown=None, training_aspect=None):
    """What the stages of training give at every vigilance and label rule, and what they share."""
    lessons = acn.profile_lessons(cell.expected, cell.there)
    formed = [
        acn.acn_training(
            lessons, NAMED, ASPECTS, unknown, training_aspect, level, *TRAINED.values()
        )
        for level in vigilance
    ]
    return lessons, formed


def answered(
    cell, vigilance, frames, labels=("majority",), scores=("ship",), learn=False, **taught
):
    """What the stage of tests gives of one replicate, called as the engine calls it."""
    lessons, formed = trained(cell, vigilance, **taught)
    names = [[acn.acn_names(one, rule) for rule in labels] for one in formed]
    stacked = {name: np.stack([one[name] for one in formed]) for name in formed[0]}
    named = {
        name: np.stack([np.stack([one[name] for one in row]) for row in names])
        for name in names[0][0]
    }
    places = [FRAMES.index(count) for count in frames]
    return acn.acn(
        lessons,
        stacked,
        named,
        cell.averaged[0, places],
        cell.there,
        NAMED,
        ASPECTS,
        vigilance,
        frames,
        labels,
        scores,
        *TRAINED.values(),
        learn,
    )


LEVELS = (0.5, 0.7, 0.9)
LABELS, SCORES = ("first", "majority"), ("category", "ship")


@pytest.mark.parametrize("learn", [False, True])
def test_a_test_does_not_depend_on_its_company(learn):
    """On any axis, to the last bit."""
    cell = made(noise=5.0)
    whole = answered(cell, LEVELS, FRAMES, LABELS, SCORES, learn)
    assert len({one["training_category"].max() for one in trained(cell, LEVELS)[1]}) > 1
    for place in np.ndindex(3, 2, 2, 2):
        v, f, k, s = place
        alone = answered(cell, (LEVELS[v],), (FRAMES[f],), (LABELS[k],), (SCORES[s],), learn)
        for name, values in alone.items():
            np.testing.assert_array_equal(values[0, 0, 0, 0], whole[name][place], err_msg=name)


@pytest.mark.parametrize("learn", [False, True])
def test_the_stages_are_the_network(learn):
    """Trained and tested with the same vectors, one after the other."""
    cell = made(noise=5.0)
    found = answered(cell, LEVELS, FRAMES, learn=learn)
    _, formed = trained(cell, LEVELS)
    ship = np.repeat(np.arange(SHIPS), len(ASPECTS))
    vectors = [directions(one).reshape(ship.size, -1) for one in (cell.expected, *cell.averaged[0])]
    vectors = [one / one.max(axis=1, keepdims=True) for one in vectors]
    for v, level in enumerate(LEVELS):
        network = AdaptiveClusteringNetwork(vigilance=level, **TRAINED)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            network.fit(vectors[0], ship)
        labels = formed[v]["training_category"].ravel()
        np.testing.assert_array_equal(labels, network.labels_)
        assert abs(formed[v]["passes"]) == network.n_passes_
        for f in range(len(FRAMES)):
            category, cosine = network.match(vectors[1 + f], learning=learn)
            place = (v, f, 0, 0)
            np.testing.assert_array_equal(found["category"][place].ravel(), category)
            np.testing.assert_allclose(found["similarity"][place].ravel(), cosine, atol=1e-12)
            named = network.category_labels_[category]
            np.testing.assert_array_equal(found["predicted"][place].ravel(), named)
            np.testing.assert_array_equal(found["correct"][place].ravel(), named == ship)
    assert 0 < found["correct"].mean() < 1


def test_views_that_are_not_there_change_no_other_answer():
    """Answers are those of a grid that never had them."""
    cell = made(noise=1.0)
    lost = cell.without(slice(2, None), slice(None))
    found = answered(lost, LEVELS, FRAMES, LABELS, SCORES)
    smaller = cell.changed(
        expected=cell.expected[:2], averaged=cell.averaged[:, :, :2], there=cell.there[:2]
    )
    lessons = acn.profile_lessons(smaller.expected, smaller.there)
    for v, level in enumerate(LEVELS):
        formed = acn.acn_training(lessons, NAMED[:2], ASPECTS, None, None, level, *TRAINED.values())
        seen = lessons.similarities.to(acn.profile_vectors(smaller.averaged[0, 0]))
        category, cosine = clustering_of(formed).match(seen)
        np.testing.assert_array_equal(found["category"][v, 0, 0, 0, :2].ravel(), category)
        np.testing.assert_allclose(found["similarity"][v, 0, 0, 0, :2].ravel(), cosine, atol=1e-12)
    for name in ("category", "predicted", "correct"):
        assert (found[name][..., 2, :] == -1).all()
    assert np.isnan(found["similarity"][..., 2, :]).all()
    np.testing.assert_array_equal(found["cell"][..., 2, :], 0)
    np.testing.assert_array_equal(found["cell"][..., :2, :], 1)


def test_states_tell_what_was_not_asked():
    """Of a view that was not learned, which category is right."""
    cell = made()
    found = answered(
        cell, (0.9,), FRAMES, scores=SCORES, unknown=("b",), training_aspect=(0.0, 90.0)
    )
    asked = np.zeros((SHIPS, len(ASPECTS)), dtype=bool)
    asked[np.ix_([0, 2], [0, 5])] = True
    np.testing.assert_array_equal(found["cell"][0, 0, 0, 0], np.where(asked, 1, -1))
    np.testing.assert_array_equal(found["cell"][0, 0, 0, 1], 1)
    assert set(np.unique(found["predicted"])) == {0, 2}


def test_a_flat_profile_names_no_ship():
    cell = made()
    averaged = cell.averaged.copy()
    averaged[0, 0, 1, 2] = 7.0
    found = answered(cell.changed(averaged=averaged), (0.9,), FRAMES)
    at = (0, 0, 0, 0, 1, 2)
    assert [found[name][at] for name in ("category", "predicted", "correct", "cell")] == [
        *(-1, -1, 0, 1)
    ]


def test_presentations_that_did_not_settle_are_negative():
    rng = cell_rng(0, stage="test")
    vectors = rng.standard_normal((40, 3))
    similarities = Similarities.of(vectors)
    taught = np.ones((4, 10), dtype=bool)
    order = np.arange(40)
    settled = form_categories(
        similarities, taught, order, vigilance=0.8, learning_rate=0.5, max_passes=200
    )
    assert settled["passes"] > 1
    stopped = form_categories(
        similarities, taught, order, vigilance=0.8, learning_rate=0.5, max_passes=1
    )
    assert stopped["passes"] == -1
    assert clustering_of(settled).converged and not clustering_of(stopped).converged
