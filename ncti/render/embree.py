"""Visible facets by ray casting with Embree, which is a package from PyPI."""

from __future__ import annotations

from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ncti.render.solid import Solid, covered
from ncti.render.view import Lattice, View


class EmbreeEngine:
    """Embree, one ray through each pixel centre between the first and the last on the ship."""

    from_behind = True

    def __init__(self) -> None:
        # A scene lasts as long as its solid is kept.
        self._scenes: WeakKeyDictionary[Solid, EmbreeScene] = WeakKeyDictionary()
        self._lock = Lock()

    def visible(
        self, solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """Return the facet that each pixel sees, -1 for none."""
        from ncti.render.pixels import rays  # numba takes long to import

        # From the near plane, so that float32 sees distances of the size of the ship only.
        pixel, start, direction = rays(
            covered(solid, view, lattice, points),
            lattice.columns,
            lattice.origin,
            lattice.pixel,
            view.axes,
            view.curvature,
            lattice.near,
            lattice.near * view.axes[2] - solid.centre,
        )
        facet = np.full(lattice.rows * lattice.columns, -1, dtype=np.int32)
        facet[pixel] = self.cast(solid, start, direction)
        return facet

    def cast(
        self, solid: Solid, start: NDArray[np.float32], direction: NDArray[np.float32]
    ) -> NDArray[np.intp]:
        """Return the (ray,) first facets on rays that start near the solid; -1 if none."""
        with self._lock:
            facet: NDArray[np.intp] = self._scene(solid).run(start, direction)
        return facet

    def _scene(self, solid: Solid) -> EmbreeScene:
        scene = self._scenes.get(solid)
        if scene is None:
            scene = self._scenes[solid] = EmbreeScene(robust=True)
            TriangleMesh(scene, solid.vertices.astype(np.float32), solid.faces)
        return scene
