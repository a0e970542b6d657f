"""The peak-detecting receiver: intensity and time of the strongest return of every pulse."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.irar.flight import Flight
from ncti.irar.scene import Returns

Floats = NDArray[np.float64]

BIN = 1.0
"""Widest range bin of a sampled waveform [m]; a pulse spans at least four."""

SAMPLES_AT_ONCE = 256
"""Samples per block, whose pairs of rays, 1 MB, fit into a processor's cache."""


def noise_probability(level: Floats, *, depth: float, pulse_length: float) -> Floats:
    """Return the probability (...) that the largest noise intensity in a gate stays below a level.

    `level` (...) is in noise powers; `depth` [m] that of the gate, `pulse_length` [m] c T / 2. The
    field is a complex Gaussian process of range with correlation exp(-2 r^2 / l^2), l the pulse
    length. By Rice's formula it crosses the intensity u upwards sqrt(4 u / pi) exp(-u) / l times
    per metre. Crossings of a high level are rare and independent, so over a depth L the probability
    is

        (1 - exp(-u)) exp(-L / l sqrt(4 u / pi) exp(-u) / (1 - exp(-u))).

    Crossings of a low level are not rare: over up to 20 pulse lengths, where low levels matter, the
    probability is up to 0.04 off, over 60 pulse lengths less than 0.01.
    """
    below: Floats = -np.expm1(-level)
    rate = np.sqrt(4 * level / math.pi) * np.exp(-level) / below / pulse_length
    return below * np.exp(-depth * rate)


def noise_peak(
    uniform: NDArray[np.floating], *, depth: NDArray[np.floating] | float, pulse_length: float
) -> Floats:
    """Return quantiles (...) of the largest noise intensity in a gate, in noise powers.

    This inverse of `noise_probability` turns `uniform` (...) random numbers into peaks, accurate to
    0.001.
    """
    levels = np.concatenate([np.geomspace(1e-9, 0.01, 100)[:-1], np.linspace(0.01, 40.0, 4000)])
    uniform, depth = np.broadcast_arrays(uniform, depth)
    level = np.empty(uniform.shape)
    for length in np.unique(depth):  # few: the gate, and the gate without a waveform
        has_depth = depth == length
        below = noise_probability(levels, depth=length, pulse_length=pulse_length)
        level[has_depth] = np.interp(uniform[has_depth], below, levels)
    return level


def peaks(
    returns: Returns,
    amplitudes: NDArray[np.complexfloating],
    nominal: Floats,
    *,
    flight: Flight,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float32], Floats]:
    """Return intensity and range (line, column) of the strongest return of every sample.

    They are in noise powers and metres. Without a return above the threshold they are 0 and NaN.
    `amplitudes` (line, column, ray) are the speckle of every ray, of unit mean power; `nominal`
    (line, column) [m] is the middle of the gate.

    A sample's waveform is the sum of its rays' amplitudes, each with the response exp(-2 r^2 / l^2)
    of pulse and matched filter (Appendix 1 of the article, of unit peak here), plus noise of unit
    mean power and of correlation exp(-2 r^2 / l^2), l = c T / 2: a flat target that fills the IFOV
    has the carrier-to-noise ratio of the flight. The waveform is computed around the ship only; the
    noise peak of the rest of the gate, and of samples of the sea, has a closed form (`noise_peak`).
    The error of a range is `range_sigma` plus, at low carrier-to-noise ratios, the displacement of
    the peak by noise.
    """
    # Fields of the rays that the gate admits.
    count = math.prod(returns.shape)
    centre = nominal.reshape(-1)
    inside = np.abs(returns.distance - centre[returns.place]) <= flight.range_gate / 2
    place, distance = returns.place[inside], returns.distance[inside]
    field = amplitudes.reshape(-1)[place * returns.rays + returns.ray[inside]]
    field = field * np.sqrt(flight.cnr * returns.power[inside]).astype(np.float32)
    intensity, ranges = np.zeros(count), np.zeros(count)
    # Start and length of the part of the gate that a sample's waveform covers.
    begin, covered = np.full(count, np.inf), np.zeros(count)
    gate = centre - flight.range_gate / 2
    step = min(BIN, flight.pulse_length / 4)

    # Waveforms of the samples that see the ship, grouped by their number of bins.
    visible, first, sample = np.unique(place, return_index=True, return_inverse=True)
    if len(visible):
        near = np.minimum.reduceat(distance, first)
        far = np.maximum.reduceat(distance, first)
        margin = math.ceil(1.5 * flight.pulse_length / step)
        bins = np.ceil((far - near) / step).astype(np.intp) + 2 * margin + 2
        sizes = np.exp2(np.ceil(np.log2(bins))).astype(np.intp)
        for size in np.unique(sizes):
            chosen = np.flatnonzero(sizes == size)
            number = np.full(len(visible), -1)
            number[chosen] = np.arange(len(chosen))
            ray = np.flatnonzero(number[sample] >= 0)
            row = number[sample[ray]]
            position = (distance[ray] - near[chosen][row]) / step + margin
            shape = len(chosen), int(size)
            wave = _waveforms(
                row, position, field[ray], shape, margin, flight.pulse_length / step, rng
            )
            edge = near[chosen] - margin * step
            low = np.maximum(np.ceil((gate[visible[chosen]] - edge) / step), 0)
            high = (gate[visible[chosen]] + flight.range_gate - edge) / step
            high = np.minimum(np.floor(high) + 1, size)
            value, peak = _strongest_sample(wave, low, high)
            intensity[visible[chosen]] = value
            ranges[visible[chosen]] = edge + peak * step
            begin[visible[chosen]] = edge + (low - 0.5) * step
            covered[visible[chosen]] = (high - low) * step
    depth = np.maximum(flight.range_gate - covered, 0.0)
    noise = noise_peak(rng.random(count), depth=depth, pulse_length=flight.pulse_length)
    anywhere = gate + depth * rng.random(count)
    anywhere += np.where(anywhere > begin, covered, 0.0)
    is_false = (noise > intensity) & (depth > 0)
    intensity[is_false], ranges[is_false] = noise[is_false], anywhere[is_false]
    ranges += flight.range_sigma * rng.standard_normal(count)
    dropout = intensity < flight.threshold
    intensity[dropout], ranges[dropout] = 0.0, np.nan
    return intensity.reshape(returns.shape).astype(np.float32), ranges.reshape(returns.shape)


