"""Ways to get the ranges of a view: this library's engines, and code without it.

All but lines draw the same lattice of pixels. Each has a part that runs once for a mesh, and a
timed part that runs for every view. All compute on one thread.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import trimesh
from numpy.typing import NDArray

from ncti.render import LineImage, line_image, range_image
from ncti.render.opengl import bind_platform
from ncti.render.view import Lattice, View

Seen = NDArray[np.floating] | LineImage
"""Down-range of every pixel that sees the ship, (hit,) [m], or an image by lines."""

Draw = Callable[[View], Seen]
"""Draws a view."""

Method = Callable[[trimesh.Trimesh, float], Draw]
"""Prepares for views of a mesh with pixels of some size [m]."""


def range_images(engine: str) -> Method:
    """This library: range and slope of every pixel, in float64."""

    def prepare(mesh: trimesh.Trimesh, pixel: float) -> Draw:
        def draw(view: View) -> Seen:
            image = range_image(
                mesh,
                aspect=view.aspect,
                depression=view.depression,
                roll=view.roll,
                pixel=pixel,
                engine=engine,
            )
            return image.down_range[image.hit]

        return draw

    return prepare


def lines(mesh: trimesh.Trimesh, pixel: float) -> Draw:
    """This library: visible pieces along lines a pixel apart."""
    return lambda view: line_image(
        mesh, aspect=view.aspect, depression=view.depression, roll=view.roll, spacing=pixel
    )


def direct_embree(mesh: trimesh.Trimesh, pixel: float) -> Draw:
    """Embree through embreex, its scene kept: float32 distances, no slopes."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    vertices, scene = vertices_of(mesh), EmbreeScene()
    TriangleMesh(scene, mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32))

    def draw(view: View) -> Seen:
        lattice = lattice_of(vertices, view, pixel)
        origins, direction = rays(view, lattice)
        directions = np.broadcast_to(direction.astype(np.float32), origins.shape)
        distance = scene.run(
            origins.astype(np.float32), np.ascontiguousarray(directions), query="DISTANCE"
        )
        return lattice.near + distance[distance < 1e30]

    return draw


def open3d_rays(mesh: trimesh.Trimesh, pixel: float) -> Draw:
    """Open3D's `RaycastingScene`, its scene kept: float32 distances."""
    import open3d

    vertices = vertices_of(mesh)
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))

    def draw(view: View) -> Seen:
        lattice = lattice_of(vertices, view, pixel)
        origins, direction = rays(view, lattice)
        stacked = np.empty((len(origins), 6), dtype=np.float32)
        stacked[:, :3], stacked[:, 3:] = origins, direction
        hits = scene.cast_rays(open3d.core.Tensor.from_numpy(stacked), nthreads=1)
        distance = hits["t_hit"].numpy()
        return lattice.near + distance[np.isfinite(distance)]

    return draw


def mitsuba_rays(mesh: trimesh.Trimesh, pixel: float) -> Draw:
    """Mitsuba 3 by its `llvm` variant, its scene kept: float32 distances."""
    import drjit
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    drjit.set_thread_count(1)
    vertices = vertices_of(mesh)
    ship = mitsuba.Mesh("ship", len(mesh.vertices), len(mesh.faces))
    parameters = mitsuba.traverse(ship)
    parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    scene = mitsuba.load_dict({"type": "scene", "ship": ship})

    def draw(view: View) -> Seen:
        lattice = lattice_of(vertices, view, pixel)
        origins, direction = rays(view, lattice)
        ray = mitsuba.Ray3f(
            mitsuba.Point3f(*origins.T.astype(np.float32)),
            mitsuba.Vector3f(*direction.tolist()),
        )
        distance = scene.ray_intersect_preliminary(ray, coherent=True).t.numpy()
        return lattice.near + distance[np.isfinite(distance)]

    return draw


def trimesh_rays(mesh: trimesh.Trimesh, pixel: float) -> Draw:
    """`trimesh.ray`, which uses Embree: points of first hits."""
    vertices = vertices_of(mesh)

    def draw(view: View) -> Seen:
        origins, direction = rays(view, lattice_of(vertices, view, pixel))
        points, _, _ = mesh.ray.intersects_location(
            origins, np.broadcast_to(direction, origins.shape), multiple_hits=False
        )
        return np.asarray(points) @ direction

    return draw


def new_pyrender(platform: str) -> Method:
    """pyrender as a newcomer writes it: a scene and a renderer for every view."""

    def prepare(mesh: trimesh.Trimesh, pixel: float) -> Draw:
        bind_platform(platform)
        os.environ.setdefault("EGL_DEVICE_ID", "0")
        import pyrender

        vertices = vertices_of(mesh)

        def draw(view: View) -> Seen:
            lattice = lattice_of(vertices, view, pixel)
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
            return lattice.near - 1.0 + depth[depth > 0]

        return draw

    return prepare


def vertices_of(mesh: trimesh.Trimesh) -> NDArray[np.float64]:
    """Return a copy of the vertices of a ship, (vertex, 3) [m].

    A view into the mesh's array would make trimesh hash the array again whenever this library
    checks the mesh for changes, which added 0.4 ms to lines.
    """
    return np.array(mesh.vertices)


def lattice_of(vertices: NDArray[np.float64], view: View, pixel: float) -> Lattice:
    """Return the pixels that this library would draw."""
    return Lattice.around(view.axes @ vertices.T, view, pixel)


def rays(view: View, lattice: Lattice) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the rays through pixel centres.

    Returns
    -------
    origins : (row * col, 3) float64 ndarray
        Their start [m], in front of the ship.
    direction : (3,) float64 ndarray
        Their common direction.
    """
    column, row, away = view.axes
    h = lattice.origin[0] + lattice.pixel * np.arange(lattice.columns)
    v = lattice.origin[1] + lattice.pixel * np.arange(lattice.rows)
    across = h[:, None] * column + (v[:, None] * row)[:, None, :]
    return (across + lattice.near * away).reshape(-1, 3), away
