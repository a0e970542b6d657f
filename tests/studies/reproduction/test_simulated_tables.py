"""Simulated tables agree with tables of sweeps, and their parts with plain computations."""

from functools import cache

import numpy as np
import pytest
from scipy import ndimage

from ncti.article import SHIPS
from ncti.infrared.imager import Imager
from ncti.ladar import frame_moments, range_extent, sample_frames
from ncti.render import line_image
from ncti.ships import load
from studies.reproduction.categories import acn_scores, presentation_orders
from studies.reproduction.profiles import averaged_profiles
from studies.reproduction.setting import draw, reproduce
from studies.reproduction.silhouettes import _segmented_silhouettes
from studies.reproduction.simulated import Simulated, percent_by_bin

NOMINAL = {
    **{"depression": "fixed", "place_right": 0.0, "place_up": 0.0, "moved": False},
    **{f"variant_{ship}": 0 for ship in SHIPS},
    **{"target_free_ifovs": 4000.0, "cnr": 32.0, "ifov": 150, "floor": "edges"},
    **{"reflectance": "projected_area", "normalisation": "peak", "learning_rate": 0.1},
    **{"order": "ships", "learn_in_test": True, "label_rule": "majority"},
    **{"mnn_tolerance": 0.35, "mnn_epochs": 1000.0, "mnn_learning_rate": 0.015},
    **{"mnn_annealing": True, "mnn_scaling": "common", "inner_radius": 0.5},
    **{"interpolation": "nearest", "coverage_rule": 0.25, "segmentation": "matched"},
    **{"threshold": 0.5, "target_spread": 0.1, "sea_spread": 0.1},
}
"""The defaults of sweeps."""

SIGNAL = {"pulse_width": 30e-9, "cnr": 10**3.2}
ASPECTS = np.arange(0, 91, 3)
ship = cache(load)


@cache
def view(name, aspect, depression):
    return draw(ship(name), aspect, depression)


@cache
def extent(name, aspect):
    lines = line_image(ship(name), aspect=aspect, depression=3.84, spacing=0.5)
    return range_extent(lines, slant_range=1e5)


def test_averages_have_frame_moments_and_share_first_frames():
    """Means, variances and covariances with a longer average are exact within 5 errors."""
    count, frames = 4000, (32, 8)
    ship_extent = extent("duncan", 60.0)
    averages = averaged_profiles(
        ship_extent,
        **SIGNAL,
        target_free_ifovs=100,
        frame_counts=frames,
        draws=count,
        rng=np.random.default_rng(3),
    )
    mean, covariance = frame_moments(ship_extent, **SIGNAL, target_free_ifovs=100)
    variance = np.diag(covariance)
    off = averages - mean
    for k, frame_count in enumerate(frames):
        assert np.abs(off[:, k].mean(axis=0) / np.sqrt(variance / frame_count / count)).max() < 5
        ratio = off[:, k].var(axis=0) * frame_count / variance
        assert np.abs(ratio - 1).max() < 5 * np.sqrt(2 / count)
    # An average of N frames and one of its first n share the n, so the covariance is 1 / N.
    together = (off[:, 0] * off[:, 1]).mean(axis=0) * frames[0] / variance
    assert np.abs(together - 1).max() < 5 * np.sqrt((1 + frames[0] / frames[1]) / count)
    # Neighbouring bins are correlated as in frames.
    pairs = (off[:, 1, 1:] * off[:, 1, :-1]).mean(axis=0) * frames[1]
    error = np.sqrt((variance[1:] * variance[:-1] + np.diag(covariance, 1) ** 2) / count)
    assert (np.abs(pairs - np.diag(covariance, 1)) < 5 * error).all()


def test_percent_by_bin_is_counted_by_hand():
    aspect = np.array([0.0, 27.0, 30.0, 60.0, 90.0, 75.0])
    right = np.array([[1, 0, 1, 1, 1, 0], [0, 0, 0, 1, 1, 1]], bool)
    np.testing.assert_allclose(percent_by_bin(right, aspect), [[50, 100, 200 / 3], [0, 0, 100]])


def test_table_spread_is_the_standard_deviation_of_one_draw():
    scores = Simulated.of([[40.0, 60.0], [60.0, 60.0]])
    np.testing.assert_allclose(scores.mean, [50, 60])
    np.testing.assert_allclose(scores.spread, [np.sqrt(200), 0])


def test_orders_present_ships_or_aspects_first():
    number, aspect = np.repeat([0, 1], 3), np.tile([0.0, 3.0, 6.0], 2)
    rng = np.random.default_rng(5)
    assert presentation_orders("ships", number, aspect, 4, rng)[0].tolist() == [0, 1, 2, 3, 4, 5]
    assert presentation_orders("aspects", number, aspect, 4, rng)[0].tolist() == [0, 3, 1, 4, 2, 5]
    orders = presentation_orders("random", number, aspect, 4, rng)
    assert len(orders) == 4 and all(sorted(order) == [0, 1, 2, 3, 4, 5] for order in orders)


