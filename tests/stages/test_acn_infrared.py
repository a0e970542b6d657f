"""Silhouettes named by the Adaptive Clustering Network, and its tables against numbers by hand."""

import math
import warnings

import numpy as np
import pytest
import xarray as xr
from infrared_channel import choose

from ncti.classify import AdaptiveClusteringNetwork
from sweeps.stages.acn_infrared import (
    acn_infrared,
    acn_infrared_names,
    acn_infrared_training,
    map_vectors,
    presentation_order,
    silhouette_lessons,
    tabulate_silhouettes,
)

SHIPS, ASPECTS = ("a", "b", "c"), (0.0, 20.0, 40.0, 60.0)
VIEWS = len(SHIPS) * len(ASPECTS)
FRAMES, ORDERS, LEVELS = (4, 16), (0, 1, 2), (0.96, 0.97)
LABELS, SCORES = ("first", "majority"), ("category", "ship")
TRAINED = {"learning_rate": 0.3, "max_passes": 200}
SEED = 7


def made(noise=25.0):
    """(ship, aspect, angle, radius) templates alike enough to share, and noisy tests of them."""
    rng = np.random.default_rng(0)
    shape = (len(SHIPS), len(ASPECTS), 6, 4)
    templates = 80 + rng.integers(0, 100, shape)
    deviation = noise * np.array([2.0, 1.0])[:, None, None, None, None]
    tests = np.clip(templates + deviation * rng.standard_normal((2, *shape)), 0, 255)
    return templates.astype(np.uint8), tests.astype(np.uint8)


def stacked(rows):
    """Mappings of arrays as one mapping of arrays with an axis more."""
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def trained(templates, orders, levels, labels, there=None, unknown=None, training_aspect=None):
    """What the stages of training give, and what they share."""
    there = np.ones(templates.shape[:2], dtype=bool) if there is None else there
    lessons = silhouette_lessons(templates, there)
    formed, named = [], []
    for order in orders:
        row = [
            acn_infrared_training(
                *(lessons, SHIPS, ASPECTS, unknown, training_aspect),
                *(level, *TRAINED.values(), order, SEED),
            )
            for level in levels
        ]
        names = [
            stacked([acn_infrared_names(one, label, order, SEED) for label in labels])
            for one in row
        ]
        formed.append(stacked(row))
        named.append(stacked(names))
    return lessons, stacked(formed), stacked(named)


def answered(
    templates,
    tests,
    orders=ORDERS,
    levels=LEVELS,
    frames=FRAMES,
    labels=LABELS,
    scores=SCORES,
    there=None,
    learn=False,
    **taught,
):
    """What the stage of tests gives, called as the engine calls it."""
    there = np.ones(templates.shape[:2], dtype=bool) if there is None else there
    return acn_infrared(
        *trained(templates, orders, levels, labels, there=there, **taught),
        tests[[FRAMES.index(count) for count in frames]],
        *(there, orders, levels, frames, labels, scores),
        *TRAINED.values(),
        *(learn, SEED),
    )


def test_the_first_order_is_the_grid_s_and_others_are_by_their_number():
    first, *others = (presentation_order(40, order, SEED) for order in range(5))
    np.testing.assert_array_equal(first, np.arange(40))
    for order in others:
        np.testing.assert_array_equal(np.sort(order), first)
    assert len({tuple(order) for order in (first, *others)}) == 5
    assert (presentation_order(40, 1, SEED + 1) != others[0]).any()


@pytest.mark.parametrize("learn", [False, True])
def test_an_answer_does_not_depend_on_its_company(learn):
    """On any axis, to the last bit."""
    templates, tests = made()
    whole = answered(templates, tests, learn=learn)
    for place in np.ndindex(len(ORDERS), len(LEVELS), len(FRAMES), 2, 2):
        axes = (ORDERS, LEVELS, FRAMES, LABELS, SCORES)
        one = [(values[at],) for values, at in zip(axes, place, strict=True)]
        alone = answered(templates, tests, *one, learn=learn)
        for name, values in alone.items():
            np.testing.assert_array_equal(values[0, 0, 0, 0, 0], whole[name][place], err_msg=name)


