"""The Adaptive Clustering Network on a handful of vectors by hand, and its stages on made views."""

import warnings
from unittest.mock import patch

import numpy as np
import pytest
from range_channel import ASPECTS, SHIPS, learned, made

from ncti.classify import AdaptiveClusteringNetwork, Similarities
from sweeps.engine.seeds import cell_rng
from sweeps.stages import acn, categories
from sweeps.stages.categories import (
    Lessons,
    answer_tests,
    clustering_of,
    form_categories,
    match_learning,
    name_categories,
    network_of,
    presentation_order,
)
from sweeps.stages.classifier import map_vectors, profile_vectors
from sweeps.stages.silhouettes import STEPS

TRAINED = {"learning_rate": 0.1, "max_passes": 200}


def unit(degrees):
    angles = np.radians(np.array(degrees, dtype=float))
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def formed_of(training, training_views, order=None, **settings):
    """Lessons of (view,) directions, and the categories that they form in some order."""
    there = np.ones(np.shape(training_views), dtype=bool)
    lessons = Lessons.of(unit(training), there, lambda vectors: vectors)
    turn = np.arange(there.size) if order is None else np.array(order)
    settings = {"vigilance": 0.95} | TRAINED | settings
    with patch.object(categories, "presentation_order", lambda *given: turn):
        return lessons, form_categories(
            lessons, np.array(training_views, dtype=bool), (0, 0), **settings
        )


def judged(training, tests, training_views, order, rule="majority", scores=("ship",)):
    """Category, ship named, answers right, and trainings right of (ship, aspect) directions."""
    lessons, formed = formed_of(training, training_views, order)
    names = name_categories(formed, rule)
    several = {name: values[None] for name, values in names.items()}
    tested = answer_tests(
        lessons, formed, several, unit(tests)[None], lessons.there, scores, learn_in_test=False
    )
    category, named = (tested[name][0, 0, 0] for name in ("category", "predicted"))
    return category, named, tested["correct"][0, 0], names["training_correct"]


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
        training_views=[[1, 0, 1], [0, 0, 0]],
        order=range(6),
        scores=("ship", "category"),
    )
    np.testing.assert_array_equal(ship, [[1, 1, 1], [0, 0, 0]])
    np.testing.assert_array_equal(same, [[0, -1, 1], [-1, -1, -1]])
    np.testing.assert_array_equal(category, [[1, 0, 1], [0, 0, 1]])
    np.testing.assert_array_equal(trained, [[1, -1, 1], [-1, -1, -1]])


def test_views_are_confused_that_share_a_category_with_another_ship():
    _, formed = formed_of([0, 90, 1, 180], np.ones((2, 2)))
    np.testing.assert_array_equal(formed["training_confused"], [[1, 0], [1, 0]])
    np.testing.assert_array_equal(formed["training_category"], [[0, 1], [0, 2]])


@pytest.mark.parametrize("unknown", [0, 1])
def test_unknown_ships_move_no_category_of_known_ones(unknown):
    """Whatever they look like, and wherever they stand among the ships."""
    known = 1 - unknown
    training_views = np.zeros((2, 2), dtype=bool)
    training_views[known] = True
    lessons, formed = formed_of([0.0, 90.0, 0.0, 90.0], training_views, learning_rate=0.5)

    def matched(angle):
        tests = np.array([[3.0, 80.0], [3.0, 80.0]])
        tests[unknown] = angle, angle + 1
        network = network_of(lessons.vectors, formed)
        found = match_learning(network, unit(tests).reshape(4, 2), formed)
        return tuple(values.reshape(2, 2) for values in found)

    first, second = matched(40.0), matched(-20.0)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one[known], other[known])
    np.testing.assert_allclose(first[1][known], np.cos(np.radians([3.0, 10.0])), atol=1e-12)
    # They meet categories that known ones have moved half the way: from 0 to 1.5 deg.
    moved = np.cos(np.radians(40.0 - 1.5))
    assert first[1][unknown, 0] == pytest.approx(moved, abs=1e-6)


def test_presentations_that_did_not_settle_are_negative():
    vectors = cell_rng(0, stage="test").standard_normal((40, 3))
    there = np.ones((4, 10), dtype=bool)
    lessons = Lessons(vectors, Similarities.of(vectors), there, np.asarray)
    settled, stopped = (
        form_categories(lessons, there, (0, 0), 0.8, 0.5, passes) for passes in (200, 1)
    )
    assert settled["passes"] > 1 and stopped["passes"] == -1
    assert clustering_of(settled).converged and not clustering_of(stopped).converged


def test_the_first_order_is_the_grid_s_and_others_are_by_their_number():
    first, *others = (presentation_order(40, order, 7) for order in range(5))
    np.testing.assert_array_equal(first, np.arange(40))
    for order in others:
        np.testing.assert_array_equal(np.sort(order), first)
    assert len({tuple(order) for order in (first, *others)}) == 5
    assert (presentation_order(40, 1, 8) != others[0]).any()


# The stages on profiles and maps

LABELS, SCORES = ("first", "majority"), ("category", "ship")
ORDERS = ((0, 7), (1, 7))
LEVELS = {"profiles": (0.5, 0.7, 0.9), "maps": (0.96, 0.97)}
SEE = {"profiles": profile_vectors, "maps": map_vectors}
of_both = pytest.mark.parametrize("kind", list(SEE))
while_learning_or_not = pytest.mark.parametrize("learn", [False, True])


