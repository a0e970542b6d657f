"""Visible facets by OpenGL: pyrender's depth pass, in software, on OSMesa or EGL."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.render.engine import EngineError
from ncti.render.opengl import bind_platform
from ncti.render.solid import Solid, sampled_facets
from ncti.render.view import Lattice, View, clip_matrix

MAX_FACETS = 2**24
"""Most facets: their numbers are float32 colours, exact up to this number."""


def _open_canvas(platform: str) -> Any:
    # Imports OpenGL, which binds it to the platform of this moment.
    from ncti.render.canvas import Canvas

    return Canvas(platform)


class PyrenderEngine:
    """pyrender on one OpenGL platform, with a persistent context, renderer and scene.

    An OpenGL context belongs to one thread. The engine has its own thread for it, so any thread
    may call it; it draws one image at a time.
    """

    def __init__(self, platform: str) -> None:
        bind_platform(platform)
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"render-{platform}")
        try:
            self._canvas = self._thread.submit(_open_canvas, platform).result()
        except Exception as error:
            raise EngineError(
                f"render engine {platform} has its libraries but cannot start here ({error!r}): "
                "use embree, or another engine in another process."
            ) from error

    def visible(
        self, solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Return the facet that each pixel sees, -1 for none."""
        if len(solid.faces) > MAX_FACETS:
            raise ValueError(
                f"mesh has {len(solid.faces)} facets: OpenGL engines take at most {MAX_FACETS}."
            )
        clip = clip_matrix(view, lattice, centre=solid.centre)
        facets = sampled_facets(solid, view, lattice, points)
        drawing = self._thread.submit(self._canvas.draw, solid, facets, clip, lattice.shape)
        image: NDArray[np.float32] = drawing.result()
        return image