@pytest.mark.parametrize("learn", [False, True])
def test_the_stages_are_the_network(learn):
    """Trained in every order and tested with the same maps, one after the other."""
    templates, tests = made()
    found = answered(templates, tests, labels=("majority",), scores=("ship",), learn=learn)
    _, formed, _ = trained(templates, ORDERS, LEVELS, ("majority",))
    ship = np.repeat(np.arange(len(SHIPS)), len(ASPECTS))
    shared = False
    for o, order in enumerate(ORDERS):
        turn = presentation_order(VIEWS, order, SEED)
        for v, level in enumerate(LEVELS):
            network = AdaptiveClusteringNetwork(vigilance=level, **TRAINED)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                network.fit(templates.reshape(VIEWS, -1)[turn] / 255, ship[turn])
            labels = formed["training_category"][o, v].ravel()
            np.testing.assert_array_equal(labels[turn], network.labels_)
            shared |= 3 < labels.max() + 1 < VIEWS
            for f in range(len(FRAMES)):
                if learn:
                    network.fit(templates.reshape(VIEWS, -1)[turn] / 255, ship[turn])
                shown = tests[f].reshape(VIEWS, -1) / 255
                category, cosine = network.match(shown, learning=learn)
                place = (o, v, f, 0, 0)
                np.testing.assert_array_equal(found["category"][place].ravel(), category)
                # Maps are float32, cosines of which are good to 1e-7.
                np.testing.assert_allclose(found["similarity"][place].ravel(), cosine, atol=1e-6)
                named = network.category_labels_[category]
                np.testing.assert_array_equal(found["predicted"][place].ravel(), named)
                np.testing.assert_array_equal(found["correct"][place].ravel(), named == ship)
    assert shared
    assert 0 < found["correct"].mean() < 1


def test_an_empty_silhouette_names_no_ship_which_is_wrong():
    templates, tests = made()
    tests[0, 1, 2] = 0
    found = answered(templates, tests, scores=("ship",))
    at = (..., 0, slice(None), 0, 1, 2)
    for name, wanted in (("category", -1), ("predicted", -1), ("correct", 0), ("cell", 1)):
        assert (found[name][at] == wanted).all(), name


def test_views_that_are_not_there_and_ships_that_are_not_learned():
    templates, tests = made()
    there = np.ones((3, 4), dtype=bool)
    there[0, 3] = False
    templates[0, 3] = tests[:, 0, 3] = 0  # as the engine fills them
    found = answered(templates, tests, there=there, unknown=("b",), training_aspect=ASPECTS[::2])
    asked = np.zeros((3, 4), dtype=bool)
    asked[np.ix_([0, 2], [0, 2])] = True
    wanted = np.where(asked, 1, -1)
    wanted[0, 3] = 0
    assert (found["cell"][:, :, :, :, 0] == wanted).all()
    assert (found["cell"][:, :, :, :, 1] == there).all()
    assert set(np.unique(found["predicted"][..., there])) == {0, 2}
    assert np.isnan(found["similarity"][..., ~there]).all()


def test_maps_are_shares_of_their_cells():
    maps = np.arange(24, dtype=np.uint8).reshape(1, 2, 1, 3, 4) * 11
    found = map_vectors(maps)
    assert found.shape == (1, 2, 12)
    np.testing.assert_allclose(found.ravel(), np.arange(24) * 11 / 255, rtol=1e-6)


# Tables

NAMED, SEEN = ["duncan", "texas"], [0.0, 15.0, 45.0]  # pooled as 0-15 and 45
Z = 1.959963984540054  # standard deviations within which a Gaussian has 95 %

# Right answers by ship (down) and aspect (across) at two phases and two orders.
RIGHT = [
    [[[1, 1, 1], [1, 1, 1]], [[1, 0, 1], [1, 0, 0]]],
    [[[0, 0, 0], [0, 0, 1]], [[1, 1, 0], [1, 1, 0]]],
]
# The same by bin: 4/4, 2/4, 0/4, 4/4 and 2/2, 1/2, 1/2, 0/2 and 6/6, 3/6, 1/6, 4/6.
MEAN, SPREAD, N = [5 / 8, 1 / 2, 7 / 12], [0.414578, 0.353553, 0.300463], [4, 2, 6]


@pytest.fixture(autouse=True)
def no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        yield


def wilson(fraction, n):
    """The interval as its middle and half its width."""
    middle = (fraction + Z**2 / (2 * n)) / (1 + Z**2 / n)
    half = Z * math.sqrt(fraction * (1 - fraction) / n + Z**2 / (4 * n**2)) / (1 + Z**2 / n)
    return middle - half, middle + half


def classified(right, formed=((2, 3), (4, 3))):
    """Answers as a store has them: one test, whose training is as right; -1 is no answer."""
    right = np.asarray(right, dtype="i1")
    there = right >= 0
    # Categories 0 to formed - 1, in turn.
    category = np.arange(6).reshape(2, 3) % np.asarray(formed)[:, :, None, None]
    trainings = ("phase", "order", "vigilance", "ship", "aspect")
    tests = ("phase", "order", "vigilance", "range", "super_resolution", "frame_count")
    return xr.Dataset(
        {
            "training_category": (trainings, np.where(there, category, -1)[:, :, None]),
            "training_correct": (trainings, right[:, :, None]),
            "training_confused": (trainings, np.where(there, 0, -1)[:, :, None]),
            "correct": ((*tests, "ship", "aspect"), right[:, :, None, None, None, None]),
            "passes": (trainings[:3], np.where(there.any((2, 3)), 5, 0)[:, :, None]),
        },
        {
            "ship": NAMED,
            "aspect": SEEN,
            "phase": [0, 1],
            "order": [0, 1],
            "vigilance": [0.87],
            "range": [50.0],
            "super_resolution": ["shifted"],
            "frame_count": [16],
            "learning_rate": 0.1,
        },
    )


