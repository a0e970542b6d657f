"""The peak-detecting receiver: its speckle, its noise, its range errors, dropouts and gate."""

import math

import numpy as np
import pytest
from flown import CLEAN, flight, wall
from scipy import integrate, stats

from ncti.irar.receiver import noise_below, noise_peak, noiseless, peaks
from ncti.irar.scene import Returns
from ncti.irar.speckle import speckle

LEVEL = 1e-3
SHAPE = (60, 50)
COUNT = math.prod(SHAPE)
RANGE = 3900.0


def rays(distances, powers=None):
    """Returns of 3,000 samples, each with rays at the same distances."""
    number = len(distances)
    powers = np.full(number, 1 / number) if powers is None else powers
    return Returns(
        SHAPE,
        np.repeat(np.arange(COUNT), number),
        np.tile(np.arange(number), COUNT),
        np.tile(np.asarray(distances, float), COUNT),
        np.tile(powers, COUNT),
        number,
    )


def received(returns, *, seed=0, still=False, **changes):
    """Intensity and range of returns with speckle, or with amplitudes of 1."""
    flown = flight(**({"threshold": 0.0, "range_sigma": 0.0} | changes))
    rng = np.random.default_rng(seed)
    shape = (*returns.shape, returns.rays)
    drawn = np.ones(shape, np.complex64) if still else speckle(shape, correlation=0, rng=rng)
    nominal = np.full(returns.shape, RANGE)
    intensity, range_ = peaks(returns, drawn, nominal, flight=flown, rng=rng)
    return intensity.ravel().astype(float), range_.ravel()


def below(level, *, depth, pulse_length):
    """Probability that noise of a depth stays below a level, straight from the docstring."""
    level = np.asarray(level, float)
    rate = np.sqrt(4 * level / math.pi) * np.exp(-level) / -np.expm1(-level)
    return -np.expm1(-level) * np.exp(-depth / pulse_length * rate)


def simulated_peaks(depth, pulse_length, *, count, seed, oversampling=16):
    """Largest intensity of a Gaussian process of range, 16 samples a pulse."""
    rng = np.random.default_rng(seed)
    step = pulse_length / oversampling
    inside = round(depth / step) + 1
    size = 1 << math.ceil(math.log2(inside + 6 * oversampling))  # wraps beyond the depth
    lag = np.minimum(np.arange(size), size - np.arange(size)) * step
    power = np.fft.fft(np.exp(-2 * (lag / pulse_length) ** 2)).real.clip(0)
    found = []
    for _ in range(0, count, 500):
        white = rng.standard_normal((500, size, 2)).view(complex)[..., 0] * math.sqrt(0.5)
        field = np.fft.ifft(white * np.sqrt(power * size), axis=1)[:, :inside]
        found.append((np.abs(field) ** 2).max(axis=1))
    return np.concatenate(found)


def single_look_snr(intensity):
    return intensity.mean() / intensity.std()


def test_a_flat_wall_is_exponential_with_a_signal_to_noise_ratio_of_one():
    """3,000 samples against the exponential distribution, Kolmogorov-Smirnov at 1e-3.

    The ratio of mean to deviation is known to sqrt(2 / n), 2.6 %; three of these.
    """
    intensity, _ = received(rays([RANGE] * 9), cnr=CLEAN)
    assert stats.kstest(intensity / CLEAN, "expon").pvalue > LEVEL
    assert single_look_snr(intensity) == pytest.approx(1, abs=3 * math.sqrt(2 / COUNT))


def test_a_deck_has_the_largest_of_its_returns():
    """Nine rays 20 m apart: the largest of nine exponential powers, mean H_9 / 9.

    Signal-to-noise ratio H_9 / sqrt(sum 1 / k^2) = 2.3, without any noise: a maximum varies less.
    """
    apart = RANGE + 20.0 * (np.arange(9) - 4)
    intensity, range_ = received(rays(apart), cnr=CLEAN)
    assert stats.kstest(intensity * 9 / CLEAN, lambda u: (1 - np.exp(-u)) ** 9).pvalue > LEVEL
    harmonic, squares = sum(1 / k for k in range(1, 10)), sum(1 / k**2 for k in range(1, 10))
    expected = harmonic / math.sqrt(squares)
    assert single_look_snr(intensity) == pytest.approx(expected, rel=0.06)
    # Each is the strongest as often as any other; none is found between them.
    nearest = np.abs(range_[:, None] - apart).argmin(axis=1)
    np.testing.assert_allclose(range_, apart[nearest], rtol=0, atol=0.01)
    assert stats.chisquare(np.bincount(nearest, minlength=9)).pvalue > LEVEL


