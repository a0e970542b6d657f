"""Ways to get the depth image of a view: this library's engines, and what one would write instead.

All draw the same lattice of pixels. Each has a part that is done once, for a mesh, one that makes
a view ready, and one that draws it, which is what gets timed.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial

import numpy as np
import trimesh
from numpy.typing import NDArray

from ncti.render import View, range_image
from ncti.render.opengl import bind_platform
from ncti.render.view import Lattice

Draw = Callable[[], int]
"""Draws a view, and tells how many pixels of it see the ship."""

Ready = Callable[[View], Draw]
"""Makes a view ready."""

Method = Callable[[trimesh.Trimesh, float], Ready]
"""Prepares for views of a mesh with pixels of some size [m]."""


def range_images(engine: str) -> Method:
    """This library: range and slope of every pixel, in float64."""

    def prepare(mesh: trimesh.Trimesh, pixel: float) -> Ready:
        def draw(view: View) -> int:
            image = range_image(
                mesh,
                aspect=view.aspect,
                depression=view.depression,
                roll=view.roll,
                pixel=pixel,
                engine=engine,
            )
            return int(np.isfinite(image.down_range).sum())

        return lambda view: partial(draw, view)

    return prepare


def embree_directly(mesh: trimesh.Trimesh, pixel: float) -> Ready:
    """Embree through embreex, its scene kept and its rays ready: float32 distances, no slopes."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    # A copy: trimesh takes a mesh whose vertices were looked at for one that may have changed.
    vertices = np.array(mesh.vertices)
    scene = EmbreeScene()
    TriangleMesh(scene, vertices.astype(np.float32), mesh.faces.astype(np.int32))

    def ready(view: View) -> Draw:
        origins, direction = rays(view, lattice_of(vertices, view, pixel))
        starts = origins.astype(np.float32)
        directions = np.array(np.broadcast_to(direction, origins.shape), dtype=np.float32)

        def draw() -> int:
            distance = scene.run(starts, directions, query="DISTANCE")
            return int((distance < 1e30).sum())

        return draw

    return ready


def trimesh_rays(mesh: trimesh.Trimesh, pixel: float) -> Ready:
    """`trimesh.ray`, which has Embree underneath: places of first hits."""

    def draw(view: View) -> int:
        origins, direction = rays(view, lattice_of(mesh.vertices, view, pixel))
        places, _, _ = mesh.ray.intersects_location(
            origins, np.broadcast_to(direction, origins.shape), multiple_hits=False
        )
        return len(places)

    return lambda view: partial(draw, view)


def pyrender_anew(platform: str) -> Method:
    """pyrender as a newcomer writes it: a scene and a renderer for every view."""

    def prepare(mesh: trimesh.Trimesh, pixel: float) -> Ready:
        bind_platform(platform)
        os.environ.setdefault("EGL_DEVICE_ID", "0")
        import pyrender

        def draw(view: View) -> int:
            lattice = lattice_of(mesh.vertices, view, pixel)
            height, width = lattice.rows * pixel, lattice.columns * pixel
            pose = np.eye(4)
            pose[:3, :3] = (view.axes * [[1.0], [1.0], [-1.0]]).T
            pose[:3, 3] = view.axes.T @ (
                (lattice.first_column * pixel + width / 2),
                (lattice.first_row * pixel + height / 2),
                lattice.near - 1.0,
            )
            camera = pyrender.OrthographicCamera(
                width / 2, height / 2, znear=1.0, zfar=1.0 + lattice.far - lattice.near
            )
            scene = pyrender.Scene()
            scene.add(pyrender.Mesh.from_trimesh(mesh, smooth=False))
            scene.add(camera, pose=pose)
            renderer = pyrender.OffscreenRenderer(lattice.columns, lattice.rows)
            depth = renderer.render(scene, flags=pyrender.RenderFlags.DEPTH_ONLY)
            renderer.delete()
            return int((depth > 0).sum())

        return lambda view: partial(draw, view)

    return prepare


def lattice_of(vertices: NDArray[np.float64], view: View, pixel: float) -> Lattice:
    """The pixels that this library would draw."""
    return Lattice.around(view.axes @ vertices.T, view, pixel)


def rays(view: View, lattice: Lattice) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rays through pixel centres.

    Returns
    -------
    origins : (row * col, 3) float64 ndarray
        Where they start [m], in front of the ship.
    direction : (3,) float64 ndarray
        Where all of them go.
    """
    column, row, away = view.axes
    h = lattice.origin[0] + lattice.pixel * np.arange(lattice.columns)
    v = lattice.origin[1] + lattice.pixel * np.arange(lattice.rows)
    across = h[:, None] * column + (v[:, None] * row)[:, None, :]
    return (across + lattice.near * away).reshape(-1, 3), away
