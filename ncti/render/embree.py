"""Visible facets by ray casting, with Embree: needs nothing but a package from PyPI."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ncti.render.solid import KEPT, Solid
from ncti.render.view import Lattice, View


class EmbreeEngine:
    """Embree, one ray through each pixel centre."""

    def __init__(self) -> None:
        self._scenes: OrderedDict[Solid, EmbreeScene] = OrderedDict()
        self._lock = Lock()

    def visible(
        self, solid: Solid, view: View, lattice: Lattice
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The pixels that see the ship, and the facet that each sees."""
        pixel = np.arange(lattice.rows * lattice.columns)
        h, v = lattice.centres(pixel)
        k, near = view.curvature, lattice.near
        start = np.stack([h * (1 + k * near), v * (1 + k * near), np.full_like(h, near)], axis=1)
        direction = np.stack([k * h, k * v, np.ones_like(h)], axis=1)
        start = start @ view.axes - solid.centre
        direction = direction @ view.axes
        with self._lock:
            facet = self._scene(solid).run(start.astype(np.float32), direction.astype(np.float32))
        hit = np.flatnonzero(facet >= 0)
        return pixel[hit], facet[hit].astype(np.intp)

    def _scene(self, solid: Solid) -> EmbreeScene:
        scene = self._scenes.pop(solid, None)
        if scene is None:
            scene = EmbreeScene(robust=True)
            TriangleMesh(scene, solid.vertices.astype(np.float32), solid.faces)
        self._scenes[solid] = scene
        if len(self._scenes) > KEPT:
            self._scenes.popitem(last=False)
        return scene