def test_a_sloping_deck_lies_between():
    """Rays spread over 12 m, two pulses and a half: between one return and nine."""
    intensity, _ = received(rays(RANGE + np.linspace(-6, 6, 9)), cnr=CLEAN)
    assert 1.2 < single_look_snr(intensity) < 2.3


@pytest.mark.parametrize("fraction", [0.0, 0.25, 0.5, 0.8])
@pytest.mark.parametrize("pulse_width", [5e-9, 10e-9, 30e-9])
def test_peak_and_place_do_not_depend_on_the_bins(fraction, pulse_width):
    """A return of unit amplitude, anywhere between bins that a faint one 30 m nearer begins.

    A parabola through exp(-4 r^2 / l^2) at the bin next to the peak and its neighbours, l / 4
    apart, is off by 1.44 % of the power half a bin from it, and by 2.4 % of a bin a quarter from
    it; the noise here by 0.06 %.
    """
    returns = rays([RANGE - 30.0, RANGE + fraction], [1e-9, 1.0])
    intensity, range_ = received(returns, still=True, cnr=CLEAN, pulse_width=pulse_width)
    np.testing.assert_allclose(intensity, CLEAN, rtol=0.0144 + 6e-4)
    np.testing.assert_allclose(range_, RANGE + fraction, rtol=0, atol=0.024 + 1e-3)


@pytest.mark.parametrize(
    ("depth", "off"), [(4.5, 0.04), (20.0, 0.04), (100.0, 0.025), (300.0, 0.01), (1000.0, 0.01)]
)
def test_noise_peaks_have_their_distribution(depth, off):
    """4,000 peaks of a simulated process against the closed form.

    A Kolmogorov-Smirnov distance up to 0.031 is chance at the level 1e-3; the rest is the closed
    form's own error, which its docstring states.
    """
    found = simulated_peaks(depth, 4.5, count=4000, seed=int(depth))
    distance = stats.kstest(found, lambda u: below(u, depth=depth, pulse_length=4.5)).statistic
    assert distance < off + 1.95 / math.sqrt(4000)


@pytest.mark.parametrize("depth", [0.0, 1.0, 4.5, 20.0, 300.0, 1e5])
def test_noise_peaks_invert_their_distribution(depth):
    uniform = np.linspace(1e-4, 1 - 1e-6, 2001)
    found = noise_peak(uniform, depth=depth, pulse_length=4.5)
    assert (np.diff(found) > 0).all()
    np.testing.assert_allclose(below(found, depth=depth, pulse_length=4.5), uniform, atol=3e-4)
    shared = noise_below(found, depth=depth, pulse_length=4.5)
    np.testing.assert_allclose(shared, below(found, depth=depth, pulse_length=4.5), rtol=1e-12)
    mixed = noise_peak(uniform, depth=np.where(uniform > 0.5, depth, 7.0), pulse_length=4.5)
    np.testing.assert_array_equal(mixed[uniform > 0.5], found[uniform > 0.5])


def test_the_sea_gives_noise_peaks_anywhere_in_the_gate():
    """3,000 samples: their intensity as simulated, their range uniform, their ratio over four."""
    nothing = Returns(SHAPE, *[np.empty(0, np.intp)] * 2, *[np.empty(0)] * 2, 9)
    intensity, range_ = received(nothing, range_gate=300.0)
    expected = simulated_peaks(300.0, flight().pulse_length, count=4000, seed=9)
    assert stats.ks_2samp(intensity, expected).pvalue > LEVEL
    assert stats.kstest((range_ - RANGE) / 300 + 0.5, "uniform").pvalue > LEVEL
    assert 4 < single_look_snr(intensity) < 5


@pytest.mark.parametrize("off", [0.0, 40.0, -147.0, 149.9])
@pytest.mark.parametrize(("range_gate", "pulse_width"), [(300.0, 30e-9), (300.0, 10e-9)])
def test_a_target_too_dark_to_see_leaves_the_noise_alone(off, range_gate, pulse_width):
    """Wherever the waveform's window lies, cut by the gate or not: noise as of the sea.

    Two samples of 3,000: by chance 0.050 apart at the level 1e-3, by the closed form's error
    0.01 more.
    """
    kind = {"range_gate": range_gate, "pulse_width": pulse_width, "cnr": 1e-9}
    nothing = Returns(SHAPE, *[np.empty(0, np.intp)] * 2, *[np.empty(0)] * 2, 9)
    sea = received(nothing, seed=1, **kind)
    dark = received(rays([RANGE + off] * 9), seed=2, **kind)
    assert stats.ks_2samp(sea[0], dark[0]).statistic < 0.06
    assert stats.kstest((dark[1] - RANGE) / range_gate + 0.5, "uniform").statistic < 0.045