def mean_return(returns: Returns, *, flight: Flight) -> tuple[NDArray[np.float32], Floats]:
    """Return intensity and range (line, column) of the receiver's mean over speckle, without noise.

    The intensity is the largest over range, in noise powers, at the rays' ranges, and the range [m]
    the mean of the rays that contribute; 0 and NaN without a ship. The peak of a mean is less than
    the mean of peaks, by the gain from speckle on surfaces that span several ranges in one IFOV.
    """
    count = math.prod(returns.shape)
    intensity, ranges = np.zeros(count, dtype=np.float32), np.full(count, np.nan)
    visible, sample = np.unique(returns.place, return_inverse=True)
    if len(visible):
        # One row of rays per sample; rays that miss the ship have no power.
        power, distance = np.zeros((2, len(visible), returns.rays))
        power[sample, returns.ray] = returns.power
        distance[sample, returns.ray] = returns.distance
        for start in range(0, len(visible), SAMPLES_AT_ONCE):
            block = slice(start, start + SAMPLES_AT_ONCE)
            peak, middle = _peak_of_mean(power[block], distance[block], flight.pulse_length)
            lit = peak > 0
            intensity[visible[block]] = flight.cnr * peak
            ranges[visible[block][lit]] = middle[lit]
    return intensity.reshape(returns.shape), ranges.reshape(returns.shape)


def _peak_of_mean(power: Floats, distance: Floats, pulse_length: float) -> tuple[Floats, Floats]:
    """Return the largest mean intensity and the mean range of its contributions, (sample,) each.

    Powers and distances are (sample, ray); the range is NaN where no ray has power.
    """
    separation = distance[:, :, None] - distance[:, None, :]
    response = np.exp(-4 * separation**2 / pulse_length**2)
    total = np.where(power > 0, np.einsum("skl,sl->sk", response, power), 0.0)
    take = np.arange(len(total)), total.argmax(axis=1)
    weight = response[take] * power
    total_weight = weight.sum(axis=1)
    middle = np.full(len(total), np.nan)
    np.divide((weight * distance).sum(axis=1), total_weight, out=middle, where=total_weight > 0)
    return total[take], middle


def _waveforms(
    row: NDArray[np.intp],
    position: Floats,
    field: NDArray[np.complexfloating],
    shape: tuple[int, int],
    margin: int,
    pulse_length: float,
    rng: np.random.Generator,
) -> NDArray[np.complex64]:
    """Return the noisy field (sample, bin) of scatterers at fractional bins; lengths in bins."""
    low = np.floor(position).astype(np.intp)
    fraction = position - low
    # Noise: white noise through the matched filter, of unit mean power.
    white = rng.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
    lag = np.minimum(np.arange(shape[1]), shape[1] - np.arange(shape[1]))
    matched = np.exp(-4 * (lag / pulse_length) ** 2)
    matched /= math.sqrt(2 * np.sum(matched**2))  # two quadratures of unit variance
    wave = np.fft.ifft(np.fft.fft(white) * np.fft.fft(matched))
    # Signal: each scatterer's pulse, sampled at the bins around it.
    flat, size = row * shape[1] + low, math.prod(shape)
    for tap in range(1 - margin, margin + 1):
        weight = field * np.exp(-2 * ((tap - fraction) / pulse_length) ** 2)
        wave.real += np.bincount(flat + tap, weight.real, size).reshape(shape)
        wave.imag += np.bincount(flat + tap, weight.imag, size).reshape(shape)
    return wave.astype(np.complex64)


def _strongest_sample(
    wave: NDArray[np.complex64], low: Floats, high: Floats
) -> tuple[Floats, Floats]:
    """Return the largest intensity of each waveform in its gate and its place, by a parabola."""
    power = (wave.real**2 + wave.imag**2).astype(np.float64)
    size = power.shape[1]
    number = np.arange(size)
    inside = (number >= low[:, None]) & (number < high[:, None])
    rows, peak = np.arange(len(power)), np.where(inside, power, -1.0).argmax(axis=1)
    value = power[rows, peak]
    before, after = power[rows, peak - 1], power[rows, (peak + 1) % size]
    bend = before - 2 * value + after
    # At the gate's edge the largest value need not be a peak.
    top = (bend < 0) & (value >= before) & (value >= after)
    shift = np.where(top, (before - after) / (2 * np.where(top, bend, -1.0)), 0.0)
    return value - (before - after) * shift / 4, peak + shift
