"""Detection by threshold: closed forms against draws, limits and extremes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from ncti.infrared import detection_probability, detection_threshold, thermal_images

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
    detections = np.count_nonzero(ships.max(axis=1) > threshold)
    expected = detection_probability(pixels, **SENSOR)
    assert stats.binomtest(detections, len(ships), expected).pvalue > LEVEL / 3


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
