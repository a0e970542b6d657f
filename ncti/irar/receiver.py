"""The peak-detecting receiver: of every pulse the strongest return, and when it came."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.irar.flight import Flight
from ncti.irar.scene import Returns

Floats = NDArray[np.float64]

BIN = 1.0
"""Range bin of a sampled waveform [m]; the peak's place is interpolated between bins."""


def noise_peak(
    uniform: NDArray[np.floating], *, depth: NDArray[np.floating] | float, pulse_length: float
) -> Floats:
    """Largest intensity of noise alone, by the probability of staying below it.

    Parameters
    ----------
    uniform : (...) ndarray
        Probabilities, such as uniform random numbers.
    depth : (...) ndarray or float
        Of the gate [m].
    pulse_length : float
        c T / 2 [m].

    Returns
    -------
    (...) float64 ndarray
        Intensity, in noise powers.

    Notes
    -----
    The field is a complex Gaussian process of range with correlation exp(-2 r^2 / l^2), l the
    pulse length. By Rice it crosses the intensity u upwards sqrt(4 u / pi) exp(-u) / l times a
    metre; crossings of a high level are rare and independent, so that it stays below u over a
    depth L with probability (1 - exp(-u)) exp(-L / l sqrt(4 u / pi) exp(-u) / (1 - exp(-u))).
    """
    levels = np.linspace(0.01, 40.0, 4000)
    below = -np.expm1(-levels)
    rate = np.sqrt(4 * levels / math.pi) * np.exp(-levels) / below / pulse_length
    # One curve for every depth: ln P = ln(below) - L rate, solved for u by interpolation on the
    # rate, which the small first term hardly moves.
    wanted = -np.log(np.maximum(uniform, 1e-300))
    guess = np.interp(-wanted / depth, -rate, levels)
    wanted = np.maximum(wanted + np.log(-np.expm1(-guess)), 0.0)
    found: Floats = np.interp(-wanted / depth, -rate, levels)
    return found


def peaks(
    returns: Returns,
    amplitudes: NDArray[np.complexfloating],
    nominal: Floats,
    *,
    flight: Flight,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float32], Floats]:
    """Intensity and range of the strongest return of every sample.

    Parameters
    ----------
    returns : Returns
        What the ship sends back.
    amplitudes : (line, column, ray) complex64 ndarray
        Speckle of every ray, of unit mean power.
    nominal : (line, column) float64 ndarray
        Range of the middle of the gate [m].
    flight : Flight
        Carrier-to-noise ratio, pulse, gate and threshold.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    intensity : (line, column) float32 ndarray
        In noise powers; 0 where nothing passes the threshold.
    range : (line, column) float64 ndarray
        Measured [m]; NaN where nothing passes the threshold.

    Notes
    -----
    A sample's waveform is the sum of its rays' amplitudes, each with the response
    exp(-2 r^2 / l^2) of pulse and matched filter (article, Appendix 1, of unit peak here), plus
    noise of unit mean power and of correlation exp(-2 r^2 / l^2), l = c T / 2: a flat target that
    fills the IFOV has the carrier-to-noise ratio of the flight. The waveform is computed around
    the ship only; the rest of the gate gives its noise peak in closed form (`noise_peak`), and so
    do samples of the sea.
    """
    count = math.prod(returns.shape)
    centre = nominal.reshape(-1)
    inside = np.abs(returns.distance - centre[returns.place]) <= flight.range_gate / 2
    place, distance = returns.place[inside], returns.distance[inside]
    field = amplitudes.reshape(-1)[place * returns.rays + returns.ray[inside]]
    field = field * np.sqrt(flight.cnr * returns.power[inside]).astype(np.float32)
    depth = np.full(count, flight.range_gate)
    intensity, where = np.zeros(count), np.zeros(count)

    seen, first = np.unique(place, return_index=True)
    if len(seen):
        near = np.minimum.reduceat(distance, first)
        far = np.maximum.reduceat(distance, first)
        margin = math.ceil(1.5 * flight.pulse_length / BIN)
        bins = np.ceil((far - near) / BIN).astype(np.intp) + 2 * margin + 2
        sizes = np.exp2(np.ceil(np.log2(bins))).astype(np.intp)
        of_ray = np.repeat(np.arange(len(seen)), np.diff(np.append(first, len(place))))
        for size in np.unique(sizes):
            chosen = np.flatnonzero(sizes == size)
            number = np.full(len(seen), -1)
            number[chosen] = np.arange(len(chosen))
            ray = np.flatnonzero(number[of_ray] >= 0)
            row = number[of_ray[ray]]
            at = (distance[ray] - near[chosen][row]) / BIN + margin
            wave = _waveforms(row, at, field[ray], (len(chosen), int(size)), flight, rng)
            value, peak = _strongest(wave)
            intensity[seen[chosen]] = value
            where[seen[chosen]] = near[chosen] + (peak - margin) * BIN
            depth[seen[chosen]] -= int(size) * BIN
    noise = noise_peak(
        rng.random(count), depth=np.maximum(depth, BIN), pulse_length=flight.pulse_length
    )
    anywhere = centre + flight.range_gate * (rng.random(count) - 0.5)
    false = noise > intensity
    intensity[false], where[false] = noise[false], anywhere[false]
    where += flight.range_sigma * rng.standard_normal(count)
    dropout = intensity < flight.threshold
    intensity[dropout], where[dropout] = 0.0, np.nan
    return intensity.reshape(returns.shape).astype(np.float32), where.reshape(returns.shape)


