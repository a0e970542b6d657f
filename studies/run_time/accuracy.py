"""Accuracy of sampled range extents, compared with the sampling-free reference."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from ncti.ladar.extent import RangeExtent, bin_centres
from ncti.ladar.moments import frame_moments
from ncti.ladar.pulse import Pulse, target_kernel
from studies.run_time.reference import reference_range_extent

Floats = NDArray[np.float64]


def exact_extent(
    mesh: trimesh.Trimesh,
    *,
    aspect: float,
    depression: float,
    slant_range: float,
    ifov: float,
    bin_width: float,
    window: float,
) -> RangeExtent:
    """Return the sampling-free range extent of a ship, of `reference_range_extent`.

    Angles are in degrees, other arguments as of `ncti.ladar.range_extent`.
    """
    centres = bin_centres(window, bin_width)
    side = ifov * (slant_range / 1e3) * 1e3  # stored results depend on this order
    edges = bin_width * (np.arange(centres.size + 1, dtype=np.float64) - centres.size / 2)
    view = {"aspect": aspect, "depression": depression, "slant_range": slant_range}
    exact = reference_range_extent(mesh, bin_edges=edges, side=side, **view)
    fraction = exact.area / side**2
    return RangeExtent(fraction, centres, bin_width, exact.cell, ifov, slant_range)


def extent_errors(
    extent: RangeExtent, exact: RangeExtent, *, pulse_width: float
) -> dict[str, float]:
    """Return the relative errors of a range extent, sum |p - q| over sum q, against the exact q.

    `extent_error` compares sums over IFOVs, `ifov_error` each IFOV separately, and `profile_error`
    sums over IFOVs after the power response of a pulse. `pulse_width` [s].
    """
    p, q = extent.fraction.sum(axis=0), exact.fraction.sum(axis=0)
    rows = {tuple(cell): row for cell, row in zip(exact.cell.tolist(), exact.fraction, strict=True)}
    wrong = 0.0
    for cell, row in zip(extent.cell.tolist(), extent.fraction, strict=True):
        wrong += np.abs(row - rows.pop(tuple(cell), 0.0)).sum()
    wrong += sum(row.sum() for row in rows.values())
    power = target_kernel(Pulse(pulse_width, exact.bin_width), len(q)) ** 2
    return {
        "extent_error": float(np.abs(p - q).sum() / q.sum()),
        "ifov_error": float(wrong / exact.fraction.sum()),
        "profile_error": float(np.abs(power @ p - power @ q).sum() / (power @ q).sum()),
    }


def profile_noise(
    extent: RangeExtent,
    *,
    pulse_width: float,
    cnr: float,
    target_free_ifovs: int,
    frame_count: int,
    draws: int,
    rng: np.random.Generator,
) -> Floats:
    """Return (draw, bin) Gaussian deviations of averaged frames, of the exact covariance.

    Every sampling gets the same noise, so that answers change by the sampling error alone.
    """
    _, covariance = frame_moments(
        extent,
        pulse_width=pulse_width,
        cnr=cnr,
        target_free_ifovs=target_free_ifovs,
        frame_count=frame_count,
    )
    variance, direction = np.linalg.eigh(covariance)
    factor = direction * np.sqrt(np.maximum(variance, 0.0))
    drawn: Floats = rng.standard_normal((draws, len(factor))) @ factor.T
    return drawn
