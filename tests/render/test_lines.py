"""Visible pieces along lines agree with closed forms, cast rays, and finer lines."""

from functools import cache

import numpy as np
import pytest
import trimesh

import ncti.ships
from ncti.render import cast_rays, line_image, refined
from ncti.render.view import View

ship = cache(ncti.ships.load)


def box(low, high):
    return trimesh.creation.box(bounds=[low, high])


@pytest.mark.parametrize("slant_range", [None, 300.0, 4e3, 100e3])
@pytest.mark.parametrize(("aspect", "depression"), [(0, 3.84), (37, 0.3), (123.4, 12.7), (90, 45)])
def test_pieces_lie_on_surfaces_hit_by_rays(slant_range, aspect, depression):
    """A ray from the sensor through the middle of a piece meets the ship where the piece is."""
    hull = ship("spruance")
    image = line_image(
        hull, aspect=aspect, depression=depression, spacing=2.0, slant_range=slant_range
    )
    view = View(aspect, depression, slant_range=slant_range)
    long = np.flatnonzero(image.area > 0.01 * image.spacing)
    x = image.piece[long, :2].mean(axis=1)
    y = (image.line[long] + image.phase) * image.spacing
    column, row, away = view.axes
    target = x[:, None] * column + y[:, None] * row
    if slant_range is None:
        far = 1e4
        start, direction = target - far * away, np.broadcast_to(away, target.shape)
    else:
        far = slant_range
        start = np.broadcast_to(-far * away, target.shape)
        direction = target - start
        direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    hits = cast_rays(hull, np.ascontiguousarray(start), np.ascontiguousarray(direction))
    # In float32 a ray slips past an edge by some 1e-5 m: 5 mm pieces may lose a few of theirs.
    assert len(hits.ray) > 0.999 * len(long)
    q = image.piece[long, 2:].mean(axis=1)
    w = 1 / (1 - image.curvature * q)
    expected = np.hypot(1, np.hypot(x, y) * image.curvature) * q * w
    if slant_range is not None:  # distance to the sensor
        expected = slant_range * w * np.sqrt(1 + (x**2 + y**2) / slant_range**2) - slant_range
    wrong = np.abs(hits.distance - far - expected[hits.ray]) > 1e-3
    assert wrong.mean() < 2e-3


@pytest.mark.parametrize(("aspect", "depression"), [(0, 3.84), (70, 3.84), (140, 30), (20, 90)])
def test_waterline_clipping_equals_occlusion_by_the_sea(aspect, depression, tmp_path):
    """Cutting off keel and bulb at loading gives the same view as drawing the sea above them."""
    parts = [
        box((-50, -6, -5), (50, 6, 6)),
        box((45, -3, -7), (60, 3, -1)),
        box((0, -2, 6), (9, 4, 15)),
    ]
    united = trimesh.boolean.union(parts, engine="manifold")
    united.export(tmp_path / "barge.stl")
    view = {"aspect": aspect, "depression": depression, "spacing": 0.25}
    dry = line_image(ncti.ships.load(tmp_path / "barge.stl"), **view)
    sea = box((-1e3, -1e3, -20), (1e3, 1e3, 0))
    deep = line_image(trimesh.util.concatenate([united, sea]), **view)
    # Visible pieces above the sea belong to the ship.
    axes = View(aspect, depression).axes
    middle = [
        deep.piece[:, :2].mean(axis=1),
        (deep.line + deep.phase) * deep.spacing,
        deep.piece[:, 2:].mean(axis=1),
    ]
    above = axes[:, 2] @ middle > 1e-3
    dry_sums, sea_sums = (
        [np.bincount(line - dry.line[0], weights) for weights in (area, area * r)]
        for line, area, r in (
            (dry.line, dry.area, dry.piece[:, 2:].mean(axis=1)),
            (deep.line[above], deep.area[above], middle[2][above]),
        )
    )
    np.testing.assert_allclose(dry_sums, sea_sums, atol=1e-9 * np.abs(sea_sums).max())


@pytest.mark.parametrize("aspect", [0, 33, 90, 146])
def test_intersecting_solids_render_like_their_union(aspect):
    rng = np.random.default_rng(5)
    parts = []
    for _ in range(30):
        low = rng.uniform((-40, -8, 0), (30, 4, 10))
        part = box(low, low + rng.uniform(1, 20, 3))
        part.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        parts.append(part)
    united = trimesh.boolean.union(parts, engine="manifold")
    grid = dict(side=1e3, near=-125, bin_width=1.0, bin_count=250)
    separate, joined = (
        line_image(mesh, aspect=aspect, depression=7, spacing=0.25).bin(**grid).area.sum(0)
        for mesh in (trimesh.util.concatenate(parts), united)
    )
    # 'manifold' rounds where parts meet to some 1e-5 m, along a kilometre of edges
    assert np.abs(separate - joined).sum() < 1e-4 * joined.sum()


@pytest.mark.parametrize("factor", [2, 3, 5, 12])
def test_refined_lines_equal_those_of_a_finer_view(factor):
    """Halved spacings agree bit for bit, also repeatedly; other factors within rounding."""
    hull = ship("texas")
    view = dict(aspect=61, depression=3.84, slant_range=5e3)
    coarse = line_image(hull, spacing=1.5, **view)
    lines = refined(hull, coarse, factor)
    fine = line_image(hull, spacing=lines.spacing, phase=lines.phase, **view)
    assert lines.line.tolist() == fine.line.tolist()
    np.testing.assert_allclose(lines.piece, fine.piece, atol=1e-6)
    assert np.mean(lines.surface != fine.surface) < 1e-3
    old = np.isin(lines.line, factor * coarse.line + int(np.floor(factor * coarse.phase)))
    np.testing.assert_array_equal(lines.piece[old], coarse.piece)
    if factor == 2:
        for again in (lines, refined(hull, lines)):
            fine = line_image(hull, spacing=again.spacing, phase=again.phase, **view)
            assert np.array_equal(again.line, fine.line) and np.array_equal(again.piece, fine.piece)