def test_scores_do_not_depend_on_the_index_of_a_view():
    """Views in other places, presented in the same order, have the same scores."""
    rng = np.random.default_rng(6)
    number, aspect = np.repeat(np.arange(4), 9), np.tile(np.linspace(0, 90, 9), 4)
    templates = rng.random((36, 12)) + np.eye(4, 12)[number]
    tests = templates + rng.normal(0, 0.6, (2, 3, 36, 12))
    settings = {
        "vigilance": 0.95,
        "learning_rate": 0.2,
        "label_rule": "first",
        "learn_in_test": True,
    }
    order, shuffled = rng.permutation(36), rng.permutation(36)
    position = np.argsort(shuffled)
    scores = acn_scores(templates, tests, [order], ship=number, aspect=aspect, **settings)
    shuffled_scores = acn_scores(
        templates[shuffled],
        tests[:, :, shuffled],
        [position[order]],
        ship=number[shuffled],
        aspect=aspect[shuffled],
        **settings,
    )
    np.testing.assert_array_equal(scores.mean, shuffled_scores.mean)
    assert 25 < scores.mean[1:].mean() < 100


def test_a_threshold_keeps_the_largest_region_above_it():
    """The mask is the largest region above a plain threshold, with its holes filled."""
    target = np.zeros((6, 16, 40), dtype=bool)
    target[:, 5:10, 6:34] = True
    imager = Imager(0.25, 0.6, 0.0, 0.4, 0.1, 0.1)  # a contrast of four deviations
    settings = {"segmentation": "threshold", "threshold": 0.6}
    masks = _segmented_silhouettes(target, 25e3, imager, settings, 3, np.random.default_rng(8))
    noise = np.random.default_rng(8).standard_normal((3, *target.shape))
    sigma = np.hypot(0.1, 0.4 / 4)
    images = imager.contrast(25e3) * target + sigma * noise
    for mask, image in zip(masks.reshape(-1, 16, 40), images.reshape(-1, 16, 40), strict=True):
        regions, count = ndimage.label(image > 0.6 * imager.contrast(25e3), np.ones((3, 3)))
        largest = np.bincount(regions.ravel())[1:].argmax() + 1
        assert count >= 1
        np.testing.assert_array_equal(mask, ndimage.binary_fill_holes(regions == largest))


def test_defaults_reproduce_the_documented_tables():
    """`docs/reproduction.md` has the tables, of other draws and lines twice as dense.

    They agree within four errors of both means: the page's, and ours of twelve draws.
    """
    tables = reproduce(NOMINAL, aspects=ASPECTS, draws=12, rng=np.random.default_rng(9), view=view)
    assert np.abs(tables["table3"].mean - [31, 19, 16]).max() <= 2
    for name, published, error in (
        ("table2", [68, 41, 34], [1.5, 3.5, 3]),
        ("table4", [76, 68, 34], [2, 3, 0.5]),
    ):
        simulated = tables[name].mean[2]  # 16 frames
        bound = 4 * np.hypot(error, tables[name].spread[2] / np.sqrt(12))
        assert (np.abs(simulated - published) < bound).all(), name
    # One training beside the mean of eight: a view is 2.5 points, and abeam trainings differ.
    assert (np.abs(tables["table2"].mean[0] - [100, 99, 41]) < [1, 3, 12]).all()


@pytest.mark.parametrize(("free", "cnr"), [(0, 60.0), (1000, 10**3.2)])
def test_normal_averages_have_the_accuracy_of_sampled_frames(free, cnr):
    """The largest cosine names a view, from four frames, which are the least normal.

    Shares of two samples of answers to the same views differ by less than four errors.
    """
    views = [(name, aspect) for name in SHIPS for aspect in (0.0, 30.0, 60.0, 90.0)]
    signal = {"pulse_width": 30e-9, "cnr": cnr, "target_free_ifovs": free}
    extents = [extent(*view) for view in views]
    templates = np.array([frame_moments(ship_extent, **signal)[0] for ship_extent in extents])
    templates -= templates[:, :20].mean(axis=1, keepdims=True)
    templates /= np.linalg.norm(templates, axis=1, keepdims=True)
    truth = np.arange(len(views))[:, None]
    count = 150

    def shares(averages):
        above = averages - averages[..., :20].mean(axis=-1, keepdims=True)
        return ((above @ templates.T).argmax(axis=-1) == truth).mean(axis=1)

    rng = np.random.default_rng(4)
    normal = np.array(
        [
            averaged_profiles(ship_extent, **signal, frame_counts=(4,), draws=count, rng=rng)[:, 0]
            for ship_extent in extents
        ]
    )
    sampled = np.array(
        [
            sample_frames(ship_extent, **signal, frame_count=4 * count, rng=rng)
            .reshape(count, 4, -1)
            .mean(axis=1)
            for ship_extent in extents
        ]
    )
    normal_shares, sampled_shares = shares(normal), shares(sampled)
    spread = normal_shares * (1 - normal_shares) + sampled_shares * (1 - sampled_shares)
    error = np.sqrt(spread.mean() / count / len(views))
    assert abs((normal_shares - sampled_shares).mean()) < 4 * error
