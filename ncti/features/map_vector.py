"""Log-polar maps of segmented silhouettes, in bytes and as vectors for classifiers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.features.log_polar import log_polar

ANGLES, RADII = 64, 32
"""Cells of a map."""

STEPS = 255
"""Steps of a cell between empty and full."""

INNER_RADIUS, INTERPOLATION = 0.5, "nearest"


def silhouette_map(
    mask: ArrayLike, *, inner_radius: float = INNER_RADIUS, interpolation: str = INTERPOLATION
) -> NDArray[np.uint8]:
    """Return log-polar maps of silhouettes as bytes, 255 for a full cell.

    Parameters
    ----------
    mask : (..., row, col) array_like
        Silhouettes, as of `log_polar`.
    inner_radius : float
        Inner radius of the map, in units of sqrt(area / pi).
    interpolation : str
        `bilinear` or `nearest`.

    Returns
    -------
    (..., angle, radius) uint8 ndarray
        64 angles and 32 radii. Half a step is negligible beside the noise of a pixel.

    Raises
    ------
    ValueError
        As of `log_polar`.

    See Also
    --------
    map_vector : Vectors of such maps.
    segment : Silhouettes of infrared images.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.features import silhouette_map
    >>> row, col = np.mgrid[:80, :80]
    >>> silhouette_map((row - 40) ** 2 + (col - 40) ** 2 <= 30**2)[0, ::5].tolist()
    [255, 255, 255, 0, 0, 0, 0]
    """
    cells = log_polar(
        mask, inner_radius=inner_radius, interpolation=interpolation, angles=ANGLES, radii=RADII
    )
    return np.rint(STEPS * cells).astype(np.uint8)


def map_cells() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the angles [deg] and relative log radii of the cells of maps.

    Angles (angle,) increase about the centroid from the right upwards; relative log radii (radius,)
    increase from 0 at the inner radius to 1 at the outer radius.
    """
    angle, radius = np.arange(ANGLES, dtype=np.float64), np.arange(RADII, dtype=np.float64)
    return 360 / ANGLES * (angle + 0.5), (radius + 0.5) / RADII


def map_vector(maps: ArrayLike) -> NDArray[np.float32]:
    """Return byte maps of silhouettes as vectors of cell coverage.

    Parameters
    ----------
    maps : (..., angle, radius) array_like of uint8
        Maps of `silhouette_map`.

    Returns
    -------
    (..., feature) float32 ndarray
        Shares of the cells, angle by angle, in [0, 1].

    Raises
    ------
    ValueError
        If they are not maps of bytes.

    See Also
    --------
    silhouette_map : The maps.
    profile_vector : Vectors of range profiles.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.features import map_vector
    >>> map_vector(np.array([[255, 0], [51, 0]], dtype=np.uint8))
    array([1. , 0. , 0.2, 0. ], dtype=float32)
    """
    array = np.asarray(maps)
    if array.dtype != np.uint8 or array.ndim < 2:
        raise ValueError(
            f"maps has shape {array.shape} and type {array.dtype}, but must be (..., angle, radius)"
            " of uint8"
        )
    flat = array.reshape(*array.shape[:-2], array.shape[-2] * array.shape[-1])
    return np.asarray(flat * np.float32(1 / STEPS), dtype=np.float32)