def noiseless(returns: Returns, *, flight: Flight) -> tuple[NDArray[np.float32], Floats]:
    """What the receiver would report on average over speckle, without noise.

    Parameters
    ----------
    returns : Returns
        What the ship sends back.
    flight : Flight
        Carrier-to-noise ratio and pulse.

    Returns
    -------
    intensity : (line, column) float32 ndarray
        Peak over range of the mean intensity, in noise powers; 0 where there is no ship.
    range : (line, column) float64 ndarray
        Where that peak is [m]; NaN where there is no ship.

    Notes
    -----
    The peak of a mean is less than the mean of peaks, by what speckle adds on surfaces that one
    IFOV sees at several ranges.
    """
    count = math.prod(returns.shape)
    intensity, where = np.zeros(count, dtype=np.float32), np.full(count, np.nan)
    seen, first = np.unique(returns.place, return_index=True)
    if len(seen):
        # Rays of one sample side by side; those that meet nothing have no power.
        of_ray = np.repeat(np.arange(len(seen)), np.diff(np.append(first, len(returns.place))))
        power, distance = np.zeros((2, len(seen), returns.rays))
        power[of_ray, returns.ray] = returns.power
        distance[of_ray, returns.ray] = returns.distance
        there = power > 0
        apart = distance[:, :, None] - distance[:, None, :]
        response = np.exp(-4 * apart**2 / flight.pulse_length**2)
        total = np.einsum("skl,sl->sk", response, power)
        total[~there] = 0
        best = total.argmax(axis=1)
        take = np.arange(len(seen)), best
        weight = response[take] * power
        intensity[seen] = flight.cnr * total[take]
        norm = np.maximum(weight.sum(axis=1), np.finfo(float).tiny)
        where[seen] = (weight * distance).sum(axis=1) / norm
    return intensity.reshape(returns.shape), where.reshape(returns.shape)


def _waveforms(
    row: NDArray[np.intp],
    at: Floats,
    field: NDArray[np.complexfloating],
    shape: tuple[int, int],
    flight: Flight,
    rng: np.random.Generator,
) -> NDArray[np.complex64]:
    """(sample, bin) field of scatterers at (fractional) bins, noise included."""
    low = np.floor(at).astype(np.intp)
    part = at - low
    flat = np.concatenate([row * shape[1] + low, row * shape[1] + low + 1])
    weight = np.concatenate([field * (1 - part), field * part])
    source = np.bincount(flat, weight.real, math.prod(shape))
    source = source + 1j * np.bincount(flat, weight.imag, math.prod(shape))
    white = rng.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    lag = np.minimum(np.arange(shape[1]), shape[1] - np.arange(shape[1])) * BIN
    pulse = np.exp(-2 * lag**2 / flight.pulse_length**2)
    matched = np.exp(-4 * lag**2 / flight.pulse_length**2)
    matched /= math.sqrt(2 * np.sum(matched**2))  # two quadratures of unit variance
    response, noise = np.fft.fft(pulse), np.fft.fft(matched)
    spectrum = np.fft.fft(source.reshape(shape)) * response + np.fft.fft(white) * noise
    return np.fft.ifft(spectrum).astype(np.complex64)


def _strongest(wave: NDArray[np.complex64]) -> tuple[Floats, Floats]:
    """Largest intensity of each waveform, and its place between bins."""
    power = wave.real**2 + wave.imag**2
    rows, peak = np.arange(len(power)), power.argmax(axis=1)
    value = power[rows, peak].astype(np.float64)
    before = power[rows, peak - 1].astype(np.float64)
    after = power[rows, (peak + 1) % power.shape[1]].astype(np.float64)
    bend = before - 2 * value + after
    shift = np.where(bend < 0, (before - after) / (2 * np.where(bend < 0, bend, -1.0)), 0.0)
    return value, peak + np.clip(shift, -0.5, 0.5)
