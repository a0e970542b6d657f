"""Views with enough samples: at a given pixel, or at a finer one where a ship looks small."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from ncti.render.draw import range_image
from ncti.render.draw_lines import PHASE, line_image, refined
from ncti.render.loops import LINES, MASK
from ncti.render.surfaces import Surfaces
from ncti.render.view import View

if TYPE_CHECKING:
    from ncti.render.image import RangeImage
    from ncti.render.mask import Mask
    from ncti.ships.shape import Mesh

MIN_SHARE = 0.25
"""Finest pixel, relative to the given one; a finer one would gain little, as on a thin pole."""

MAX_VISIBLE_SHARE = 0.9
"""Largest visible share of the area that faces the sensor: 0.45 to 0.65 for ships seen end-on, up
to 0.9 abeam."""


@dataclass(frozen=True)
class Sampling:
    """Sampling of views: engine, pixel, least number of samples, and roll.

    Attributes
    ----------
    engine : str
        Name of a rendering engine, `lines`, or `mask`: pixels without depth, for silhouettes.
    pixel : float
        Pixel on the target, or distance of lines [m].
    samples : int
        Smallest number of samples on the ship; views of fewer are drawn again, finer.
    roll : float
        Roll of the pixels about the line of sight [deg], of opposite sign for aspects above 180,
        so that the lattice is mirrored where a symmetric ship is.

    See Also
    --------
    range_image, line_image : Draw the images.

    Notes
    -----
    Ships look small end-on: with the same pixel at all aspects, end-on views would have several
    times the error of broadsides, and ships differ mostly at their ends. The pixel is at least a
    quarter of the given one.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.render import Sampling
    >>> box = trimesh.creation.box(extents=(100, 20, 10))
    >>> coarse = Sampling("lines", pixel=1.0, samples=3000, roll=0.0)
    >>> [coarse.draw(box, aspect=a, depression=3.84).spacing for a in (90.0, 0.0)]
    [0.5, 0.25]
    """

    engine: str
    pixel: float
    samples: int
    roll: float

    def roll_at(self, aspect: float) -> float:
        """Return the roll at an aspect [deg]."""
        return self.roll if aspect <= 180 else -self.roll

    def draw(
        self,
        mesh: Mesh,
        *,
        aspect: float,
        depression: float,
        slant_range: float | None = None,
    ) -> Any:
        """Return the view at an aspect and depression [deg], in the far field without a range.

        A `RangeImage`, a `LineImage` by lines, or a `ncti.render.mask.Mask`.
        """
        view: Any = {"aspect": aspect, "depression": depression, "slant_range": slant_range}
        roll = self.roll_at(aspect)
        if self.engine == LINES:
            # Halve the spacing until there are enough lines. Where a bound on the area shows that
            # coarse lines are too few, start with finer ones.
            sight = View(aspect, depression).axes[2]
            area, halvings = MAX_VISIBLE_SHARE * Surfaces.of(mesh).facing_area(-sight), 0
            while self._is_coarse(area, self.pixel / 2**halvings):
                halvings += 1
            first = {"spacing": self.pixel / 2**halvings, "phase": 2**halvings * PHASE % 1}
            lines = line_image(mesh, roll=roll, **first, **view)
            while (area := float(lines.area.sum())) > 0 and self._is_coarse(area, lines.spacing):
                lines = refined(mesh, lines)
            return lines
        draw: Callable[..., RangeImage | Mask]
        if self.engine == MASK:
            from ncti.render.mask import ship_mask as draw
        else:
            draw = partial(range_image, engine=self.engine)
        image = draw(mesh, pixel=self.pixel, roll=roll, **view)
        hits = int(image.hit.sum())
        if 0 < hits < self.samples:
            finer = self.pixel * max(math.sqrt(hits / self.samples), MIN_SHARE)
            image = draw(mesh, pixel=finer, roll=roll, **view)
        return image

    def _is_coarse(self, area: float, spacing: float) -> bool:
        """Return whether an area [m^2] has too few samples and the spacing may be halved."""
        return area < self.samples * spacing**2 and spacing > MIN_SHARE * self.pixel