def tabulated(right, **given):
    choices = choose(grid__ship=NAMED, grid__aspect=SEEN, classifier__name="acn", **given)
    return tabulate_silhouettes(classified(right), choices)


def without(phase=None, aspect=None):
    """Those answers without a phase or an aspect."""
    right = np.array(RIGHT, dtype="i1")
    if phase is not None:
        right[phase] = -1
    if aspect is not None:
        right[..., aspect] = -1
    return right


def accuracy(tables, prefix):
    """Mean, spread, both ends of the interval and number, by bin, of the one cell."""
    names = ("accuracy", "spread", "ci_low", "ci_high", "n")
    return [tables[prefix + name].values.reshape(-1) for name in names]


@pytest.mark.parametrize("prefix", ["", "training_"])
def test_mean_spread_interval_and_number(prefix):
    tables = tabulated(RIGHT)
    assert tables.aspect_bin.values.tolist() == ["0-15", "45", "overall"]
    mean, spread, low, high, n = accuracy(tables, prefix)
    np.testing.assert_allclose(mean, MEAN, rtol=1e-12)
    np.testing.assert_allclose(spread, SPREAD, atol=1e-6)
    assert n.tolist() == N
    for k in range(3):
        assert (low[k], high[k]) == pytest.approx(wilson(MEAN[k], N[k]), rel=1e-12)


@pytest.mark.parametrize("prefix", ["", "training_"])
@pytest.mark.parametrize(
    ("failed", "means", "spreads"),
    [(0, [1 / 2, 1 / 4, 5 / 12], [1 / 2, 1 / 4, 1 / 4]), (1, [3 / 4] * 3, [1 / 4] * 3)],
)
def test_a_phase_that_failed_is_left_out(prefix, failed, means, spreads):
    mean, spread, low, high, n = accuracy(tabulated(without(phase=failed)), prefix)
    np.testing.assert_allclose(mean, means, rtol=1e-12)
    np.testing.assert_allclose(spread, spreads, rtol=1e-12)
    assert n.tolist() == N  # the views that the other phase saw
    for k in range(3):
        assert (low[k], high[k]) == pytest.approx(wilson(means[k], N[k]), rel=1e-12)


@pytest.mark.parametrize("prefix", ["", "training_"])
def test_a_bin_without_answers_is_unknown_and_the_others_stand(prefix):
    mean, spread, low, high, n = accuracy(tabulated(without(aspect=2)), prefix)
    np.testing.assert_allclose(mean, [MEAN[0], np.nan, MEAN[0]], rtol=1e-12)
    np.testing.assert_allclose(spread, [SPREAD[0], np.nan, SPREAD[0]], atol=1e-6)
    assert n.tolist() == [4, 0, 4]
    assert (low[1], high[1]) == (0, 1)  # nothing is known
    assert (low[0], high[0]) == pytest.approx(wilson(MEAN[0], 4), rel=1e-12)


def test_nothing_answered_at_all():
    tables = tabulated(np.full((2, 2, 2, 3), -1))
    mean, spread, low, high, n = accuracy(tables, "")
    assert np.isnan(mean).all() and np.isnan(spread).all()
    assert n.tolist() == [0, 0, 0]
    assert (low == 0).all() and (high == 1).all()
    assert not tables.category_count.any() and not tables.settled.any()


def test_categories_are_those_of_the_trainings_there_are():
    tables = tabulated(without(phase=0))
    np.testing.assert_array_equal(tables.category_count[..., 0], [[0, 0], [4, 3]])
    np.testing.assert_array_equal(tables.view_count[..., 0], [[0, 0], [6, 6]])
    np.testing.assert_array_equal(tables.settled[..., 0], [[0, 0], [1, 1]])


def test_unknown_ships_are_not_in_the_tables():
    mean, _, _, _, n = accuracy(tabulated(RIGHT, classifier__unknown="texas"), "")
    assert n.tolist() == [2, 1, 3]
    # Of duncan alone: 2/2, 1/2, 0/2, 2/2 and 1, 1, 0, 0.
    np.testing.assert_allclose(mean[:2], [5 / 8, 1 / 2])
