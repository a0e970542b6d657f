"""Detection by threshold: closed forms against draws, limits and extremes."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from ncti.infrared import (
    contrast,
    detection_probability,
    detection_threshold,
    noise_temperature,
    thermal_images,
)

LEVEL = 1e-3
SENSOR = {"contrast": 0.3, "target_sigma": 0.2, "sea_sigma": 0.15, "false_alarm": 1e-2}


def test_false_alarm_rate():
    """A binomial test at 1e-3 of 2.5 million pixels of sea."""
    (sea,) = thermal_images(
        np.zeros((1600, 1600), bool),
        contrast=1.0,
        frame_counts=(16,),
        rng=np.random.default_rng(0),
    )
    for false_alarm in (0.1, 1e-2, 1e-3):
        threshold = detection_threshold(false_alarm=false_alarm, sigma=np.hypot(0.1, 0.1))
        alarms = np.count_nonzero(sea > threshold)
        assert stats.binomtest(alarms, sea.size, false_alarm).pvalue > LEVEL / 3


@pytest.mark.parametrize("pixels", [1, 3, 12])
def test_probability_by_drawing(pixels):
    """A binomial test at 1e-3 of 200,000 ships drawn from the target's Gaussian."""
    rng = np.random.default_rng(pixels)
    threshold = detection_threshold(false_alarm=1e-2, sigma=0.15)
    ships = rng.normal(0.3, 0.2, (200_000, pixels))
    seen = np.count_nonzero(ships.max(axis=1) > threshold)
    expected = detection_probability(pixels, **SENSOR)
    assert stats.binomtest(seen, len(ships), expected).pvalue > LEVEL / 3


def test_probability_by_whole_images():
    """The same of 4,000 thermal images with a ship of five pixels."""
    target = np.zeros((3, 7), bool)
    target[1, 1:6] = True
    rng = np.random.default_rng(7)
    sigma = np.hypot(0.1, 0.1)
    threshold = detection_threshold(false_alarm=1e-3, sigma=sigma)
    seen = 0
    for _ in range(4000):
        (thermal,) = thermal_images(target, contrast=0.27, frame_counts=(16,), rng=rng)
        seen += bool((thermal[target] > threshold).any())
    expected = detection_probability(
        target, contrast=0.27, target_sigma=sigma, sea_sigma=sigma, false_alarm=1e-3
    )
    assert stats.binomtest(seen, 4000, expected).pvalue > LEVEL


def test_closed_form_of_one_pixel():
    threshold = detection_threshold(false_alarm=1e-2, sigma=0.15)
    assert threshold == pytest.approx(0.15 * stats.norm.isf(1e-2), rel=1e-14)
    assert detection_probability(1, **SENSOR) == pytest.approx(
        stats.norm.sf((threshold - 0.3) / 0.2), rel=1e-14
    )


@given(
    pixels=st.integers(0, 10**6),
    false_alarm=st.floats(1e-300, 0.5),
    sigma=st.floats(1e-12, 1e12),
)
def test_without_contrast_only_false_alarms(pixels, false_alarm, sigma):
    """1 - (1 - pfa)^n, to the digits of the smallest probabilities."""
    ours = detection_probability(
        pixels, contrast=0.0, target_sigma=sigma, sea_sigma=sigma, false_alarm=false_alarm
    )
    expected = -np.expm1(pixels * np.log1p(-false_alarm))
    # Q(Q^-1(p)): an error e of t is t e in the logarithm, t < 38; sigma cancels to two roundings.
    assert ours == pytest.approx(expected, rel=38 * 40 * 1e-15, abs=0.0 if pixels else 1e-300)


def test_limits():
    assert detection_probability(0, **SENSOR) == 0.0
    assert detection_probability(np.zeros((4, 4), bool), **SENSOR) == 0.0
    assert detection_probability(5, **SENSOR | {"contrast": 1e9}) == 1.0
    assert detection_probability(5, **SENSOR | {"contrast": -1e9}) == 0.0
    assert detection_threshold(false_alarm=0.5, sigma=3.0) == 0.0
    target = np.eye(6, dtype=bool)
    assert detection_probability(target, **SENSOR) == detection_probability(6, **SENSOR)
    assert type(detection_probability(target, **SENSOR)) is float


