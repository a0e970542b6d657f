"""Synthetic thermal images of a ship on the sea."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_all, require_each, require_generator, require_word
from ncti.infrared import radiometry
from ncti.infrared.radiometry import (
    CONTRAST_AT_ZERO,
    EXTINCTION,
    IFOV,
    NEDT,
    SPREAD,
    Values,
    noise_temperature,
)
from ncti.infrared.scene import draw_scene
from ncti.infrared.silhouette import Extent, silhouette
from ncti.infrared.super_resolution import NOISE_GAIN, SCENE_GAIN, shifted_images
from ncti.render.image import RangeImage
from ncti.render.lines import LineImage
from ncti.render.view import check_made_at

SUPER_RESOLUTIONS = ("none", "perfect", "shifted")


def thermal_images(
    target: NDArray[np.bool_],
    *,
    contrast: float,
    frame_counts: Sequence[int] | NDArray[np.integer],
    rng: np.random.Generator,
    nedt: float = NEDT,
    target_spread: float = SPREAD,
    sea_spread: float = SPREAD,
) -> NDArray[np.float64]:
    """Draw images of a warm ship on the sea, averaged over frames.

    Parameters
    ----------
    target : (row, col) bool array_like
        True on the ship.
    contrast : float
        Mean temperature of the ship above the mean sea [K].
    frame_counts : (frame_count,) sequence of int
        Frames averaged, in any order; the averages are over prefixes of the same frames. The
        image of one count does not depend on the others.
    rng : numpy.random.Generator
        Source of randomness, with a seed sequence as `numpy.random.default_rng` provides.
    nedt : float
        Noise of one frame [K].
    target_spread, sea_spread : float
        Standard deviation of the temperature of ship and sea [K]: a fixed pattern of the scene,
        which averaging does not reduce.

    Returns
    -------
    (frame_count, row, col) float64 ndarray
        Temperature above the mean sea [K].

    Raises
    ------
    ValueError
        If a parameter is out of range, or the generator has no seed sequence.

    See Also
    --------
    image : Thermal image of a ship from its range image.
    shifted_images : Super-resolved images.
    pixel_sigma : Standard deviation of a pixel of these images.

    Notes
    -----
    Pixels of the ship are N(contrast, target_spread^2 + nedt^2 / N), those of the sea N(0,
    sea_spread^2 + nedt^2 / N), all independent [1]_. numpy's normal generator replaces the
    article's Box-Muller pairs. `ncti.infrared.scene.draw_scene` describes the order of the draws,
    and why pixels on the ship depend neither on the window's size nor on the other frame counts.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, Appendix 2.

    Examples
    --------
    Sixteen frames reduce the standard deviation to sqrt(0.1^2 + 0.4^2 / 16) = 0.14 K:

    >>> import numpy as np
    >>> ship = np.ones((40, 40), dtype=bool)
    >>> rng = np.random.default_rng(0)
    >>> images = thermal_images(ship, contrast=0.27, frame_counts=[1, 16], rng=rng)
    >>> images.std(axis=(1, 2)).round(2)
    array([0.41, 0.14])
    """
    require_generator("rng", rng)
    scene, noise = draw_scene(
        target,
        contrast=contrast,
        frame_counts=frame_counts,
        rng=rng,
        nedt=nedt,
        target_spread=target_spread,
        sea_spread=sea_spread,
    )
    return scene + noise


def pixel_sigma(
    spread: float,
    *,
    frame_count: Values,
    nedt: float = NEDT,
    super_resolution: str = "none",
) -> Values:
    """Return the standard deviation of a pixel of ship or sea, noise included.

    Parameters
    ----------
    spread : float
        Standard deviation of the temperature of ship or sea, as for `image` [K].
    frame_count : int or (...) array_like of int
        Frames averaged; at each of four positions with super-resolution `shifted`.
    nedt : float
        Noise of one frame [K].
    super_resolution : str
        As for `image`.

    Returns
    -------
    float or (...) float64 ndarray
        Standard deviation [K], away from the ship's outline.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    thermal_images : Images with this standard deviation.
    detection_probability : Detection with these standard deviations.

    Notes
    -----
    The root of (g spread)^2 + (h nedt)^2 / N, where g = 3/4 and h = 1/2 for `shifted`
    (`SCENE_GAIN` and `NOISE_GAIN` of `ncti.infrared.super_resolution`) and 1 otherwise.

    This describes one pixel. The pixels of `none` and `perfect` are independent, as
    `ncti.features.segment` assumes, but those of `shifted` share half pixels and samples.
    Neighbours in a row or column correlate by 2/3 in their spread and 1/2 in their noise, weighted
    by the variances: 0.62 by default for 16 frames.

    Examples
    --------
    >>> print(f"{pixel_sigma(0.1, frame_count=16):.3f} K")
    0.141 K
    >>> print(f"{pixel_sigma(0.1, frame_count=16, super_resolution='shifted'):.3f} K")
    0.090 K
    """
    require("spread", spread, minimum=0.0)
    require_word("super_resolution", super_resolution, SUPER_RESOLUTIONS)
    scene, detector = (SCENE_GAIN, NOISE_GAIN) if super_resolution == "shifted" else (1.0, 1.0)
    noise = noise_temperature(frame_count, nedt=nedt)
    sigma = np.hypot(scene * spread, detector * np.asarray(noise))
    plain: Any = sigma if np.ndim(noise) else float(sigma)
    return plain


def image(
    image: RangeImage | LineImage,
    *,
    slant_range: float,
    frame_count: int | Sequence[int] | NDArray[np.integer],
    rng: np.random.Generator,
    ifov: float = IFOV,
    phase: tuple[float, float] = (0.0, 0.0),
    margin: int = 4,
    extent: Extent | None = None,
    coverage_rule: float = 0.25,
    super_resolution: str = "none",
    contrast_at_zero: float = CONTRAST_AT_ZERO,
    extinction: float = EXTINCTION,
    nedt: float = NEDT,
    target_spread: float = SPREAD,
    sea_spread: float = SPREAD,
) -> NDArray[np.float64]:
    """Draw the thermal image of a ship at a range from its range image.

    Parameters
    ----------
    image : RangeImage or LineImage
        Finely resolved image, of the far field or made at this range.
    slant_range : float
        Sensor to ship origin [m], at most 1e9.
    frame_count : int or (frame_count,) sequence of int
        Frames averaged; at each of four positions with super-resolution `shifted`. The image of
        one number does not depend on the others.
    rng : numpy.random.Generator
        Source of randomness, with a seed sequence as `numpy.random.default_rng` provides.
    ifov : float
        Side of a detector pixel [rad], at most 1.
    phase, margin, extent
        As for `ncti.infrared.silhouette`, in pixels of the result.
    coverage_rule : float
        Least fraction of a pixel that the ship must fill to count as ship, in (0, 1].
    super_resolution : str
        `none`: pixels of ifov times slant range. `perfect`: pixels of half that size with the
        statistics of this range, the article's assumption. `shifted`: pixels of half that size,
        combined from frames of whole pixels at four half-pixel positions.
    contrast_at_zero, extinction, nedt
        As for `ncti.infrared.contrast` and `ncti.infrared.noise_temperature`.
    target_spread, sea_spread : float
        Standard deviation of the temperature of ship and sea [K] in a detector pixel; with
        `perfect` in a pixel of the result, half as wide, which is the article's assumption.
        `pixel_sigma` gives the standard deviation of the result's pixels, noise included.

    Returns
    -------
    (row, col) or (frame_count, row, col) float64 ndarray
        Temperature above the mean sea [K]; row 0 is the lowest.

    Raises
    ------
    ValueError
        If a parameter is out of range, the range image was made at another range, its pixels are
        larger than the sensor's, or the generator has no seed sequence.

    See Also
    --------
    silhouette : The template's coverage.
    thermal_images : Images from a binary template.
    shifted_images : Super-resolved images from a binary template.

    Notes
    -----
    A binary template of the ship at the range's pixel size, filled from two Gaussians [1]_. The
    range image is taken at the scale of the ship origin: at 4 km it includes the perspective, at
    100 km the perspective is negligible.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Passive-IR Signatures' and Appendix 2.

    Examples
    --------
    A box as large as a frigate's hull, at 100 km with 16 frames and 4 pixels of sea around it:

    >>> import numpy as np
    >>> import trimesh
    >>> from ncti.render import line_image
    >>> box = trimesh.creation.box((100, 12, 10)).apply_translation((0, 0, 5))
    >>> view = line_image(box, aspect=90, depression=3.84)
    >>> rng = np.random.default_rng(0)
    >>> image(view, slant_range=100e3, frame_count=16, rng=rng).shape
    (10, 16)
    """
    # Checked here so that errors name the parameters of this call. The largest range and angle keep
    # a pixel's area finite; the largest count is the last that a float distinguishes from the next.
    require("slant_range", slant_range, positive=True, maximum=1e9)
    require("ifov", ifov, positive=True, maximum=1.0)
    counts = require_all("frame_count", frame_count, whole=True, minimum=1.0, maximum=2.0**53)
    if counts.ndim > 1 or counts.size == 0:
        raise ValueError(
            f"frame_count has shape {counts.shape}, but must be a number or a sequence of them"
        )
    require_each("phase", phase, 2, minimum=0.0, below=1.0)
    if extent is not None:
        require_each("extent", extent, 4)
    require("coverage_rule", coverage_rule, positive=True, maximum=1.0)
    require_word("super_resolution", super_resolution, SUPER_RESOLUTIONS)
    check_made_at(image.slant_range, slant_range)
    footprint = ifov * slant_range * (1.0 if super_resolution == "none" else 0.5)
    if footprint < image.resolution:
        raise ValueError(
            f"slant_range is {slant_range!r} and ifov {ifov!r}, which make pixels of "
            f"{footprint:g} m, but they must be at least the range image's {image.resolution:g} m"
        )
    # A binary template of the ship, filled with temperatures of ship and sea.
    shape = silhouette(image, footprint=footprint, phase=phase, margin=margin, extent=extent)
    target = shape.target(coverage_rule)
    contrast = radiometry.contrast(
        float(slant_range), contrast_at_zero=contrast_at_zero, extinction=extinction
    )
    draw = shifted_images if super_resolution == "shifted" else thermal_images
    images = draw(
        target,
        contrast=contrast,
        frame_counts=np.atleast_1d(counts).astype(np.int64),
        rng=rng,
        nedt=nedt,
        target_spread=target_spread,
        sea_spread=sea_spread,
    )
    return images[0] if counts.ndim == 0 else images