def views_of(kind):
    """(ship, aspect, ...) views, and noisy (frame_count, ship, aspect, ...) tests of them."""
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
    """Mappings of arrays as one mapping of arrays with an axis more."""
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def trained(kind, seen, orders, levels, labels, there=None, training_views=None):
    """What the stages of training give, and what they share."""
    there = np.ones(seen.shape[:2], dtype=bool) if there is None else there
    training_views = np.ones_like(there) if training_views is None else training_views
    lessons = {"profiles": acn.profile_lessons, "maps": acn.silhouette_lessons}[kind](seen, there)
    formed = [
        [
            form_categories(lessons, training_views, order, level, *TRAINED.values())
            for level in levels
        ]
        for order in orders
    ]
    names = [
        stacked([stacked([name_categories(one, label) for label in labels]) for one in row])
        for row in formed
    ]
    return lessons, stacked([stacked(row) for row in formed]), stacked(names)


def answered(
    kind, views, orders=ORDERS, levels=None, frames=(0, 1), labels=LABELS, scores=SCORES,
    there=None, learn=False, training_views=None,
):  # fmt: skip
    """What the stage of tests gives, called as the engine calls it."""
    seen, tests = views
    there = np.ones(seen.shape[:2], dtype=bool) if there is None else there
    known = trained(kind, seen, orders, levels or LEVELS[kind], labels, there, training_views)
    return answer_tests(*known, tests[list(frames)], there, scores, learn)


@of_both
@while_learning_or_not
def test_an_answer_does_not_depend_on_its_company(kind, learn):
    """On any axis, to the last bit."""
    views = views_of(kind)
    axes = (ORDERS, LEVELS[kind], (0, 1), LABELS, SCORES)
    whole = answered(kind, views, *axes, learn=learn)
    for place in np.ndindex(*map(len, axes)):
        one = [(values[at],) for values, at in zip(axes, place, strict=True)]
        for name, values in answered(kind, views, *one, learn=learn).items():
            np.testing.assert_array_equal(values[0, 0, 0, 0, 0], whole[name][place], err_msg=name)


@of_both
@while_learning_or_not
def test_the_stages_are_the_network(kind, learn):
    """Trained in every order and tested with the same vectors, one after the other."""
    seen, tests = views = views_of(kind)
    found = answered(kind, views, labels=("majority",), scores=("ship",), learn=learn)
    _, formed, _ = trained(kind, seen, ORDERS, LEVELS[kind], ("majority",))
    ship = np.repeat(np.arange(SHIPS), len(ASPECTS))
    vectors, *shown = (SEE[kind](one).astype(float) for one in (seen, *tests))
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
        for f, one in enumerate(shown):
            if learn:
                network.fit(vectors[turn], ship[turn])
            category, cosine = np.empty(ship.size, int), np.empty(ship.size)
            category[turn], cosine[turn] = network.match(one[turn], learning=learn)
            place = (o, v, f, 0, 0)
            np.testing.assert_array_equal(found["category"][place].ravel(), category)
            np.testing.assert_allclose(found["similarity"][place].ravel(), cosine, atol=1e-12)
            named = network.category_labels_[category]
            np.testing.assert_array_equal(found["predicted"][place].ravel(), named)
            np.testing.assert_array_equal(found["correct"][place].ravel(), named == ship)
    assert shared
    assert 0 < found["correct"].mean() < 1


@of_both
def test_what_is_empty_names_no_ship_which_is_wrong(kind):
    seen, tests = views_of(kind)
    tests[0, 1, 2] = 7 if kind == "profiles" else 0
    found = answered(kind, (seen, tests), scores=("ship",))
    at = (..., 0, slice(None), 0, 1, 2)
    for name, wanted in (("category", -1), ("predicted", -1), ("correct", 0), ("cell", 1)):
        assert (found[name][at] == wanted).all(), name


@of_both
def test_views_that_are_not_there_change_no_other_answer(kind):
    """Answers are those of a grid that never had them."""
    seen, tests = views_of(kind)
    there = np.ones(seen.shape[:2], dtype=bool)
    there[2] = False
    seen, tests = seen.copy(), tests.copy()
    seen[2] = tests[:, 2] = np.nan if kind == "profiles" else 0  # as the engine fills them
    found = answered(kind, (seen, tests), there=there, orders=ORDERS[:1])
    smaller = answered(kind, (seen[:2], tests[:, :2]), orders=ORDERS[:1])
    for name, values in smaller.items():
        np.testing.assert_allclose(found[name][..., :2, :], values, atol=1e-12, err_msg=name)
    for name in ("category", "predicted", "correct"):
        assert (found[name][..., 2, :] == -1).all()
    assert np.isnan(found["similarity"][..., 2, :]).all()
    np.testing.assert_array_equal(found["cell"][..., 2, :], 0)


@of_both
def test_states_tell_what_was_not_asked(kind):
    """Of a view that was not learned, which category is right; of one that is not there, any."""
    there = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    there[0, 3] = False
    training_views = learned(unknown=("b",), training_aspect=(0.0, 59.9, 90.0))
    found = answered(kind, views_of(kind), there=there, training_views=training_views)
    wanted = np.where(there, np.where(training_views, 1, -1), 0)
    assert (found["cell"][:, :, :, :, 0] == wanted).all()
    assert (found["cell"][:, :, :, :, 1] == there).all()
    assert set(np.unique(found["predicted"][..., there])) == {0, 2}
    assert np.isnan(found["similarity"][..., ~there]).all()


def test_maps_are_shares_of_their_cells():
    maps = np.arange(24, dtype=np.uint8).reshape(1, 2, 1, 3, 4) * 11
    found = map_vectors(maps)
    assert found.shape == (1, 2, 12)
    np.testing.assert_allclose(found.ravel(), np.arange(24) * 11 / STEPS, rtol=1e-6)
