"""The imager, its noise, the air and the scene, and its image of a ship."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_each, require_instance, require_word
from ncti.infrared.radiometry import CONTRAST_AT_ZERO, EXTINCTION, IFOV, NEDT, SPREAD, contrast
from ncti.infrared.silhouette import silhouette
from ncti.infrared.super_resolution import shifted_images
from ncti.infrared.synthesis import SUPER_RESOLUTIONS, pixel_sigma, thermal_images
from ncti.render.image import RangeImage
from ncti.render.lines import LineImage
from ncti.render.view import check_made_at


@dataclass(frozen=True)
class Imager:
    """The passive-infrared imager, its noise, the air and the scene.

    Attributes
    ----------
    coverage_rule : float
        Share of a pixel that a ship must fill to show, in (0, 1].
    contrast_at_zero, extinction : float
        As of `ncti.infrared.contrast` [K, dB/m].
    nedt, target_spread, sea_spread : float
        As of `ncti.infrared.pixel_sigma` [K].

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    image : Image of a ship taken by an imager.
    thermal_images : Images with such noise.

    Notes
    -----
    The defaults are the article's imager [1]_ and the spreads and coverage assumed in sweeps.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Passive-IR Signatures'.

    Examples
    --------
    >>> from ncti.infrared import Imager
    >>> imager = Imager(nedt=0.5)
    >>> print(f"{imager.contrast(100e3):.2f} K")
    0.27 K
    """

    coverage_rule: float = 0.25
    contrast_at_zero: float = CONTRAST_AT_ZERO
    extinction: float = EXTINCTION
    nedt: float = NEDT
    target_spread: float = SPREAD
    sea_spread: float = SPREAD

    def __post_init__(self) -> None:
        require("coverage_rule", self.coverage_rule, positive=True, maximum=1.0)
        require("contrast_at_zero", self.contrast_at_zero)
        for name in ("extinction", "nedt", "target_spread", "sea_spread"):
            require(name, getattr(self, name), minimum=0.0)

    def contrast(self, slant_range: float) -> float:
        """Return the contrast of ship to sea at a slant range [m], after the air [K]."""
        return contrast(
            slant_range, contrast_at_zero=self.contrast_at_zero, extinction=self.extinction
        )

    def sigmas(self, frame_count: ArrayLike, super_resolution: str = "none") -> dict[str, Any]:
        """Return target_sigma and sea_sigma, standard deviations of a frame-averaged pixel [K]."""
        noise: dict[str, Any] = {"frame_count": frame_count, "nedt": self.nedt}
        noise["super_resolution"] = super_resolution
        spreads = {"target_sigma": self.target_spread, "sea_sigma": self.sea_spread}
        return {name: pixel_sigma(spread, **noise) for name, spread in spreads.items()}

    def images(
        self,
        target: NDArray[np.bool_],
        *,
        contrast: float,
        frame_counts: Sequence[int] | NDArray[np.integer],
        rng: np.random.Generator,
        super_resolution: str,
    ) -> NDArray[np.float64]:
        """Return the images (frame_count, row, col) [K] of a binary template by a method."""
        draw = shifted_images if super_resolution == "shifted" else thermal_images
        return draw(
            target,
            contrast=contrast,
            frame_counts=frame_counts,
            rng=rng,
            nedt=self.nedt,
            target_spread=self.target_spread,
            sea_spread=self.sea_spread,
        )


IMAGER = Imager()


def image(
    image: RangeImage | LineImage,
    *,
    slant_range: float,
    frame_count: int | Sequence[int] | NDArray[np.integer],
    rng: np.random.Generator,
    ifov: float = IFOV,
    phase: tuple[float, float] = (0.0, 0.0),
    super_resolution: str = "none",
    imager: Imager = IMAGER,
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
    phase : (float, float)
        As for `ncti.infrared.silhouette`, in pixels of the result.
    super_resolution : str
        `none`: pixels of ifov times slant range. `perfect`: pixels of half that size with the
        statistics of this range, the article's assumption. `shifted`: pixels of half that size,
        combined from frames of whole pixels at four half-pixel positions.
    imager : Imager
        The imager, the air and the scene. Its spreads are those of a detector pixel; with `perfect`
        of a pixel of the result, half as wide, which is the article's assumption. `pixel_sigma`
        gives the standard deviation of the result's pixels, noise included.

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
    silhouette : The template's coverage, in any window.
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
    require_instance("imager", imager, Imager)
    require_word("super_resolution", super_resolution, SUPER_RESOLUTIONS)
    check_made_at(image.slant_range, slant_range)
    footprint = ifov * slant_range * (1.0 if super_resolution == "none" else 0.5)
    if footprint < image.resolution:
        raise ValueError(
            f"slant_range is {slant_range!r} and ifov {ifov!r}, which make pixels of "
            f"{footprint:g} m, but they must be at least the range image's {image.resolution:g} m"
        )
    # A binary template of the ship, filled with temperatures of ship and sea.
    target = silhouette(image, footprint=footprint, phase=phase).target(imager.coverage_rule)
    images = imager.images(
        target,
        contrast=imager.contrast(float(slant_range)),
        frame_counts=np.atleast_1d(counts).astype(np.int64),
        rng=rng,
        super_resolution=super_resolution,
    )
    return images[0] if counts.ndim == 0 else images
