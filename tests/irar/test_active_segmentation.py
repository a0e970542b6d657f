"""The noise threshold of active images has the stated false-alarm probability."""

import math

import numpy as np
import pytest
from flown import flight
from scipy import optimize, stats

from ncti.irar.chain import FALSE_ALARM, sea_level
from ncti.irar.looks import average
from ncti.irar.receiver import peaks
from ncti.irar.scene import Returns
from ncti.irar.segmentation import noise_threshold

PULSE = 4.5  # metres


def tail(level, depth):
    """Return the probability that noise of a depth, in pulse lengths, exceeds levels."""
    level = np.asarray(level, float)
    rate = np.sqrt(4 * level / math.pi) * np.exp(-level) / -np.expm1(-level)
    return -np.expm1(np.log1p(-np.exp(-level)) - depth * rate)


def threshold(looks, depth, **others):
    options = {"pulse_length": PULSE, "dropout": 0.0, "false_alarm": 1e-3} | others
    return noise_threshold(np.array(looks), depth=depth * PULSE, **options)


@pytest.mark.parametrize("false_alarm", [1e-9, 1e-4, 0.3])
@pytest.mark.parametrize("depth", [0.0, 3.0, 67.0, 1e6])
@pytest.mark.parametrize("dropout", [0.0, 0.3, 4.0, 15.0])
def test_single_look_threshold_is_the_noise_peak_quantile(depth, dropout, false_alarm):
    """It is at least the dropout level; interpolation between edges 1/32 apart errs by 1e-4."""
    expected = optimize.brentq(lambda u: tail(u, depth) - false_alarm, 0.01, 60, xtol=1e-12)
    least = threshold(1, depth, dropout=dropout, false_alarm=false_alarm)
    assert least == pytest.approx(max(expected, dropout), abs=2e-4)


@pytest.mark.parametrize("false_alarm", [1e-9, 1e-3, 0.3])
@pytest.mark.parametrize("dropout", [0.0, 0.01, 0.5, 4.0])
@pytest.mark.parametrize("looks", [2, 10, 300])
def test_zero_depth_gate_threshold_matches_exponential_looks(looks, dropout, false_alarm):
    """The number of reports is binomial; their excess over the dropout level sums to a gamma."""
    reports = np.arange(1, looks + 1)
    chance = stats.binom.pmf(reports, looks, math.exp(-dropout))

    def above(total):
        return chance @ stats.gamma.sf(total - reports * dropout, reports)

    expected = dropout  # then any report is a false alarm
    if above(dropout) > false_alarm:
        expected = optimize.brentq(lambda s: above(s) - false_alarm, 0, 20 * looks + 60)
    least = threshold(looks, 0.0, dropout=dropout, false_alarm=false_alarm)
    # The grid adds a variance of (1/32)^2 / 12 = 8e-5 to the unit variance of a look.
    assert least == pytest.approx(expected / looks, rel=1e-4)


@pytest.mark.parametrize(
    "change", [{}, {"range_gate": 2000.0}, {"pulse_width": 100e-9}, {"threshold": 8.0}]
)
def test_sea_level_has_stated_false_alarm_rate(change):
    """Binomial test of 50,000 averages of 30 simulated looks at the sea, 1e-3 over the cases."""
    flown, shape = flight(**change), (50_000, 30)
    nothing = Returns(shape, *[np.empty(0, np.intp)] * 2, *[np.empty(0)] * 2, 9)
    speckle = np.empty((*shape, 0), np.complex64)
    rng = np.random.default_rng(30)
    intensity, _ = peaks(nothing, speckle, np.full(shape, 3900.0), flight=flown, rng=rng)
    level = sea_level(np.array(30), flown)
    alarms = np.count_nonzero(intensity.mean(axis=1, dtype=float) >= level)
    assert stats.binomtest(alarms, len(intensity), 1e-3).pvalue > 1e-3 / 4


@pytest.mark.parametrize("looks", [1, 30])
@pytest.mark.parametrize(
    "change",
    [
        {},
        *({"range_gate": depth} for depth in (50.0, 2000.0)),
        *({"pulse_width": width} for width in (10e-9, 100e-9)),
        *({"threshold": least} for least in (0.0, 8.0, 12.0)),
    ],
)
def test_noise_threshold_has_stated_false_alarm_rate(change, looks):
    """Binomial test of 50,000 averages of simulated looks at the sea, 1e-3 over the 16 cases."""
    flown = flight(**change)
    shape = (50_000, looks)
    nothing = Returns(shape, *[np.empty(0, np.intp)] * 2, *[np.empty(0)] * 2, 9)
    speckle = np.empty((*shape, 0), np.complex64)
    rng = np.random.default_rng(looks)
    intensity, _ = peaks(nothing, speckle, np.full(shape, 3900.0), flight=flown, rng=rng)
    index = np.arange(intensity.size).reshape(-1, 1, looks)
    least = noise_threshold(
        np.array(looks),
        depth=flown.range_gate,
        pulse_length=flown.pulse_length,
        dropout=flown.threshold,
        false_alarm=FALSE_ALARM,
    )
    image = average(intensity, index)
    alarms = np.count_nonzero(image >= least)
    assert stats.binomtest(alarms, image.size, 1e-3).pvalue > 1e-3 / 16  # one pixel in a thousand
