"""Silhouettes of many views on the imager's pixels, and their match with templates."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncti.infrared.imager import Imager
from studies.operate.matching import fit_inverse_temperature, log_evidence
from studies.operate.survey import ViewExtents

Singles = NDArray[np.float32]


def silhouettes(
    seen: ViewExtents,
    *,
    footprint: float,
    coverage_rule: float,
    length: float,
    height: float,
    depression: float,
) -> NDArray[np.bool_]:
    """Return (view, row, column) masks of the pixels that show a ship, in a window around it.

    The origin lies in the same pixel of every window. `footprint` is the side of a pixel on the
    target [m]; a ship must fill the share `coverage_rule` of a pixel. `length` and `height` of the
    largest ship [m] and `depression` [deg] set the window.
    """
    down = math.radians(depression)
    tilted = length / 2 * math.sin(down)
    # Pixels to the left of and below the one with the origin, and all of them.
    left, below = (math.ceil(reach / footprint) + 1 for reach in (length / 2, tilted))
    above = math.ceil((tilted + height * math.cos(down)) / footprint) + 1
    shape = below + above, 2 * left
    show = seen.coverage >= coverage_rule
    column, row = seen.cell[show].T.astype(np.intp) + np.array([[left], [below]])
    inside = (column >= 0) & (column < shape[1]) & (row >= 0) & (row < shape[0])
    if not inside.all():
        raise ValueError(
            f"length and height are {length:g} and {height:g} m, but must be those of the ship"
        )
    window = np.zeros((len(seen.ifovs), *shape), bool)
    window[seen.view[show], row, column] = True
    return window


class SilhouetteMatch:
    """Averaged infrared images and their likelihood under the silhouettes of several ships.

    `templates` (ship, template, row, column), `tests` (test, row, column) to identify, and
    `left_out` (ship, view, row, column), random views for calibration, are masks of `silhouettes`.

    Each pixel of the ship has its contrast, all others that of the sea, and every pixel independent
    noise of scene and detector, as in `ncti.infrared.thermal_images`. Ship and sea have the same
    spread here, so the noise is white. Images are linear in contrast and noise: products of
    templates with silhouettes, scene and detector noise serve every range and frame count. The
    pixel of the ship origin is known, its place in the pixel is not.

    The mean square difference between nearest templates of a ship, spread over its pixels, adds to
    the noise. As pixels along an edge err together, `fit_inverse_temperature` scales all log
    densities to fit the views left out, for each range and frame count, but no less than if all
    pixels of a ship erred together.
    """

    def __init__(
        self,
        templates: NDArray[np.bool_],
        tests: NDArray[np.bool_],
        left_out: NDArray[np.bool_],
        rng: np.random.Generator,
    ) -> None:
        # Only pixels that some template or test covers distinguish ships.
        occupied = templates.any(axis=(0, 1)) | tests.any(axis=0)
        template_pixels = templates[..., occupied].astype(np.float32)
        test_pixels = tests[:, occupied].astype(np.float32)
        # Neighbours have the ship at other places on the pixels.
        change = np.abs(np.diff(template_pixels, axis=1)).sum(axis=2, dtype=np.float64)
        of_all = template_pixels.reshape(-1, template_pixels.shape[-1])
        self.size = of_all.sum(axis=1, dtype=np.float64)
        nearest = np.minimum(change[:, 1:], change[:, :-1]) if change.shape[1] > 1 else change
        mean_difference = float(nearest.mean()) if nearest.size else 0.0
        self.between = mean_difference / max(float(self.size.mean()), 1.0)
        self._ships, views = left_out.shape[:2]
        self._true_ships = np.repeat(np.arange(self._ships), views)
        calibration = left_out[..., occupied].reshape(-1, of_all.shape[1]).astype(np.float32)
        # Products with the silhouettes, the scene noise and the detector noise.
        self._tests, self._left_out = (
            [rows @ of_all.T for rows in (masks, *_draw_normals(rng, masks))]
            for masks in (test_pixels, calibration)
        )
        self._inverse_temperatures: dict[tuple[float, Imager, float, float], float] = {}

    def evidence(
        self, frame_count: float, *, imager: Imager, slant_range: float, gain_sigma: float
    ) -> Singles:
        """Return the (test, template) log likelihood of averages, as of `log_evidence`."""
        contrast = imager.contrast(slant_range)
        detector = imager.nedt / math.sqrt(frame_count)
        noise = imager.target_spread**2 + detector**2
        error = contrast**2 * self.between
        scales = contrast, imager.target_spread, detector
        variance = noise + error

        def white_evidence(products: Sequence[Singles]) -> Singles:
            """Return the log likelihood of some views if errors of pixels were independent."""
            factors = [np.float32(contrast * scale / variance) for scale in scales]
            product = products[0] * factors[0]
            product += products[1] * factors[1]
            product += products[2] * factors[2]
            energy = self.size * (contrast**2 / variance)
            return log_evidence(product, energy, gain_sigma=gain_sigma)

        key = frame_count, imager, slant_range, gain_sigma
        if key not in self._inverse_temperatures:
            # At worst, all pixels of a ship err together.
            least = variance / (noise + error * max(float(self.size.mean()), 1.0))
            calibration = white_evidence(self._left_out)
            self._inverse_temperatures[key] = fit_inverse_temperature(
                calibration, self._ships, self._true_ships, least=least
            )
        evidence = white_evidence(self._tests)
        evidence *= np.float32(self._inverse_temperatures[key])
        return evidence


def _draw_normals(rng: np.random.Generator, views: Singles) -> Singles:
    return rng.standard_normal((2, *views.shape), dtype=np.float32)
