"""Float32 against float64, in units of its rounding, from the mesh to the name."""

import math

import numpy as np
from hard_meshes import box, see

import ncti.ladar.frames as frames_module
from ncti.ladar import noise_floor, range_extent, sample_frames
from ncti.ladar.moments import magnitude_covariance
from ncti.ladar.pulse import noise_covariance, target_kernel

U = float(np.finfo(np.float32).eps) / 2  # relative rounding of a float32
SIGNAL = {"pulse_width": 30e-9, "cnr": 10**3.2}
VIEW = {"aspect": 37.0, "depression": 3.84}


def extent(solid):
    return range_extent(see("lines", solid, pixel=0.25, **VIEW), slant_range=1e5)


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
