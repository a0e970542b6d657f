"""Segmentation of the active images: what stays, and how seldom noise alone does."""

import math

import numpy as np
import pytest
from flown import flight
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import integrate, optimize, stats

from ncti.irar.chain import FALSE_ALARM
from ncti.irar.looks import average
from ncti.irar.receiver import peaks
from ncti.irar.scene import Returns
from ncti.irar.segmentation import noise_threshold, segment

PULSE = 4.5  # metres

powers = st.one_of(st.floats(0, 100), st.sampled_from([0.0, 5.0, math.nan]))
metres = st.one_of(st.floats(-130, 130), st.just(math.nan))


@given(
    arrays(float, (3, 4), elements=powers),
    arrays(float, (3, 4), elements=metres),
    st.one_of(st.just(5.0), arrays(float, (3, 4), elements=st.floats(0, 100))),
)
def test_what_reaches_the_threshold_stays(intensity, down_range, threshold):
    kept, where = segment(intensity, down_range, threshold=threshold)
    least = np.broadcast_to(threshold, (3, 4))
    for at in np.ndindex(3, 4):
        ship = intensity[at] >= least[at]
        assert kept[at] == (intensity[at] if ship else 0)
        np.testing.assert_equal(where[at], down_range[at] if ship else math.nan)
    again = segment(kept, where, threshold=threshold)
    np.testing.assert_array_equal(again, (kept, where))


def test_pixels_without_a_look_are_no_ship_even_at_threshold_zero():
    intensity, down_range = segment([math.nan, 0.0], [3.0, 4.0], threshold=0.0)
    np.testing.assert_array_equal(intensity, [0.0, 0.0])
    np.testing.assert_array_equal(down_range, [math.nan, 4.0])


def test_inputs_are_left_alone():
    intensity, down_range = np.array([1.0, 9.0]), np.array([3.0, 4.0])
    segment(intensity, down_range, threshold=5.0)
    np.testing.assert_array_equal((intensity, down_range), [[1.0, 9.0], [3.0, 4.0]])


def tail(level, depth):
    """Probability that noise of a depth, in pulse lengths, exceeds levels, kept when tiny."""
    level = np.asarray(level, float)
    rate = np.sqrt(4 * level / math.pi) * np.exp(-level) / -np.expm1(-level)
    return -np.expm1(np.log1p(-np.exp(-level)) - depth * rate)


def threshold(looks, depth, **others):
    given = {"pulse_length": PULSE, "dropout": 0.0, "false_alarm": 1e-3} | others
    return noise_threshold(looks, depth=depth * PULSE, **given)


@pytest.mark.parametrize("false_alarm", [1e-9, 1e-4, 0.3])
@pytest.mark.parametrize("depth", [0.0, 3.0, 67.0, 1e6])
@pytest.mark.parametrize("dropout", [0.0, 0.3, 4.0, 15.0])
def test_threshold_of_one_look_is_the_quantile_of_the_noise_peak(depth, dropout, false_alarm):
    """Or the least that is reported; between edges 1/32 apart the tail bends by some 1e-4."""
    expected = optimize.brentq(lambda u: tail(u, depth) - false_alarm, 0.01, 60, xtol=1e-12)
    found = threshold(1, depth, dropout=dropout, false_alarm=false_alarm)
    assert found == pytest.approx(max(expected, dropout), abs=2e-4)


@pytest.mark.parametrize("false_alarm", [1e-9, 1e-3, 0.3])
@pytest.mark.parametrize("dropout", [0.0, 0.01, 0.5, 4.0])
@pytest.mark.parametrize("looks", [2, 10, 300])
def test_threshold_of_a_gate_without_depth_is_that_of_exponential_looks(
    looks, dropout, false_alarm
):
    """Of so many reports, a binomial number, what is over the dropouts sums to a gamma."""
    reports = np.arange(1, looks + 1)
    chance = stats.binom.pmf(reports, looks, math.exp(-dropout))

    def above(total):
        return chance @ stats.gamma.sf(total - reports * dropout, reports)

    expected = dropout  # any report is too much
    if above(dropout) > false_alarm:
        expected = optimize.brentq(lambda s: above(s) - false_alarm, 0, 20 * looks + 60)
    found = threshold(looks, 0.0, dropout=dropout, false_alarm=false_alarm)
    # The grid adds a variance of (1/32)^2 / 12 to each look's 1: 8e-5.
    assert found == pytest.approx(expected / looks, rel=1e-4)


@pytest.mark.parametrize("dropout", [0.0, 4.0, 8.0, 12.0])
@pytest.mark.parametrize("depth", [3.0, 67.0, 1300.0])
def test_threshold_of_two_looks_by_direct_integration(depth, dropout):
    """Either of them reported alone, or both; thresholds within 1e-5 are alarms within 1e-3."""
    total = 2 * float(threshold(2, depth, dropout=dropout))
    reported = tail(max(dropout, 1e-9), depth)
    if 1 - (1 - reported) ** 2 < 1e-3:
        assert total == dropout
        return
    levels = np.linspace(max(dropout, 1e-9), max(total - dropout, dropout), 100_001)
    at = tail(levels, depth)
    one = 2 * (1 - reported) * tail(total, depth)
    # The first up to total - dropout with a second that is large enough, or beyond with any.
    both = -np.diff(at) @ tail(total - (levels[1:] + levels[:-1]) / 2, depth)
    both += at[-1] * reported
    assert one + both == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize("looks", [1000, 100_000])