@pytest.mark.parametrize("range_gate", [10.0, 30.0, 33.0])
def test_a_gate_no_deeper_than_the_waveform_has_that_much_noise(range_gate):
    """Nothing outside the window, or next to nothing: peaks of a process of the gate's depth."""
    dark = received(rays([RANGE] * 9), cnr=1e-9, range_gate=range_gate)
    expected = simulated_peaks(range_gate, flight().pulse_length, count=4000, seed=3)
    assert stats.ks_2samp(dark[0], expected).statistic < 0.05 + 0.04
    assert np.abs(dark[1] - RANGE).max() <= range_gate / 2 + 1


@pytest.mark.parametrize("range_sigma", [0.5, 1.0])
def test_ranges_of_a_wall_have_the_error_of_the_sensor(range_sigma):
    """Chi-square of 3,000 ranges at the level 1e-3, and no bias beyond 3.3 standard errors."""
    _, range_ = received(rays([RANGE + 0.3] * 9), cnr=CLEAN, range_sigma=range_sigma)
    off = range_ - RANGE - 0.3
    assert abs(off.mean()) < 3.3 * range_sigma / math.sqrt(COUNT)
    total = ((off - off.mean()) ** 2).sum() / range_sigma**2
    low, high = stats.chi2.ppf([LEVEL / 2, 1 - LEVEL / 2], COUNT - 1)
    assert low < total < high
    assert stats.kstest(off / range_sigma, "norm").pvalue > LEVEL


def test_noise_adds_to_the_error_of_a_range():
    """At 20 dB without a sensor's error: a third of a metre where the speckle is bright."""
    intensity, range_ = received(rays([RANGE] * 9), cnr=100.0)
    bright = np.abs(range_ - RANGE)[intensity > 100]
    assert 0.05 < bright.std() < 0.35


@pytest.mark.parametrize("cnr", [3.0, 10.0, 30.0, 100.0])
def test_false_ranges_and_dropouts_grow_as_the_target_fades(cnr):
    """Against closed forms, within four standard errors of a count of 3,000 and 0.01.

    The window about the wall holds the larger of the wall with its noise, an exponential of mean
    1 + cnr, and of the other noise of 32 m; the gate's other 268 m give a false range where their
    noise is larger still, and a dropout where all are below the threshold.
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


def test_what_lies_beyond_the_gate_is_not_seen():
    returns = rays([RANGE - 60.0, RANGE + 20.0, RANGE + 51.0], [1.0, 1e-3, 1.0])
    intensity, range_ = received(returns, still=True, cnr=CLEAN, range_gate=100.0)
    np.testing.assert_allclose(intensity, 1e-3 * CLEAN, rtol=0.02)
    np.testing.assert_allclose(range_, RANGE + 20, atol=0.02)


def test_noiseless_is_the_mean_of_the_waveform_at_its_peak():
    """Two surfaces d apart add exp(-4 d^2 / l^2) of the fainter to the brighter."""
    length = flight().pulse_length
    for apart in (0.0, 1.0, 3.0, 30.0):
        returns = rays([RANGE, RANGE + apart], [0.7, 0.2])
        intensity, range_ = noiseless(returns, flight=flight(cnr=50.0))
        overlap = math.exp(-4 * apart**2 / length**2)
        np.testing.assert_allclose(intensity, 50 * (0.7 + 0.2 * overlap), rtol=1e-6)
        expected = RANGE + apart * 0.2 * overlap / (0.7 + 0.2 * overlap)
        np.testing.assert_allclose(range_, expected, rtol=1e-12)


def test_noiseless_is_the_mean_of_noisy_looks_on_a_wall():
    """3,000 looks at 80 dB: within four standard errors of an exponential's mean."""
    returns = rays([RANGE] * 9)
    quiet, _ = noiseless(returns, flight=flight(cnr=CLEAN))
    intensity, _ = received(returns, cnr=CLEAN)
    assert intensity.mean() == pytest.approx(float(quiet.mean()), rel=4 / math.sqrt(COUNT))


def test_what_reflects_nothing_has_no_range():
    intensity, range_ = noiseless(rays([RANGE] * 2, [0.0, 0.0]), flight=flight())
    assert (intensity == 0).all() and np.isnan(range_).all()
    nothing = Returns(SHAPE, *[np.empty(0, np.intp)] * 2, *[np.empty(0)] * 2, 9)
    intensity, range_ = noiseless(nothing, flight=flight())
    assert (intensity == 0).all() and np.isnan(range_).all()


def test_a_scanned_wall_is_exponential_too():
    """Through a whole scan: speckle of nine rays, one range, 2,400 samples."""
    scan = wall(60, 40, cnr=CLEAN).record(np.random.default_rng(4))
    assert stats.kstest(scan.intensity.ravel() / CLEAN, "expon").pvalue > LEVEL
