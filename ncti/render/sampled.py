"""Views of enough samples: at a given pixel, or at a finer one where a ship looks small."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from ncti.render.draw import range_image
from ncti.render.draw_lines import line_image, refined
from ncti.render.loops import LINES, MASK

if TYPE_CHECKING:
    import trimesh

    from ncti.render.image import RangeImage
    from ncti.render.mask import Mask

FINEST = 0.25
"""Finest pixel of the given one: more would not pay for the few samples of a thin pole."""


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
    range_image, line_image : What is drawn.

    Notes
    -----
    Ends of ships are small: at one pixel for all, they would err several times more than
    broadsides, and ships differ mostly at their ends. The pixel is at least a quarter of the
    given one.

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

    def rolled(self, aspect: float) -> float:
        """Return the roll at an aspect [deg]."""
        return self.roll if aspect <= 180 else -self.roll

    def draw(
        self,
        mesh: trimesh.Trimesh,
        *,
        aspect: float,
        depression: float,
        slant_range: float | None = None,
    ) -> Any:
        """Return the view at an aspect and depression [deg], in the far field without a range.

        A `RangeImage`, a `LineImage` by lines, or a `ncti.render.mask.Mask`.
        """
        view: Any = {"aspect": aspect, "depression": depression, "slant_range": slant_range}
        roll = self.rolled(aspect)
        if self.engine == LINES:
            lines = line_image(mesh, spacing=self.pixel, roll=roll, **view)
            while (
                0 < lines.area.sum() < self.samples * lines.spacing**2
                and lines.spacing > FINEST * self.pixel
            ):
                lines = refined(mesh, lines)
            return lines
        draw: Callable[..., RangeImage | Mask]
        if self.engine == MASK:
            from ncti.render.mask import ship_mask as draw  # numba takes long to import
        else:
            draw = partial(range_image, engine=self.engine)
        drawn = draw(mesh, pixel=self.pixel, roll=roll, **view)
        hits = int(drawn.hit.sum())
        if 0 < hits < self.samples:
            finer = self.pixel * max(math.sqrt(hits / self.samples), FINEST)
            drawn = draw(mesh, pixel=finer, roll=roll, **view)
        return drawn