@pytest.mark.parametrize("dropout", [0.0, 4.0, 8.0])
@pytest.mark.parametrize("depth", [11.0, 67.0])
def test_many_looks_leave_the_pedestal_of_noise_peaks(depth, dropout, looks):
    """The mean of one look, plus the Gaussian quantile with its correction for skewness."""
    levels = np.linspace(max(dropout, 1e-9), 60, 200_001)
    at = tail(levels, depth)
    moments = [
        levels[0] ** k * at[0] + integrate.trapezoid(k * levels ** (k - 1) * at, levels)
        for k in (1, 2, 3)
    ]
    mean = moments[0]
    sigma = math.sqrt(moments[1] - mean**2)
    skewness = (moments[2] - 3 * mean * sigma**2 - mean**3) / sigma**3
    z = stats.norm.isf(1e-3)
    error = sigma / math.sqrt(looks)
    expected = mean + error * (z + skewness * (z**2 - 1) / 6 / math.sqrt(looks))
    # What follows goes with 1 / looks, by moments that rare reports make large; the grid moves a
    # mean by up to (1/32)^2 / 12 of a density.
    left = 5 * (1 + skewness**2) / looks * error + 4e-5
    assert threshold(looks, depth, dropout=dropout) == pytest.approx(expected, abs=left)
    if (depth, dropout) == (67.0, 0.0):
        assert mean == pytest.approx(5.8, abs=0.05)


@pytest.mark.parametrize("dropout", [0.0, 1.0, 4.0])
@pytest.mark.parametrize("depth", [67.0, 200.0, 1300.0])
def test_more_looks_lower_the_threshold(depth, dropout):
    """Where most peaks are reported: of rare reports one more that fits raises the sum by steps."""
    found = threshold(np.arange(1, 61), depth, dropout=dropout)
    assert (np.diff(found) < 0).all()


def test_looks_are_worked_out_one_by_one():
    """Whatever else is asked, and in any order; a wider window changes rounding only."""
    looks = np.array([[7, 1, 60], [2, 7, 1]])
    found = threshold(looks, 67.0, dropout=4.0)
    alone = [[threshold(n, 67.0, dropout=4.0) for n in row] for row in looks.tolist()]
    np.testing.assert_allclose(found, alone, rtol=1e-6)
    assert threshold([], 67.0).shape == (0,)


@pytest.mark.parametrize("dropout", [14.0, 40.0, 1e9])
def test_reports_rarer_than_false_alarms_pass_one_by_one(dropout):
    looks = np.array([1, 2, 3])
    assert 1 - (1 - tail(dropout, 11.0)) ** 3 < 1e-3
    np.testing.assert_allclose(threshold(looks, 11.0, dropout=dropout), dropout / looks)


@pytest.mark.parametrize("looks", [1, 8, 30])
@pytest.mark.parametrize(
    "change",
    [
        {},
        *({"range_gate": depth} for depth in (50.0, 2000.0)),
        *({"pulse_width": width} for width in (10e-9, 100e-9)),
        *({"threshold": least} for least in (0.0, 8.0, 12.0)),
    ],
)
def test_the_sea_reaches_its_threshold_as_seldom_as_stated(change, looks):
    """50,000 averages of the receiver's own looks at the sea: binomial, 1e-3 over the 24 cases."""
    seen = flight(**change)
    shape = (50_000, looks)
    nothing = Returns(shape, *[np.empty(0, np.intp)] * 2, *[np.empty(0)] * 2, 9)
    speckle = np.empty((*shape, 0), np.complex64)
    rng = np.random.default_rng(looks)
    intensity, range_ = peaks(nothing, speckle, np.full(shape, 3900.0), flight=seen, rng=rng)
    index = np.arange(intensity.size).reshape(-1, 1, looks)
    least = noise_threshold(
        looks,
        depth=seen.range_gate,
        pulse_length=seen.pulse_length,
        dropout=seen.threshold,
        false_alarm=FALSE_ALARM,
    )
    image = average(intensity, index)
    kept, _ = segment(image, average(range_, index), threshold=least)
    alarms = np.count_nonzero(kept)
    assert stats.binomtest(alarms, image.size, FALSE_ALARM).pvalue > 1e-3 / 24


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depth": -1.0}, r"depth is -1\.0"),
        ({"pulse_length": 0.0}, r"pulse_length is 0\.0"),
        ({"dropout": math.nan}, "dropout is nan"),
        ({"looks": 0}, "looks is 0"),
        ({"looks": 2.5}, r"looks is 2\.5"),
        ({"false_alarm": 0.0}, r"false_alarm is 0\.0"),
        ({"false_alarm": 0.7}, r"false_alarm is 0\.7"),
    ],
)
def test_bad_noise_is_named(change, message):
    given = {
        "looks": 10,
        "depth": 300.0,
        "pulse_length": PULSE,
        "dropout": 4.0,
        "false_alarm": 0.01,
    } | change
    with pytest.raises(ValueError, match=message):
        noise_threshold(**given)


@pytest.mark.parametrize(
    ("down_range", "threshold", "message"),
    [
        ([1.0], 5.0, r"range_ has shape \(1,\)"),
        ([1.0, 2.0], [5.0, 5.0, 5.0], r"threshold has shape \(3,\)"),
        ([1.0, 2.0], -1.0, r"threshold is -1\.0"),
        ([1.0, 2.0], math.nan, "threshold is nan"),
    ],
)
def test_bad_images_are_named(down_range, threshold, message):
    with pytest.raises(ValueError, match=message):
        segment([7.0, 8.0], down_range, threshold=threshold)
