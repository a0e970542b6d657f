"""The peak-detecting receiver has the expected speckle, noise, range errors, dropouts and gate."""

import math

import numpy as np
import pytest
from flown import CLEAN, flight
from scipy import integrate, stats

from ncti.irar.receiver import peaks
from ncti.irar.scene import Returns
from ncti.irar.speckle import speckle

LEVEL = 1e-3
SHAPE = (60, 50)
COUNT = math.prod(SHAPE)
RANGE = 3900.0


def rays(distances):
    """Return 3,000 samples, each with rays at the same distances."""
    number = len(distances)
    return Returns(
        SHAPE,
        np.repeat(np.arange(COUNT), number),
        np.tile(np.arange(number), COUNT),
        np.tile(np.asarray(distances, float), COUNT),
        np.full(number * COUNT, 1 / number),
        number,
    )


def received(returns, *, still=False, **changes):
    """Return the intensity and range of returns with speckle, or with amplitudes of 1."""
    flown = flight(**({"threshold": 0.0, "range_sigma": 0.0} | changes))
    rng = np.random.default_rng(0)
    shape = (*returns.shape, returns.rays)
    drawn = np.ones(shape, np.complex64) if still else speckle(shape, correlation=0, rng=rng)
    nominal = np.full(returns.shape, RANGE)
    intensity, range_ = peaks(returns, drawn, nominal, flight=flown, rng=rng)
    return intensity.ravel().astype(float), range_.ravel()


def below(level, *, depth, pulse_length):
    """Return the probability that noise of a depth stays below a level, as `peaks` documents it."""
    level = np.asarray(level, float)
    rate = np.sqrt(4 * level / math.pi) * np.exp(-level) / -np.expm1(-level)
    return -np.expm1(-level) * np.exp(-depth / pulse_length * rate)


def test_separated_returns_yield_the_strongest_one():
    """Nine rays 20 m apart give the largest of nine exponential powers, with mean H_9 / 9.

    Its signal-to-noise ratio is H_9 / sqrt(sum 1 / k^2) = 2.3, as a maximum varies less.
    """
    distances = RANGE + 20.0 * (np.arange(9) - 4)
    intensity, range_ = received(rays(distances), cnr=CLEAN)
    assert stats.kstest(intensity * 9 / CLEAN, lambda u: (1 - np.exp(-u)) ** 9).pvalue > LEVEL
    harmonic, squares = sum(1 / k for k in range(1, 10)), sum(1 / k**2 for k in range(1, 10))
    expected = harmonic / math.sqrt(squares)
    assert intensity.mean() / intensity.std() == pytest.approx(expected, rel=0.06)
    # All rays are equally often the strongest; no range lies between rays.
    nearest = np.abs(range_[:, None] - distances).argmin(axis=1)
    np.testing.assert_allclose(range_, distances[nearest], rtol=0, atol=0.01)
    assert stats.chisquare(np.bincount(nearest, minlength=9)).pvalue > LEVEL


@pytest.mark.parametrize("apart", [0.3, 0.5])
def test_returns_within_a_pulse_add_coherently(apart):
    """Two halves of the power, d L apart, with fields exp(-2 x^2 / L^2), peak at 2 exp(-d^2)."""
    length = flight().pulse_length
    intensity, range_ = received(rays([RANGE, RANGE + apart * length]), cnr=CLEAN, still=True)
    assert intensity.mean() / CLEAN == pytest.approx(2 * math.exp(-(apart**2)), rel=0.02)
    assert range_.mean() == pytest.approx(RANGE + apart * length / 2, abs=0.05)


def test_returns_beyond_the_range_gate_are_dropped():
    """A gate of 300 m about the nominal range drops a strong wall 151 m behind it, not at 149 m."""
    for beyond, inside in ((149.0, True), (151.0, False)):
        _, range_ = received(rays([RANGE + beyond] * 9), cnr=CLEAN, threshold=100.0, still=True)
        assert np.isfinite(range_).all() == inside and np.isfinite(range_).any() == inside


@pytest.mark.parametrize("range_sigma", [0.5, 1.0])
def test_ranges_of_a_wall_have_the_error_of_the_sensor(range_sigma):
    """3,000 ranges pass a chi-square test at level 1e-3; bias is below 3.3 standard errors."""
    _, range_ = received(rays([RANGE + 0.3] * 9), cnr=CLEAN, range_sigma=range_sigma)
    off = range_ - RANGE - 0.3
    assert abs(off.mean()) < 3.3 * range_sigma / math.sqrt(COUNT)
    total = ((off - off.mean()) ** 2).sum() / range_sigma**2
    low, high = stats.chi2.ppf([LEVEL / 2, 1 - LEVEL / 2], COUNT - 1)
    assert low < total < high
    assert stats.kstest(off / range_sigma, "norm").pvalue > LEVEL


@pytest.mark.parametrize("cnr", [3.0, 10.0, 30.0, 100.0])
def test_false_range_and_dropout_rates_match_closed_forms(cnr):
    """Fractions match closed forms within 0.01 and four standard errors of a count of 3,000.

    The peak in the window of 32 m about the wall is the larger of an exponential of mean 1 + cnr
    and the noise of the rest of the window. A larger peak in the other 268 m of the gate gives a
    false range; a dropout occurs where both peaks are below the threshold.
    """
    threshold, length = 7.0, flight().pulse_length
    intensity, range_ = received(rays([RANGE] * 9), cnr=cnr, threshold=threshold)

    def inside(u):
        return -np.expm1(-u / (1 + cnr)) * below(u, depth=32 - 2 * length, pulse_length=length)

    def outside(u):
        return below(u, depth=268.0, pulse_length=length)

    levels = np.concatenate([np.linspace(threshold, 60, 20_000), np.geomspace(60, 1e4, 5000)])
    false = integrate.trapezoid(inside(levels), outside(levels))
    dropout = float(inside(threshold) * outside(threshold))
    found_dropout = np.isnan(range_)
    np.testing.assert_array_equal(found_dropout, intensity == 0)
    assert intensity[~found_dropout].min() >= threshold
    with np.errstate(invalid="ignore"):
        found_false = np.abs(range_ - RANGE) > 16.5
    for found, expected in ((found_false, false), (found_dropout, dropout)):
        level = 4 * math.sqrt(expected * (1 - expected) / COUNT) + 0.01
        assert found.mean() == pytest.approx(expected, abs=level)
    assert false > 0.02 or cnr > 30
