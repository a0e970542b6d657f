"""Synthetic thermal images of a ship on the sea."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_all, require_each, require_generator
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
    """Images of a warm ship on the sea, averaged over frames.

    Parameters
    ----------
    target : (row, col) bool array_like
        True on the ship.
    contrast : float
        Mean temperature of the ship against the mean sea [K].
    frame_counts : (frame_count,) sequence of int
        Frames averaged, in any order; the averages are over prefixes of the same frames. The
        image of one count does not depend on the others.
    rng : numpy.random.Generator
        Source of randomness, with a seed sequence as `numpy.random.default_rng` gives it.
    nedt : float
        Noise of one frame [K].
    target_spread, sea_spread : float
        Own standard deviation of ship and sea [K]: a fixed pattern of the scene, which averaging
        does not lessen.

    Returns
    -------
    (frame_count, row, col) float64 ndarray
        Temperature against the mean sea [K].

    Raises
    ------
    ValueError
        If a parameter is out of range, or the generator has no seed sequence.

    Notes
    -----
    Article, Appendix 2: pixels of the ship are N(contrast, target_spread^2 + nedt^2 / N), those of
    the sea N(0, sea_spread^2 + nedt^2 / N), all independent. numpy's normals stand in for the
    article's Box-Muller pairs. `ncti.infrared.scene.draw_scene` says how they are drawn, and why
    neither the window's size matters on the ship nor one frame count to another.
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
    """Standard deviation of a pixel of ship or sea, noise included.

    Parameters
    ----------
    spread : float
        Own standard deviation of ship or sea, as for `image` [K].
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

    Notes
    -----
    The root of (g spread)^2 + (h nedt)^2 / N, with g and h `scene_gain` and `noise_gain` for
    `shifted` and 1 otherwise: 0.141 K by default for 16 frames, 0.090 K for `shifted`.

    This describes one pixel. The pixels of `none` and `perfect` are independent, as
    `ncti.features.segment` takes all to be, but those of `shifted` share half pixels and samples.
    Of shift-and-add, neighbours in a row or column correlate by 2/3 in their spread and 1/2 in
    their noise, weighted by the variances: 0.62 by default for 16 frames.
    """
    require("spread", spread, minimum=0.0)
    _require_way(super_resolution)
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
    """Thermal image of the ship of a range image, as the sensor sees it from a range.

    Parameters
    ----------
    image : RangeImage or LineImage
        Finely resolved range image, of the far field or made at this range.
    slant_range : float
        Sensor to ship origin [m], at most 1e9.
    frame_count : int or (frame_count,) sequence of int
        Frames averaged; at each of four positions with super-resolution `shifted`. The image of
        one number does not depend on the others.
    rng : numpy.random.Generator
        Source of randomness, with a seed sequence as `numpy.random.default_rng` gives it.
    ifov : float
        Side of a detector pixel [rad], at most 1.
    phase, margin, extent
        As for `ncti.infrared.silhouette`, in pixels of the result.
    coverage_rule : float
        Least fraction of a pixel that the ship must fill to count as ship, in (0, 1].
    super_resolution : str
        `none`: pixels of ifov times slant range. `perfect`: half of that with the statistics of
        this range, the article's assumption. `shifted`: the same grid, recombined from frames of
        whole pixels at four half-pixel positions.
    contrast_at_zero, extinction, nedt
        As for `ncti.infrared.contrast` and `ncti.infrared.noise_temperature`.
    target_spread, sea_spread : float
        Own standard deviation of ship and sea [K] in a detector pixel; with `perfect` in a pixel
        of the result, half as wide, which is the article's assumption. `pixel_sigma` is what the
        pixels of the result come to, noise included.

    Returns
    -------
    (row, col) or (frame_count, row, col) float64 ndarray
        Temperature against the mean sea [K]; row 0 is the lowest.

    Raises
    ------
    ValueError
        If a parameter is out of range, the range image was made at another range, its pixels are
        larger than the sensor's, or the generator has no seed sequence.

    Notes
    -----
    Article, 'Passive-IR Signatures' and Appendix 2: a binary template of the ship at the range's
    pixel, filled from two Gaussians. The range image is taken at the scale of the ship origin: at
    4 km its perspective is in it, at 100 km there is none to speak of.
    """
    # Refused here what `silhouette` and the rest would refuse by a name that is not of this call.
    # The greatest range and angle keep a pixel's area finite; the greatest count is the last that
    # a float tells from the next.
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
    _require_way(super_resolution)
    made_at = image.slant_range
    if made_at is not None and not math.isclose(made_at, slant_range):
        raise ValueError(
            f"slant_range is {slant_range!r}, but must be the {made_at!r} m at which the range "
            "image was made"
        )
    footprint = ifov * slant_range * (1.0 if super_resolution == "none" else 0.5)
    if footprint < image.resolution:
        raise ValueError(
            f"slant_range is {slant_range!r} and ifov {ifov!r}, which make pixels of "
            f"{footprint:g} m, but they must be at least the range image's {image.resolution:g} m"
        )
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


def _require_way(super_resolution: str) -> None:
    """Raise unless it is one of the ways."""
    if super_resolution not in SUPER_RESOLUTIONS:
        raise ValueError(
            f"super_resolution is {super_resolution!r}, but must be none, perfect or shifted"
        )
