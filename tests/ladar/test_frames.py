"""Sampled frames do not depend on the number drawn, and agree with the plain computation."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import stats

from ncti import ladar
from ncti.ladar.pulse import Pulse, noise_covariance, target_kernel
from ncti.normals import draw_key, draw_places, put_streams

COUNTS = st.integers(1, 100)


def extent(*, bins, ifovs, bin_width=1.0):
    """Return IFOVs filled over some bins each, as by a sloping deck."""
    rng = np.random.default_rng(bins)
    fraction = np.zeros((ifovs, bins))
    for row in fraction:
        length = int(rng.integers(1, 1 + min(bins, 40)))
        start = int(rng.integers(0, 1 + bins - length))
        row[start : start + length] = rng.random(length) / length
    cell = np.stack([np.arange(ifovs), np.zeros(ifovs, int)], axis=1)
    down_range = (np.arange(bins) - (bins - 1) / 2) * bin_width
    return ladar.RangeExtent(fraction, down_range, bin_width, cell, 150e-6, 1e5)


def drawn(target, count, *, target_free_ifovs=0, receiver="full_profile"):
    return ladar.sample_frames(
        target,
        pulse_width=30e-9,
        cnr=1e3,
        frame_count=count,
        rng=np.random.default_rng(11),
        target_free_ifovs=target_free_ifovs,
        receiver=receiver,
    )


# BLAS may round a product differently for different numbers of rows.
@settings(max_examples=10, deadline=None)
@given(counts=st.tuples(COUNTS, COUNTS), target_free_ifovs=st.sampled_from([0, 3, 100, 4000]))
@example(counts=(1, 33), target_free_ifovs=4000)
@pytest.mark.parametrize("bins", [1, 7, 250])
def test_fewer_frames_are_a_prefix_of_more(bins, counts, target_free_ifovs):
    few, many = sorted(counts)
    target = extent(bins=bins, ifovs=3)
    first, all_ = (
        drawn(target, count, target_free_ifovs=target_free_ifovs) for count in (few, many)
    )
    np.testing.assert_array_equal(first, all_[:few])


def blocks_of(count, *, bins=32):
    target, rng = extent(bins=bins, ifovs=1), np.random.default_rng(2)
    return ladar.frame_blocks(target, pulse_width=30e-9, cnr=1e3, frame_count=count, rng=rng)


@settings(max_examples=30, deadline=None)
@given(counts=st.lists(COUNTS, min_size=1, max_size=5), bins=st.sampled_from([1, 7, 250]))
def test_streamed_averages_equal_averages_of_all_frames(counts, bins):
    most = max(counts)
    frames = np.concatenate(list(blocks_of(most, bins=bins)))
    streamed = ladar.cumulative_average(blocks_of(most, bins=bins), counts)
    np.testing.assert_array_equal(streamed, ladar.cumulative_average(frames, counts))
    plain = [frames[:count].mean(axis=0) for count in counts]
    # Sums of `most` terms, in any order, have at most as many float64 roundings.
    np.testing.assert_allclose(streamed, plain, rtol=most * np.finfo(float).eps)


@pytest.mark.parametrize(
    ("counts", "message"),
    [([3, 41], "frame_count is 41, but must be .* 40"), ([0], "frame_count is 0"), ([], "empty")],
)
def test_invalid_frame_counts_are_refused(counts, message):
    with pytest.raises(ValueError, match=message):
        ladar.cumulative_average(blocks_of(40), counts)


def assert_equal_but_for_rounding(frames, expected):
    """Check equality within some units of the last place, as fields sum some hundred terms."""
    assert np.abs(frames - expected).max() < 16 * np.finfo(np.float32).eps * expected.max()


@pytest.mark.parametrize("target_free_ifovs", [0, 3, 4000])
def test_extra_filled_bin_does_not_shift_random_draws(target_free_ifovs):
    target = extent(bins=64, ifovs=2)
    frames = drawn(target, 9, target_free_ifovs=target_free_ifovs)
    for bin_ in np.flatnonzero(target.fraction[0] == 0)[[0, -1]]:
        fraction = target.fraction.copy()
        fraction[0, bin_] = 1e-30
        more = drawn(replace(target, fraction=fraction), 9, target_free_ifovs=target_free_ifovs)
        assert_equal_but_for_rounding(more, frames)


@pytest.mark.parametrize("receiver", ["full_profile", "first_pulse", "peak_pulse"])
def test_extra_ifov_only_adds_its_own_waveform(receiver):
    target = extent(bins=64, ifovs=40)
    total, single, without = (
        drawn(
            replace(target, fraction=target.fraction[chosen], cell=target.cell[chosen]),
            9,
            receiver=receiver,
        )
        for chosen in (slice(None), slice(17, 18), np.arange(40) != 17)
    )
    assert_equal_but_for_rounding(without + single, total)


def normals(key, frame, cell, numbers):
    """Return the normals of two quadratures at some numbers of one stream."""
    stream, out = np.empty((1, 1), dtype=np.uint64), np.empty((1, 2, len(numbers)), np.float32)
    put_streams(key, frame, np.array([cell]), stream)
    draw_places(key, stream, np.array([0, len(numbers)]), numbers, out)
    return out[0]


def whole_factor(noise):
    """Return all rows of the noise factor, in all bins."""
    halves = (noise.even, 1), (noise.odd, -1)
    return np.concatenate(
        [np.hstack([rows, sign * rows[:, : noise.bins // 2][:, ::-1]]) for rows, sign in halves]
    ).astype(float)


def plain_frames(target, count, *, pulse_width, cnr, target_free_ifovs, rng):
    """Return frames by Equations A and B in float64, with one product per IFOV and frame."""
    bins = target.down_range.size
    pulse = Pulse(pulse_width, target.bin_width)
    noise = whole_factor(ladar.fields.Noise.of(pulse, bins))
    key = draw_key(rng)
    ifovs = list(zip(target.density, target.cell, strict=True))
    nothing = np.zeros(bins)
    ifovs += [(nothing, (n, ladar.frames.TARGET_FREE_ROW)) for n in range(target_free_ifovs)]
    drawn = np.zeros((count, bins))
    for frame, (beta, cell) in product(range(count), ifovs):
        (occupied,) = np.nonzero(beta)
        speckle = np.sqrt(cnr * beta[occupied])[:, None] * target_kernel(pulse, bins)[occupied]
        numbers = np.concatenate([occupied, bins + np.arange(len(noise))])
        quadratures = normals(key, frame, cell, numbers) @ np.concatenate([speckle, noise])
        drawn[frame] += np.hypot(*quadratures)
    return drawn


@pytest.mark.parametrize("bins", [1, 7, 120, 251])
@pytest.mark.parametrize("pulse_width", [10e-9, 30e-9, 50e-9])
@pytest.mark.parametrize("cnr", [0.0, 1e3, 1e10])
def test_frames_match_the_plain_computation(pulse_width, cnr, bins):
    """With equal normals frames agree with the plain computation within float32 rounding."""
    target = extent(bins=bins, ifovs=3)
    parameters = {"pulse_width": pulse_width, "cnr": cnr, "target_free_ifovs": 2}
    ours = ladar.sample_frames(target, frame_count=5, rng=np.random.default_rng(8), **parameters)
    plain = plain_frames(target, 5, rng=np.random.default_rng(8), **parameters)
    assert_equal_but_for_rounding(ours, plain)


@pytest.mark.parametrize("pulse_width", [1e-9, 1.8e-9, 30e-9, 1e-6])
@pytest.mark.parametrize("bins", [1, 2, 7, 250, 1001])
def test_noise_factor_matches_eigendecomposition(pulse_width, bins):
    """The factor has as many rows as eigenvectors, within two, and the same covariance.

    Either drops at most 1e-6 of the largest eigenvalue, the pivoted decomposition at most a tenth
    of that in addition, and both round to float32.
    """
    pulse = Pulse(pulse_width, 1.0)
    factor = whole_factor(ladar.fields.Noise.of(pulse, bins))
    covariance = noise_covariance(pulse, bins)
    values = np.linalg.eigvalsh(covariance)
    error = np.abs(np.linalg.eigvalsh(factor.T @ factor - covariance)).max()
    assert error < (1.1e-6 + 4 * np.finfo(np.float32).eps) * values[-1]
    # Even and odd rows have different largest eigenvalues, hence different cut-offs.
    assert abs(len(factor) - np.count_nonzero(values > 1e-6 * values[-1])) <= 2


def test_finer_bins_need_no_more_random_numbers():
    """Noise in 5 cm bins has the bandwidth, so the degrees of freedom, of that in 1 m bins."""
    fine, coarse = (ladar.fields.Noise.of(Pulse(30e-9, 200 / bins), bins) for bins in (4000, 200))
    assert len(fine.even) + len(fine.odd) <= len(coarse.even) + len(coarse.odd) + 4


@pytest.mark.parametrize("target_free_ifovs", [0, 4000])
@pytest.mark.parametrize(("pulse_width", "bin_width"), [(10e-9, 0.5), (50e-9, 1.0)])
def test_sampled_frames_have_the_exact_moments(pulse_width, bin_width, target_free_ifovs):
    """Test variances along 200 directions in 120 bins of 10,000 frames at level 1e-3.

    Directions are 100 random ones and 100 eigenvectors of the exact covariance, from those within
    the band to those that the band limit nearly removes.
    """
    level, count, bins = 1e-3, 10_000, 120
    target = extent(bins=bins, ifovs=3, bin_width=bin_width)
    parameters = {"pulse_width": pulse_width, "cnr": 1e3, "target_free_ifovs": target_free_ifovs}
    mean, covariance = ladar.frame_moments(target, **parameters)
    drawn = ladar.sample_frames(
        target, frame_count=count, rng=np.random.default_rng(20), **parameters
    )
    rng = np.random.default_rng(21)
    directions = np.concatenate(
        [rng.standard_normal((100, bins)), np.linalg.eigh(covariance)[1].T[-100:]]
    )
    along = (drawn - mean) @ directions.T
    # Standard errors are the samples' own: no normality is assumed.
    z_mean = along.mean(axis=0) / (along.std(axis=0) / np.sqrt(count))
    square = along**2
    variance = np.einsum("db,bc,dc->d", directions, covariance, directions)
    z_variance = (square.mean(axis=0) - variance) / (square.std(axis=0) / np.sqrt(count))
    z = np.concatenate([z_mean, z_variance])
    assert np.abs(z).max() < stats.norm.isf(level / 2 / z.size)
