"""Silhouettes of many views on the imager's pixels, and their match with templates."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_shape
from ncti.infrared.imager import Imager
from studies.operate.matching import fit_inverse_temperature, log_evidence
from studies.operate.survey import Seen

Singles = NDArray[np.float32]


def silhouettes(
    seen: Seen,
    *,
    footprint: float,
    coverage_rule: float,
    length: float,
    height: float,
    depression: float,
) -> NDArray[np.bool_]:
    """Return the pixels of the imager that show a ship, in a window around its origin.

    Parameters
    ----------
    seen : Seen
        What IFOVs see of the ship.
    footprint : float
        Side of a pixel on the target [m].
    coverage_rule : float
        Share of a pixel that a ship must fill to show.
    length, height : float
        Length and height of the largest ship [m], which decide the window.
    depression : float
        Depression of the line of sight [deg].

    Returns
    -------
    (view, row, column) bool ndarray
        True on the ship. The pixel of the ship origin is at one place in all windows.

    Raises
    ------
    ValueError
        If a parameter is out of range, or the ship does not fit.

    See Also
    --------
    ncti.infrared.silhouette : One view.

    Examples
    --------
    >>> import trimesh
    >>> from studies.operate import draw_views, seen_views, silhouettes
    >>> box = trimesh.creation.box((100, 12, 10)).apply_translation((0, 0, 5))
    >>> seen = seen_views(draw_views(box, [90.0], spacing=1.0), [(0.5, 0.5)], footprint=15.0)
    >>> shown = silhouettes(
    ...     seen, footprint=15.0, coverage_rule=0.25, length=120, height=20, depression=3.84
    ... )
    >>> shown.shape, int(shown.sum())
    ((1, 5, 10), 7)
    """
    require("footprint", footprint, positive=True)
    require("coverage_rule", coverage_rule, positive=True, maximum=1.0)
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

    Parameters
    ----------
    templates : (ship, template, row, column) bool ndarray
        Silhouettes of the ships, as of `silhouettes`.
    tests : (test, row, column) bool ndarray
        Silhouettes of the views to identify.
    left_out : (ship, view, row, column) bool ndarray
        Silhouettes of other random views, which say how far the match is to be trusted.
    rng : numpy.random.Generator
        Draws the noise of scene and detector.

    See Also
    --------
    ncti.infrared.thermal_images : The images.
    log_evidence : The likelihood.

    Notes
    -----
    A pixel that the ship fills to the rule has the contrast of the ship, all others that of the
    sea, and every pixel has independent noise of the scene and of the detector
    (`ncti.infrared.thermal_images`). Ship and sea have the same spread here, so the noise is
    white. Images are linear in contrast and noise, so that products of templates with the
    silhouettes, the scene and the detector's noise serve for every range and number of frames. The
    pixel of the ship origin is known, the place within it is not.

    Between templates lies a mean square difference of the nearest of a ship, shared out over the
    pixels of the ship, that adds to the variance of the noise. It is not white: pixels along an
    edge err together and count as fewer. All log densities are therefore multiplied by the factor
    that predicts the ships of views left out best, for each range and number of frames
    (`studies.operate.matching.fit_inverse_temperature`), but no less than if all pixels of a ship
    erred together: where noise prevails, it is 1.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.infrared import Imager
    >>> from studies.operate import SilhouetteMatch, ship_evidence
    >>> ships = np.zeros((2, 1, 4, 20), bool)
    >>> ships[0, 0, 1:3, 6:14] = ships[1, 0, 1:3, 2:18] = True
    >>> match = SilhouetteMatch(ships, ships[:, 0], ships, np.random.default_rng(0))
    >>> imager = Imager(0.25, 2.16, 0.181e-3, 0.4, 0.1, 0.1)
    >>> evidence = match.evidence(16, imager=imager, slant_range=50e3, gain_sigma=1.0)
    >>> ship_evidence(evidence, 2).argmax(axis=1).tolist()
    [0, 1]
    """

    def __init__(
        self,
        templates: NDArray[np.bool_],
        tests: NDArray[np.bool_],
        left_out: NDArray[np.bool_],
        rng: np.random.Generator,
    ) -> None:
        require_shape("tests", tests, (len(tests), *templates.shape[2:]))
        require_shape(
            "left_out", left_out, (len(templates), *left_out.shape[1:2], *tests.shape[1:])
        )
        # Only pixels that some template or test shows tell ships apart.
        used = templates.any(axis=(0, 1)) | tests.any(axis=0)
        learned = templates[..., used].astype(np.float32)
        seen = tests[:, used].astype(np.float32)
        # Neighbours have the ship at other places on the pixels.
        apart = np.abs(np.diff(learned, axis=1)).sum(axis=2, dtype=np.float64)
        of_all = learned.reshape(-1, learned.shape[-1])
        self.size = of_all.sum(axis=1, dtype=np.float64)
        nearest = np.minimum(apart[:, 1:], apart[:, :-1]) if apart.shape[1] > 1 else apart
        some = float(nearest.mean()) if nearest.size else 0.0
        self.between = some / max(float(self.size.mean()), 1.0)
        self._ships, views = left_out.shape[:2]
        self._truth = np.repeat(np.arange(self._ships), views)
        others = left_out[..., used].reshape(-1, of_all.shape[1]).astype(np.float32)
        # Of the silhouettes, the scene and the detector.
        self._tests, self._left_out = (
            [rows @ of_all.T for rows in (these, *_normals(rng, these))] for these in (seen, others)
        )
        self._fitted: dict[tuple[float, Imager, float, float], float] = {}

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

        def white(products: Sequence[Singles]) -> Singles:
            """Return the log likelihood of some views if errors of pixels were independent."""
            factors = [np.float32(contrast * scale / variance) for scale in scales]
            product = products[0] * factors[0]
            product += products[1] * factors[1]
            product += products[2] * factors[2]
            energy = self.size * (contrast**2 / variance)
            return log_evidence(product, energy, gain_sigma=gain_sigma)

        how = frame_count, imager, slant_range, gain_sigma
        if how not in self._fitted:
            # At worst, all pixels of a ship err together.
            least = variance / (noise + error * max(float(self.size.mean()), 1.0))
            others = white(self._left_out)
            self._fitted[how] = fit_inverse_temperature(
                others, self._ships, self._truth, least=least
            )
        evidence = white(self._tests)
        evidence *= np.float32(self._fitted[how])
        return evidence


def _normals(rng: np.random.Generator, views: Singles) -> Singles:
    return rng.standard_normal((2, *views.shape), dtype=np.float32)
