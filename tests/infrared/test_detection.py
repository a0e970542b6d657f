"""Detection by threshold agrees with closed forms down to the smallest probabilities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from ncti.infrared import detection_probability, detection_threshold


@pytest.mark.parametrize("pixels", [1, 3, 12])
def test_ship_is_detected_if_any_pixel_exceeds_threshold(pixels):
    threshold = stats.norm.isf(1e-2, scale=0.15)
    assert detection_threshold(false_alarm=1e-2, sigma=0.15) == pytest.approx(threshold, rel=1e-12)
    sensor = {"contrast": 0.3, "target_sigma": 0.2, "sea_sigma": 0.15, "false_alarm": 1e-2}
    missed = stats.norm.cdf(threshold, 0.3, 0.2) ** pixels
    assert detection_probability(pixels, **sensor) == pytest.approx(1 - missed, rel=1e-12)


@given(
    pixels=st.integers(0, 10**6),
    false_alarm=st.floats(1e-300, 0.5),
    sigma=st.floats(1e-12, 1e12),
)
def test_zero_contrast_gives_only_false_alarms(pixels, false_alarm, sigma):
    """The probability is 1 - (1 - pfa)^n, accurate for the smallest probabilities."""
    ours = detection_probability(
        pixels, contrast=0.0, target_sigma=sigma, sea_sigma=sigma, false_alarm=false_alarm
    )
    expected = -np.expm1(pixels * np.log1p(-false_alarm))
    # Q(Q^-1(p)): an error e of t is t e in the logarithm, t < 38; sigma cancels to two roundings.
    assert ours == pytest.approx(expected, rel=38 * 40 * 1e-15, abs=0.0 if pixels else 1e-300)
