"""Float32 against float64, in units of its rounding, from the mesh to the name."""

import math

import numpy as np
import trimesh
from hard_meshes import box, outline, see
from hypothesis import given, settings
from hypothesis import strategies as st

import ncti.ladar.frames as frames_module
from ncti.classify import CorrelationNeighbour
from ncti.features import log_polar, profile_vector
from ncti.ladar import expected_profile, frame_moments, noise_floor, range_extent, sample_frames
from ncti.ladar.moments import magnitude_covariance
from ncti.ladar.pulse import noise_covariance, target_kernel

U = float(np.finfo(np.float32).eps) / 2  # relative rounding of a float32
SIGNAL = {"pulse_width": 30e-9, "cnr": 10**3.2}
VIEW = {"aspect": 37.0, "depression": 3.84}


def extent(solid):
    return range_extent(see("lines", solid, pixel=0.25, **VIEW), slant_range=1e5)


def test_a_mesh_in_float32_moves_profiles_by_its_rounding():
    """Vertices move by d = sqrt(3) 70 U at most: outlines sweep d times the edges' 640 m, and
    ranges shift by d, which changes what the pulse has smoothed by d times its total variation.
    """
    exact = box()
    rounded = trimesh.Trimesh(exact.vertices.astype(np.float32), exact.faces, process=False)
    rounded.vertices *= 1 + U / 2  # a box has whole metres: half a rounding away from all of them
    power = target_kernel(pulse_width=30e-9, bin_width=1.0, bin_count=250) ** 2
    p, q = (power @ extent(some).fraction.sum(axis=0) for some in (rounded, exact))
    moved = math.sqrt(3) * 70 * U
    variation = np.abs(np.diff(q)).sum()
    area = outline(exact.vertices, **VIEW)[0]
    assert np.abs(p - q).sum() <= moved * (640.0 / area * q.sum() + variation)
    assert np.abs(p - q).max() <= 200 * U * q.max()


def double_precision(seen, target_free, count, seed):
    """What `sample_frames` draws, from the same normals, with nothing rounded to float32."""
    bins = seen.down_range.size
    pulse = {"pulse_width": SIGNAL["pulse_width"], "bin_width": 1.0, "bin_count": bins}

    def factor(covariance):
        values, vectors = np.linalg.eigh(covariance)
        kept = values > 1e-6 * values[-1]
        return (vectors[:, kept] * np.sqrt(values[kept])).T

    noise = factor(noise_covariance(**pulse))
    floor = factor(magnitude_covariance(noise_covariance(**pulse)))
    kernel = target_kernel(**pulse)
    parts = []
    for beta in seen.density:
        on = np.flatnonzero(beta)
        parts.append(
            np.concatenate([np.sqrt(SIGNAL["cnr"] * beta[on])[:, None] * kernel[on], noise])
        )
    per_frame = len(floor) + 2 * sum(map(len, parts))
    normals = np.random.default_rng(seed).standard_normal((count, per_frame), dtype=np.float32)
    normals = normals.astype(np.float64)
    frames = math.sqrt(target_free) * (normals[:, : len(floor)] @ floor)
    frames += target_free * noise_floor()
    largest = math.sqrt(target_free) * np.abs(normals[:, : len(floor)]) @ np.abs(floor)
    at = len(floor)
    for part in parts:
        k = len(part)
        quadratures = normals[:, at : at + 2 * k].reshape(count, 2, k)
        frames += np.sqrt(((quadratures @ part) ** 2).sum(axis=1))
        largest += (np.abs(quadratures) @ np.abs(part)).sum(axis=1)
        at += 2 * k
    return frames, largest, max(len(floor), *(len(part) for part in parts))


def test_frames_in_float32_are_those_of_float64_to_their_rounding():
    """A product of k terms in float32 is wrong by (k + 2) U of the sum of its magnitudes, factors
    rounded, too; a square, a sum and a root add 2 U. In units of U of the frame: under 12."""
    seen, count = extent(box()), 16
    for target_free in (100, 10**7):
        found = sample_frames(
            seen,
            frame_count=count,
            rng=np.random.default_rng(4),
            target_free_ifovs=target_free,
            **SIGNAL,
        )
        exact, largest, terms = double_precision(seen, target_free, count, 4)
        assert terms < frames_module.NORMALS_AT_ONCE
        error = np.abs(found - exact)
        assert (error <= (terms + 6) * U * largest).all()
        assert error.max() <= 12 * U * exact.max()


def test_noise_dwarfs_the_rounding_of_float32():
    """By four orders of magnitude: U of a frame against its standard deviation."""
    seen = extent(box())
    for target_free in (0, 4000):
        mean, covariance = frame_moments(seen, target_free_ifovs=target_free, **SIGNAL)
        drawn = mean - target_free * noise_floor()  # the floor's mean is added in float64
        assert (12 * U * drawn < 1e-4 * np.sqrt(np.diagonal(covariance))).all()


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_vectors_in_float32_turn_by_their_rounding(seed):
    """A vector turns by U at most, and a cosine c by U sqrt(1 - c^2) + U^2, for each of two."""
    rng = np.random.default_rng(seed)
    vectors = profile_vector(rng.random((9, 250)) + np.eye(9, 250, 100) * 3)
    single = vectors.astype(np.float32)
    learned = CorrelationNeighbour().fit(vectors, np.arange(9))
    rounded = CorrelationNeighbour().fit(single, np.arange(9))
    difference = np.abs(learned.similarity(vectors) - rounded.similarity(single))
    assert difference.max() <= 2 * U * (1 + 1e-6)
    np.testing.assert_array_equal(learned.predict(vectors), rounded.predict(single))


def test_profile_vectors_of_float32_profiles():
    """(p - f) / (m - f): each term rounds by U of itself, over the height of the peak."""
    profile = expected_profile(extent(box()), target_free_ifovs=4000, **SIGNAL)
    exact, found = profile_vector(profile), profile_vector(profile.astype(np.float32))
    height = np.ptp(profile)
    assert np.abs(found - exact).max() <= 4 * U * profile.max() / height


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(2, 40), st.integers(2, 40))
def test_log_polar_maps_of_float32_masks(seed, rows, columns):
    """Centroid and radius move by 2 U of the image's side, samples by 3 radii's worth of that, a
    bilinear image by that over a pixel in either direction; shares themselves round by U."""
    mask = np.random.default_rng(seed).random((rows, columns))
    difference = np.abs(log_polar(mask) - log_polar(mask.astype(np.float32)))
    assert difference.max() <= U * (1 + 2 * (2 + 3) * (rows + columns))
