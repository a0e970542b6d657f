"""Accuracy of sampled range extents, compared with the sampling-free reference."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from ncti.ladar.extent import RangeExtent, bin_centres
from ncti.ladar.moments import frame_moments
from ncti.ladar.pulse import target_kernel
from ncti.ladar.reference import reference_range_extent

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
    """Return the sampling-free range extent of a ship.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Closed mesh with outward winding.
    aspect, depression : float
        View angles [deg].
    slant_range, ifov, bin_width, window : float
        As of `ncti.ladar.range_extent` [m, rad, m, m].

    Returns
    -------
    RangeExtent
        As accurate as `ncti.ladar.reference.reference_range_extent`.

    See Also
    --------
    ncti.ladar.range_extent : The fast, sampled computation.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.ladar.accuracy import exact_extent
    >>> block = trimesh.creation.box(extents=(40.0, 10.0, 10.0))
    >>> beam = {"slant_range": 100e3, "ifov": 150e-6, "bin_width": 1.0, "window": 60.0}
    >>> print(f"{exact_extent(block, aspect=0, depression=30, **beam).fraction.sum():.3f}")
    1.274
    """
    centres = bin_centres(window, bin_width)
    side = ifov * (slant_range / 1e3) * 1e3  # in this order, by which results are stored
    edges = bin_width * (np.arange(centres.size + 1, dtype=np.float64) - centres.size / 2)
    view = {"aspect": aspect, "depression": depression, "slant_range": slant_range}
    exact = reference_range_extent(mesh, bin_edges=edges, side=side, **view)
    fraction = exact.area / side**2
    return RangeExtent(fraction, centres, bin_width, exact.cell, ifov, slant_range)


def extent_errors(
    extent: RangeExtent, exact: RangeExtent, *, pulse_width: float
) -> dict[str, float]:
    """Return the relative errors of a range extent, sum |p - q| over sum q.

    Parameters
    ----------
    extent, exact : RangeExtent
        That of p, and that of q, of the same bins.
    pulse_width : float
        Full width of a pulse at 1/e^2 [s].

    Returns
    -------
    dict of str to float
        extent_error, of the sums over IFOVs; ifov_error, of all IFOVs, each compared with its own;
        profile_error, of the sums after convolution with the pulse's power response.

    See Also
    --------
    RangeExtent.error_after : Bound on the last of these, without a reference.

    Examples
    --------
    >>> import numpy as np
    >>> from dataclasses import replace
    >>> from ncti.ladar import no_return
    >>> from ncti.ladar.accuracy import extent_errors
    >>> exact = replace(no_return(20.0, 1.0), fraction=np.eye(20)[9:11], cell=np.eye(2, dtype=int))
    >>> half = replace(exact, fraction=exact.fraction[:1], cell=exact.cell[:1])
    >>> errors = extent_errors(half, exact, pulse_width=30e-9)
    >>> errors["extent_error"], errors["ifov_error"]
    (0.5, 0.5)
    """
    p, q = extent.fraction.sum(axis=0), exact.fraction.sum(axis=0)
    rows = {tuple(cell): row for cell, row in zip(exact.cell.tolist(), exact.fraction, strict=True)}
    wrong = 0.0
    for cell, row in zip(extent.cell.tolist(), extent.fraction, strict=True):
        wrong += np.abs(row - rows.pop(tuple(cell), 0.0)).sum()
    wrong += sum(row.sum() for row in rows.values())
    power = target_kernel(pulse_width=pulse_width, bin_width=exact.bin_width, bin_count=len(q)) ** 2
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
    """Return draws of the deviation of averaged frames from their expectation.

    They are Gaussian, of the exact covariance, and the same for every sampling: answers then change
    by the error of the sampling and by nothing else.

    Parameters
    ----------
    extent : RangeExtent
        The exact one.
    pulse_width, cnr, target_free_ifovs, frame_count
        As of `ncti.ladar.frame_moments`.
    draws : int
        Number of draws.
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    (draw, bin) float64 ndarray
        In noise magnitudes.

    See Also
    --------
    ncti.ladar.frame_moments : The covariance.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.ladar import no_return
    >>> from ncti.ladar.accuracy import profile_noise
    >>> signal = {"pulse_width": 30e-9, "cnr": 1.0, "target_free_ifovs": 9, "frame_count": 4}
    >>> profile_noise(no_return(20.0, 1.0), draws=3, rng=np.random.default_rng(1), **signal).shape
    (3, 20)
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
