"""The imager: its noise, the air and the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from ncti.infrared.radiometry import contrast
from ncti.infrared.synthesis import pixel_sigma


@dataclass(frozen=True)
class Imager:
    """The passive-infrared imager, its noise, the air and the scene.

    Attributes
    ----------
    coverage_rule : float
        Share of a pixel that a ship must fill to show.
    contrast_at_zero, extinction : float
        As of `ncti.infrared.contrast` [K, dB/m].
    nedt, target_spread, sea_spread : float
        As of `ncti.infrared.pixel_sigma` [K].

    See Also
    --------
    thermal_images : Images with such noise.

    Examples
    --------
    >>> from ncti.infrared import Imager
    >>> imager = Imager(0.25, 2.1585, 0.181e-3, 0.5, 0.5, 0.5)
    >>> print(f"{imager.contrast(100e3):.2f} K")
    0.27 K
    """

    coverage_rule: float
    contrast_at_zero: float
    extinction: float
    nedt: float
    target_spread: float
    sea_spread: float

    def contrast(self, slant_range: float) -> float:
        """Return the contrast of ship to sea at a slant range [m], after the air [K]."""
        return contrast(
            slant_range, contrast_at_zero=self.contrast_at_zero, extinction=self.extinction
        )

    def sigmas(self, frame_count: ArrayLike, super_resolution: str = "none") -> dict[str, Any]:
        """Return target_sigma and sea_sigma, deviations of a pixel of averages of frames [K]."""
        noise: dict[str, Any] = {"frame_count": frame_count, "nedt": self.nedt}
        noise["super_resolution"] = super_resolution
        spreads = {"target_sigma": self.target_spread, "sea_sigma": self.sea_spread}
        return {name: pixel_sigma(spread, **noise) for name, spread in spreads.items()}
