"""Thermal images of a binary template of a ship on the sea."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_word
from ncti.infrared.radiometry import NEDT, SPREAD, Values, float_or_array, noise_temperature
from ncti.infrared.scene import draw_scene
from ncti.infrared.super_resolution import NOISE_GAIN, SCENE_GAIN

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
    return float_or_array(np.hypot(scene * spread, detector * np.asarray(noise)))
