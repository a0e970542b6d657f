"""Visible facets by ray casting, with Embree: needs nothing but a package from PyPI."""

from __future__ import annotations

from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ncti.render.solid import Solid
from ncti.render.view import Lattice, View


class EmbreeEngine:
    """Embree, one ray through each pixel centre."""

    from_behind = True

    def __init__(self) -> None:
        # A scene lasts as long as its solid is kept.
        self._scenes: WeakKeyDictionary[Solid, EmbreeScene] = WeakKeyDictionary()
        self._lock = Lock()

    def visible(
        self, solid: Solid, view: View, lattice: Lattice
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The pixels that see the ship, and the facet that each sees."""
        column, row, away = view.axes
        k = view.curvature
        h = lattice.origin[0] + lattice.pixel * np.arange(lattice.columns)
        v = lattice.origin[1] + lattice.pixel * np.arange(lattice.rows)
        across = h[:, None] * column + (v[:, None] * row)[:, None, :]
        # From the near plane, so that float32 sees distances of the size of the ship only.
        start = (1.0 + k * lattice.near) * across + (lattice.near * away - solid.centre)
        direction = k * across + away if k > 0.0 else away
        facet = self.cast(
            solid,
            start.astype(np.float32).reshape(-1, 3),
            direction.astype(np.float32).reshape(-1, 3),
        )
        pixel = np.flatnonzero(facet >= 0)
        return pixel, facet[pixel].astype(np.intp)

    def cast(
        self, solid: Solid, start: NDArray[np.float32], direction: NDArray[np.float32]
    ) -> NDArray[np.intp]:
        """(ray,): first facet on each ray from near the solid, about its centre; -1 if none."""
        with self._lock:
            facet: NDArray[np.intp] = self._scene(solid).run(start, direction)
        return facet

    def _scene(self, solid: Solid) -> EmbreeScene:
        scene = self._scenes.get(solid)
        if scene is None:
            scene = self._scenes[solid] = EmbreeScene(robust=True)
            TriangleMesh(scene, solid.vertices.astype(np.float32), solid.faces)
        return scene
