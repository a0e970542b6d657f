"""First- and peak-pulse receivers keep the right pulses, at the stated false-alarm rate."""

from dataclasses import replace

import numpy as np
import pytest
from plates import plane
from scipy import stats

from ncti.ladar import expected_profile, range_extent, sample_frames
from ncti.ladar.receivers import detect

CNR = 10**3.2


def test_receivers_keep_the_first_the_peak_or_all_pulses():
    waveform = np.array([[0.5, 9.0, 2.0, 30.0, 1.0], [0.1, 0.2, 0.3, 0.2, 0.1]])
    detected = {name: detect(waveform, receiver=name) for name in ("first_pulse", "peak_pulse")}
    np.testing.assert_array_equal(detected["first_pulse"], [[0, 9.0, 0, 0, 0], [0, 0, 0, 0, 0]])
    np.testing.assert_array_equal(detected["peak_pulse"], [[0, 0, 0, 30.0, 0], [0, 0, 0.3, 0, 0]])
    np.testing.assert_array_equal(detect(waveform, receiver="full_profile"), waveform)


def test_default_false_alarm_rate_is_one_in_a_million():
    rayleigh = stats.rayleigh(scale=(np.pi / 8) ** 0.25)  # variance sqrt(pi/8) in each quadrature
    just_below, just_above = (np.array([rayleigh.isf(rate)]) for rate in (1.001e-6, 0.999e-6))
    assert not detect(just_below, receiver="first_pulse").any()
    assert detect(just_above, receiver="first_pulse").all()


@pytest.mark.parametrize("receiver", ["first_pulse", "peak_pulse"])
def test_perpendicular_face_gives_a_single_spike(receiver):
    extent = range_extent(plane(width=30, height=30, offset=0.5), slant_range=1e8, ifov=150e-9)
    profile = expected_profile(extent, pulse_width=30e-9, cnr=CNR, receiver=receiver)
    assert np.count_nonzero(profile) == 1
    assert abs(int(np.argmax(profile)) - 125) <= 6


def test_false_alarm_rate_of_the_first_pulse_threshold():
    """Binomial test at 1e-3 of a 1 % rate over 60,000 frames of one noisy bin of one IFOV."""
    extent = range_extent(plane(width=4, height=4), slant_range=1e5, window=40.0)
    extent = replace(extent, fraction=extent.fraction[:1], cell=extent.cell[:1])
    frames = sample_frames(
        extent, pulse_width=10e-9, cnr=0.0, frame_count=60_000, rng=np.random.default_rng(3)
    )
    alarms = np.count_nonzero(detect(frames[:, [10]], receiver="first_pulse", false_alarm=0.01))
    assert stats.binomtest(alarms, 60_000, 0.01).pvalue > 1e-3


def test_too_many_individually_drawn_ifovs_are_refused():
    extent = range_extent(plane(width=4, height=4), slant_range=1e5, window=40.0)
    with pytest.raises(
        ValueError, match=r"^target_free_ifovs is 200000, .* for the receiver first"
    ):
        sample_frames(
            extent,
            pulse_width=10e-9,
            cnr=CNR,
            frame_count=1,
            target_free_ifovs=200_000,
            receiver="first_pulse",
            rng=np.random.default_rng(0),
        )
