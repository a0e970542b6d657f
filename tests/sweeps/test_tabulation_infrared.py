"""Tables of the infrared channel against numbers worked out by hand, failures among them."""

import io
import math
import warnings

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from sweeps.report.naming_figures import draw_formation, draw_table5
from sweeps.report.screen import (
    print_detection,
    print_reconstruction,
    print_silhouette_accuracy,
    print_silhouette_categories,
)
from sweeps.report.silhouettes import (
    detection_rows,
    reconstruction_rows,
    silhouette_accuracy_rows,
    silhouette_category_rows,
)
from sweeps.tabulation import tabulate_images, tabulate_silhouettes

SHIPS, ASPECTS = ["duncan", "texas"], [0.0, 15.0, 45.0]  # pooled as 0-15 and 45
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
    trained = ("phase", "order", "vigilance", "ship", "aspect")
    tested = ("phase", "order", "vigilance", "range", "super_resolution", "frame_count")
    return xr.Dataset(
        {
            "training_category": (trained, np.where(there, category, -1)[:, :, None]),
            "training_correct": (trained, right[:, :, None]),
            "training_confused": (trained, np.where(there, 0, -1)[:, :, None]),
            "correct": ((*tested, "ship", "aspect"), right[:, :, None, None, None, None]),
            "passes": (trained[:3], np.where(there.any((2, 3)), 5, 0)[:, :, None]),
        },
        {
            "ship": SHIPS,
            "aspect": ASPECTS,
            "phase": [0, 1],
            "order": [0, 1],
            "vigilance": [0.87],
            "range": [50.0],
            "super_resolution": ["shifted"],
            "frame_count": [16],
            "learning_rate": 0.1,
            "coverage_rule": 0.25,
            "segmentation": "matched",
            "inner_radius": 0.5,
            "interpolation": "nearest",
        },
    )


def without(phase=None, aspect=None):
    """Those answers without a phase or an aspect."""
    right = np.array(RIGHT, dtype="i1")
    if phase is not None:
        right[phase] = -1
    if aspect is not None:
        right[..., aspect] = -1
    return right


def printed(show, *arguments):
    """What is printed, on a screen that cuts nothing off."""
    console = Console(file=io.StringIO(), width=200)
    show(*arguments, console)
    return console.file.getvalue()


def accuracy(tables, prefix):
    """Mean, spread, both ends of the interval and number, by bin, of the one cell."""
    names = ("accuracy", "spread", "ci_low", "ci_high", "n")
    return [tables[prefix + name].values.reshape(-1) for name in names]


@pytest.mark.parametrize("prefix", ["", "training_"])
def test_mean_spread_interval_and_number(prefix):
    tables = tabulate_silhouettes(classified(RIGHT))
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
    mean, spread, low, high, n = accuracy(
        tabulate_silhouettes(classified(without(phase=failed))), prefix
    )
    np.testing.assert_allclose(mean, means, rtol=1e-12)
    np.testing.assert_allclose(spread, spreads, rtol=1e-12)
    assert n.tolist() == N  # the views that the other phase saw
    for k in range(3):
        assert (low[k], high[k]) == pytest.approx(wilson(means[k], N[k]), rel=1e-12)


@pytest.mark.parametrize("prefix", ["", "training_"])
def test_a_bin_without_answers_is_unknown_and_the_others_stand(prefix):
    mean, spread, low, high, n = accuracy(
        tabulate_silhouettes(classified(without(aspect=2))), prefix
    )
    np.testing.assert_allclose(mean, [MEAN[0], np.nan, MEAN[0]], rtol=1e-12)
    np.testing.assert_allclose(spread, [SPREAD[0], np.nan, SPREAD[0]], atol=1e-6)
    assert n.tolist() == [4, 0, 4]
    assert (low[1], high[1]) == (0, 1)  # nothing is known
    assert (low[0], high[0]) == pytest.approx(wilson(MEAN[0], 4), rel=1e-12)


def test_nothing_answered_at_all():
    tables = tabulate_silhouettes(classified(np.full((2, 2, 2, 3), -1)))
    mean, spread, low, high, n = accuracy(tables, "")
    assert np.isnan(mean).all() and np.isnan(spread).all()
    assert n.tolist() == [0, 0, 0]
    assert (low == 0).all() and (high == 1).all()
    (row,) = silhouette_category_rows(tables)
    assert (row["trainings"], row["training_silhouettes"], row["settled"]) == (0, 0, False)
    assert {row[k] for k in ("categories", "least", "most", "of_first_phase_and_order")} == {None}
    assert "failed" in printed(print_silhouette_categories, [row])


def test_categories_are_those_of_the_trainings_there_are():
    (whole,) = silhouette_category_rows(tabulate_silhouettes(classified(RIGHT)))
    assert whole["trainings"] == 4
    assert (whole["categories"], whole["least"], whole["most"]) == (3, 2, 4)
    assert whole["of_first_phase_and_order"] == 2
    (half,) = silhouette_category_rows(tabulate_silhouettes(classified(without(phase=0))))
    assert half["trainings"] == 2
    assert (half["categories"], half["least"], half["most"]) == (3.5, 3, 4)
    assert half["of_first_phase_and_order"] is None
    assert half["training_silhouettes"] == 6
    assert half["settled"] is True