@pytest.mark.parametrize("roll", [0.0, 31.72, -200.0])
def test_bounds_equal_extremes_of_piece_ends(roll):
    image = line_image(ship("texas"), aspect=20, depression=12, spacing=1.0, roll=roll)
    for bounds, ends in zip(image.bounds, image.cross_range(), strict=True):
        assert bounds.tolist() == [ends.min(), ends.max()]


@pytest.mark.parametrize("depression", [0.0, 90.0])
def test_face_on_bin_edge_is_in_the_farther_bin(depression):
    """Rounding does not decide the bin; the reference uses the same one."""
    mesh = trimesh.creation.box((40.0, 12.0, 8.0))
    image = line_image(mesh, aspect=0, depression=depression)
    area = image.bin(side=1e3, near=-25.0, bin_width=1.0, bin_count=50).strands.sum(0)
    assert np.flatnonzero(area).tolist() == [25 - (20 if depression == 0 else 4)]


@pytest.mark.parametrize("side", [0.6, 3.0, 15.0, 1e3])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, 0.8)])
def test_binning_conserves_area_per_cell(side, shift):
    """Binning loses no area; each cell has the area of the parts of pieces within it."""
    image = line_image(ship("horne"), aspect=37, depression=3.84)
    parts = image.bin(side=side, shift=shift)
    assert parts.area.sum() == pytest.approx(image.area.sum(), rel=1e-12)
    # the plain computation, with two hundred points per piece
    share = (np.arange(200) + 0.5) / 200
    chosen = np.flatnonzero(image.line % 24 == 0)
    horizontal, vertical = (ends[chosen] for ends in image.cross_range())
    h, v = (ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share for ends in (horizontal, vertical))
    cells = np.stack([np.floor(h / side + shift[0]), np.floor(v / side + shift[1])], axis=-1)
    weights = np.repeat(image.area[chosen] / 200, 200)
    occupied, which = np.unique(cells.reshape(-1, 2), axis=0, return_inverse=True)
    plain = dict(zip(map(tuple, occupied), np.bincount(which.reshape(-1), weights), strict=True))
    few = line_image(ship("horne"), aspect=37, depression=3.84)
    object.__setattr__(few, "line", image.line[chosen])
    object.__setattr__(few, "piece", image.piece[chosen])
    exact = few.bin(side=side, shift=shift)
    exact = dict(zip(map(tuple, exact.cell), exact.area.sum(1), strict=True))
    # a piece ends in a cell by a point more or less
    longest = image.area[chosen].max() / 200
    assert all(
        abs(exact.get(cell, 0) - plain.get(cell, 0)) <= 2 * longest * len(chosen)
        for cell in {*exact, *plain}
    )


@pytest.mark.parametrize(("aspect", "depression"), [(0.0, 0.0), (181.07, 0.0), (37.0, 0.5)])
@pytest.mark.parametrize("slant_range", [400.0, 31e3])
@pytest.mark.parametrize("drawn_there", [True, False])
def test_pieces_are_split_exactly_at_bin_edges(slant_range, drawn_there, aspect, depression):
    """No area is in a wrong bin, for any curvature of the wavefront within a bin.

    Distance is convex along a straight line: the part of a piece nearer than a bin edge is one
    interval, whose ends bisection finds on either side of the nearest place.
    """
    image = line_image(
        ship("duncan"),
        aspect=aspect,
        depression=depression,
        spacing=2.7,
        slant_range=slant_range if drawn_there else None,
    )
    y, slope = image.line + image.phase, np.diff(image.piece)[:, 2] / np.diff(image.piece)[:, 0]
    begin, end, q = image.piece.T[:3]

    def away(x):
        depth = q + slope * (x - begin)
        w = slant_range / (slant_range - depth) if drawn_there else 1.0
        square = (x * w) ** 2 + (y * image.spacing * w) ** 2
        return np.sqrt(square + (slant_range + depth * w) ** 2) - slant_range

    low, high = begin, end
    for _ in range(90):
        first, second = low + (high - low) / 3, high - (high - low) / 3
        falls = away(first) > away(second)
        low, high = np.where(falls, first, low), np.where(falls, high, second)
    nearest, width = low, 0.25
    bins = {"near": -100, "bin_width": width, "bin_count": 800}
    area = image.bin(side=7.0, slant_range=slant_range, **bins).area.sum(0)
    cumulative = np.cumsum(area)
    for edge in (*range(10, 800, 130), np.flatnonzero(area)[0] + 1):
        inside = np.zeros(len(q))
        for side in (begin, end):
            near, far = nearest, side
            for _ in range(60):
                middle = (near + far) / 2
                closer = away(middle) < -100 + width * edge
                near, far = np.where(closer, middle, near), np.where(closer, far, middle)
            inside += np.abs(far - nearest)
        assert cumulative[edge - 1] == pytest.approx(
            inside.sum() * image.spacing, abs=1e-8 * cumulative[-1]
        )
