"""Meshes as people have them: each kind of fault is mended to the ship that was meant, or named."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold
from shipyard import sentence, solid_of

from ncti import ships
from ncti.ships import bodies
from ncti.ships.surfaces import surface_of

DRAUGHT = 4.5


def block(low, high) -> trimesh.Trimesh:
    box = trimesh.creation.box(np.subtract(high, low))
    box.apply_translation(np.add(low, high) / 2)
    return box


def mesh_of(solid: Manifold) -> trimesh.Trimesh:
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def together(*meshes: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate([mesh.copy() for mesh in meshes])


def inverted(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh = mesh.copy()
    mesh.invert()
    return mesh


def opened(mesh: trimesh.Trimesh, share: float, at: tuple[float, float, float]) -> trimesh.Trimesh:
    """The mesh without its facets nearest to a point, of a share of its surface at most."""
    order = np.argsort(np.linalg.norm(mesh.triangles_center - at, axis=1))
    gone = order[np.cumsum(mesh.area_faces[order]) <= share * mesh.area]
    mesh = mesh.copy()
    mesh.update_faces(np.isin(np.arange(len(mesh.faces)), gone, invert=True))
    return mesh


def loose(mesh: trimesh.Trimesh, distance: float) -> trimesh.Trimesh:
    """The mesh with corners of its own for each facet, up to a distance from where they were."""
    rng = np.random.default_rng(3)
    corners = np.array(mesh.triangles)
    step = rng.normal(size=corners.shape)
    step *= distance * rng.random((len(corners), 3, 1)) / np.linalg.norm(step, axis=2)[..., None]
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    return trimesh.Trimesh((corners + step).reshape(-1, 3), faces, process=False)


def in_compartments(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh cut by bulkheads and a deck into bodies that share these."""
    parts = [solid_of(mesh)]
    for normal, offset in (((1, 0, 0), -20), ((1, 0, 0), 15), ((0, 0, 1), 3)):
        halves = [part.split_by_plane(normal, offset) for part in parts]
        parts = [part for both in halves for part in both if part.num_tri()]
    return together(*map(mesh_of, parts))


def wound_at_random(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    faces = np.array(mesh.faces)
    some = np.random.default_rng(4).random(len(faces)) < 0.2
    faces[some] = faces[some, ::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def without_bottom(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    mesh = mesh.copy()
    mesh.update_faces(mesh.triangles[:, :, 2].max(axis=1) > 1e-6)
    return mesh


def with_cavity(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return together(mesh, inverted(block((-5, -1, 1), (5, 1, 2))))


def with_neighbour(mesh: trimesh.Trimesh, *, turned: bool = False) -> trimesh.Trimesh:
    """The mesh beside a body, far ahead, which touches another along an edge."""
    bow = mesh.bounds[1, 0]
    ahead = block((bow + 2, 0, 0), (bow + 4, 2, 3))
    touching = block((bow + 4, 2, 0), (bow + 6, 4, 3))
    return together(mesh, ahead, inverted(touching) if turned else touching)


KINDS: dict[str, tuple[Callable[[trimesh.Trimesh], trimesh.Trimesh], str]] = {
    # what becomes of a ship, and a part of the sentence on it
    "as it is": (lambda mesh: mesh, ""),
    "inside out": (inverted, "1 of 1 body inside out"),
    "wound at random": (wound_at_random, "wound the other way"),
    "a body inside out": (lambda mesh: with_neighbour(mesh, turned=True), "1 of 3 bodies inside"),
    "bodies that share an edge": (with_neighbour, ""),
    "bodies that share faces": (in_compartments, ""),
    "bodies given twice": (lambda mesh: together(mesh, mesh), "1 body given twice"),
    "given twice, once inside out": (lambda mesh: together(mesh, inverted(mesh)), "given twice"),
    "a cavity": (with_cavity, ""),
    "a cavity, all inside out": (lambda mesh: inverted(with_cavity(mesh)), "2 of 2 bodies"),
    "loose vertices": (lambda mesh: loose(mesh, 4e-6 * np.ptp(mesh.vertices)), "vertices less"),
    "an opening of 1 %": (lambda mesh: opened(mesh, 0.01, (30, 6, 5)), "opening"),
    "an opening of 4 %": (lambda mesh: opened(mesh, 0.04, (0, 0, 20)), "opening"),
    "no bottom": (without_bottom, "opening"),
    "loose and open": (
        lambda mesh: loose(opened(mesh, 0.02, (-30, -6, 5)), 4e-6 * np.ptp(mesh.vertices)),
        "opening",
    ),
}