@pytest.mark.parametrize(
    "right",
    [RIGHT, without(phase=0), without(phase=1), without(aspect=2), np.full((2, 2, 2, 3), -1)],
    ids=["whole", "first phase failed", "second phase failed", "bin failed", "all failed"],
)
def test_every_table_and_picture_shows_dashes_for_what_is_not_there(right):
    answers = classified(right)
    tables = tabulate_silhouettes(answers)
    rows = silhouette_accuracy_rows(tables)
    text = printed(print_silhouette_accuracy, rows)
    text += printed(print_silhouette_categories, silhouette_category_rows(tables))
    assert "nan" not in text.lower()
    assert "inf" not in text.lower()
    unknown = sum(row["percent_correct"] is None for row in rows)
    assert text.count("–") >= unknown
    assert {row["n"] for row in rows if row["percent_correct"] is None} <= {0}
    assert "nan" not in draw_formation(answers).get_suptitle()
    assert draw_table5(tables, ships=2).get_suptitle()


def test_a_failed_training_forms_no_categories_in_the_picture():
    title = draw_formation(classified(without(phase=1))).get_suptitle()
    assert "which form 2 to 3" in title


def test_shifted_images_are_said_to_take_four_times_the_frames():
    tables = tabulate_silhouettes(classified(RIGHT))
    rows = silhouette_accuracy_rows(tables)
    assert {(row["silhouettes"], row["frame_count"], row["frames_in_all"]) for row in rows} == {
        ("training", None, None),
        ("cut out", 16, 64),
    }
    assert "50 km, shifted, 4 x 16 " in printed(print_silhouette_accuracy, rows)
    title = draw_table5(tables, ships=2).get_suptitle()
    assert "16 frames (4 × 16 where shifted)" in title
    plain = tabulate_silhouettes(classified(RIGHT).assign_coords(super_resolution=["perfect"]))
    rows = silhouette_accuracy_rows(plain)
    assert {row["frames_in_all"] for row in rows} == {None, 16}
    assert "50 km, perfect " in printed(print_silhouette_accuracy, rows)
    assert "4 ×" not in draw_table5(plain, ships=2).get_suptitle()


def images(found, error):
    """A store's group of images: (ship, aspect, phase) of one range and number of frames."""
    found, error = np.asarray(found, "f4"), np.asarray(error, "f4")
    return xr.Dataset(
        {
            "detection_probability": (
                ("ship", "aspect", "phase", "range", "frame_count"),
                found[..., None, None],
            ),
            "reconstruction_error": (
                ("ship", "aspect", "phase", "range", "super_resolution", "frame_count"),
                error[..., None, None, None],
            ),
        },
        {
            "ship": SHIPS,
            "aspect": ASPECTS,
            "phase": [0, 1],
            "range": [100.0],
            "super_resolution": ["shifted"],
            "frame_count": [16],
            "coverage_rule": 0.25,
        },
    )


NONE = np.nan
FOUND = [[[0.5, 1.0], [0.25, 0.25], [0.0, 1.0]], [[NONE, NONE], [0.5, 0.5], [1.0, 1.0]]]
ERROR = [[[1.0, 3.0], [2.0, 2.0], [1.0, 3.0]], [[NONE, NONE], [1.0, 3.0], [1.0, 3.0]]]


def test_images_of_a_view_that_failed_are_left_out():
    detection, restored = tabulate_images(images(FOUND, ERROR))
    # 0-15: 0.5 + 1 + 0.25 + 0.25 + 0.5 + 0.5 = 3 of 6; 45: 3 of 4; overall: 6 of 10.
    assert detection.aspect_bin.values.tolist() == ["0-15", "45", "overall"]
    np.testing.assert_allclose(detection.probability.values.reshape(-1), [0.5, 0.75, 0.6])
    np.testing.assert_allclose(detection.lowest.values.reshape(-1), [0.25, 0.0, 0.0])
    # Four pairs of 1 and 3, and 2 twice: the mean is 2, the variance 8 / 10.
    assert restored.error.item() == pytest.approx(2)
    assert restored.error_spread.item() == pytest.approx(math.sqrt(0.8), rel=1e-6)


def test_a_bin_and_a_cell_without_images_show_dashes():
    found = np.array(FOUND)
    found[:, 2] = NONE
    detection, restored = tabulate_images(images(found, np.full((2, 3, 2), NONE)))
    np.testing.assert_allclose(detection.probability.values.reshape(-1), [0.5, NONE, 0.5])
    rows = detection_rows(detection)
    assert [row["probability"] for row in rows] == [0.5, None, 0.5]
    assert [row["lowest_of_views"] for row in rows] == [0.25, None, 0.25]
    (row,) = reconstruction_rows(restored)
    assert (row["error"], row["spread"], row["frames_in_all"]) == (None, None, 64)
    text = printed(print_reconstruction, [row])
    assert "–" in text and "nan" not in text and "shifted 2x, 4 x frames" in text


def test_nothing_detected_because_nothing_was_seen():
    nothing = np.full((2, 3, 2), NONE)
    detection, _ = tabulate_images(images(nothing, nothing))
    text = printed(
        lambda rows, console: print_detection(rows, 1e-6, console), detection_rows(detection)
    )
    assert "–" in text and "nan" not in text


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_an_error_without_end_is_no_figure(value):
    _, restored = tabulate_images(images(FOUND, ERROR))
    (row,) = reconstruction_rows(xr.full_like(restored, value))
    assert (row["error"], row["spread"]) == (None, None)