def test_falls_with_range_and_grows_with_frames_and_pixels():
    def probability(slant_range, frame_count, pixels=5):
        sigma = float(np.hypot(0.1, noise_temperature(frame_count)))
        return detection_probability(
            pixels,
            contrast=contrast(slant_range),
            target_sigma=sigma,
            sea_sigma=sigma,
            false_alarm=1e-4,
        )

    by_range = [probability(r, 16) for r in np.linspace(70e3, 400e3, 40)]
    assert np.all(np.diff(by_range) < 0)
    by_frames = [probability(100e3, n) for n in (1, 2, 4, 8, 16, 32, 64)]
    assert np.all(np.diff(by_frames) > 0)
    by_pixels = [probability(150e3, 16, n) for n in range(20)]
    assert np.all(np.diff(by_pixels) > 0)


def test_extremes_neither_warn_nor_lose_digits():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Q(7.0345) = 1e-12: Abramowitz and Stegun, table 26.2, by its inverse.
        assert detection_threshold(false_alarm=1e-12, sigma=1.0) == pytest.approx(7.0344838, 1e-7)
        assert detection_threshold(false_alarm=1e-300, sigma=1.0) == pytest.approx(37.0471, 1e-5)
        tiny = detection_probability(
            7, contrast=0.0, target_sigma=1.0, sea_sigma=1.0, false_alarm=1e-12
        )
        assert tiny == pytest.approx(7e-12, rel=1e-11)
        huge = detection_probability(
            1, contrast=0.3, target_sigma=1e12, sea_sigma=1e12, false_alarm=1e-2
        )
        assert huge == pytest.approx(1e-2, rel=1e-10)
        assert detection_probability(10**15, **SENSOR) == 1.0
        assert detection_probability(10**300, **SENSOR | {"contrast": -1e9}) == 0.0
        assert detection_probability(10**300, **SENSOR | {"contrast": 1e9}) == 1.0
        assert detection_probability(1, **SENSOR | {"target_sigma": 1e-300}) == 0.0
        sure = SENSOR | {"target_sigma": 1e-9, "contrast": 1e9}
        assert detection_probability(1, **sure) == 1.0


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"false_alarm": 0.0}, "false_alarm"),
        ({"false_alarm": 1.0}, "false_alarm is 1.0, but must be .* below 1"),
        ({"false_alarm": np.nan}, "false_alarm"),
        ({"sea_sigma": 0.0}, "sea_sigma is 0.0"),
        ({"target_sigma": 0.0}, "target_sigma is 0.0"),
        ({"target_sigma": -1.0}, "target_sigma"),
        ({"contrast": np.inf}, "contrast"),
        ({"target": -1}, "target is -1"),
        ({"target": 1.5}, "target is 1.5"),
        ({"target": None}, "target is None"),
        ({"target": "abc"}, "target is 'abc'"),
        ({"target": "5"}, "target is '5'"),
        ({"target": 10**400}, "target is inf"),
        ({"target": [[True], [True, False]]}, r"target is \[\[True"),
        ({"target": np.array([5, 7])}, "target is an array of int64"),
        ({"target": [5, 7]}, "target is an array of int64"),
        ({"target": np.full((3, 3), np.nan)}, "target is nan"),
    ],
)
def test_nonsense_is_named(parameters, named):
    with pytest.raises(ValueError, match=f"^{named}") as refused:
        detection_probability(**{"target": 3} | SENSOR | parameters)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("pixels", [3, 3.0, np.int32(3), np.array(3)])
def test_a_number_or_a_template_of_any_kind(pixels):
    template = [[True, False, True], [False, True, False]]
    expected = detection_probability(np.array(template), **SENSOR)
    assert detection_probability(template, **SENSOR) == expected
    assert detection_probability(pixels, **SENSOR) == expected


def test_a_threshold_needs_a_sigma():
    with pytest.raises(ValueError, match="sigma is 0"):
        detection_threshold(false_alarm=0.1, sigma=0.0)
