"""Visible pieces along lines against closed forms, rays, and themselves."""

import multiprocessing
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, FillRule

import ncti.ships
from ncti.render import cast_rays, line_image, refined
from ncti.render.draw_lines import between
from ncti.render.view import View

ship = cache(ncti.ships.load)

LOW, HIGH = (-60.0, -7.0, -2.0), (70.0, 9.0, 12.0)


def box(low=LOW, high=HIGH):
    return trimesh.creation.box(bounds=[low, high])


def loose(mesh):
    """The same facets, none of which shares a vertex."""
    return trimesh.Trimesh(
        mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False
    )


def same(a, b):
    return np.array_equal(a.line, b.line) and np.array_equal(a.piece, b.piece)


def outline(mesh, view):
    """Area [m^2] of the union of all facets that face a far sensor, by polygon clipping."""
    corners = (np.asarray(mesh.vertices) @ view.axes.T)[np.asarray(mesh.faces)][..., :2]
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    facing = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0] > 0
    return CrossSection(list(corners[facing]), FillRule.Positive).area()


def projected_area(aspect, depression, low=LOW, high=HIGH):
    a, d = np.radians([aspect, depression])
    x, y, z = np.subtract(high, low)
    u = np.abs([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)])
    return float(u @ [y * z, x * z, x * y])


@settings(deadline=None, max_examples=40)
@given(st.floats(0, 360), st.floats(0, 90), st.floats(-180, 180))
def test_a_box_has_its_projected_area(aspect, depression, roll):
    """Each line errs by a rectangle rule on a hexagon: the error is of its second order, and no
    more than a spacing times the slope of the outline at its six corners."""
    image = line_image(box(), aspect=aspect, depression=depression, roll=roll, spacing=0.05)
    breadth = 130 + 16 + 14  # no chord of the box's outline is longer
    assert image.area.sum() == pytest.approx(projected_area(aspect, depression), abs=0.05 * breadth)


def test_the_area_of_a_box_converges_by_its_chords():
    """Away from edges along lines, the rectangle rule errs by the square of the spacing."""
    spacings = 2.0 ** -np.arange(1, 9)
    truth = projected_area(37, 3.84)
    errors = [
        max(
            abs(
                line_image(box(), aspect=37, depression=3.84, spacing=s, phase=phase).area.sum()
                - truth
            )
            for phase in np.arange(8) / 8
        )
        for s in spacings
    ]
    slope = np.polyfit(np.log(spacings), np.log(errors), 1)[0]
    assert slope > 1.8


@pytest.mark.parametrize("slant_range", [None, 300.0, 4e3, 100e3])
@pytest.mark.parametrize(("aspect", "depression"), [(0, 3.84), (37, 0.3), (123.4, 12.7), (90, 45)])
def test_pieces_lie_on_what_a_ray_meets(slant_range, aspect, depression):
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


@pytest.mark.parametrize("name", ncti.ships.names())
def test_ships_have_the_area_of_their_outline(name):
    hull = ship(name)
    rng = np.random.default_rng(len(name))
    for aspect, depression in zip(rng.uniform(0, 180, 2), rng.uniform(0.3, 12.7, 2), strict=True):
        image = line_image(hull, aspect=aspect, depression=depression)
        assert image.area.sum() == pytest.approx(outline(hull, View(aspect, depression)), rel=1e-3)


def test_pieces_of_a_line_do_not_overlap():
    image = line_image(ship("horne"), aspect=37, depression=3.84)
    follows = np.diff(image.line) == 0
    assert np.all(np.diff(image.line) >= 0)
    assert np.all(image.piece[:, 1] > image.piece[:, 0])
    assert np.all(image.piece[1:, 0][follows] >= image.piece[:-1, 1][follows])


@pytest.mark.parametrize("roll", [0.0, 31.7])
@pytest.mark.parametrize("aspect", [0, 90, 180])
def test_vertices_on_lines_change_nothing(aspect, roll):
    """Lines through the corners of boxes on a grid, and past them by a hair, see the same."""
    parts = [box((i, -3, 0.5), (i + 1, 2, 1.5 + i % 3)) for i in range(-6, 6)]
    mesh = trimesh.boolean.union(parts, engine="manifold")
    on, beside = (
        line_image(mesh, aspect=aspect, depression=0, roll=roll, spacing=1.0, phase=phase)
        for phase in (0.0, 1e-9)
    )
    # upright sides are 1 m steps: lines that run along an edge belong to what lies above it
    assert on.area.sum() == pytest.approx(beside.area.sum(), abs=1e-6)
    assert on.area.sum() > 5


def test_facets_need_not_share_vertices():
    hull = ship("connole")
    whole = line_image(hull, aspect=20, depression=3.84)
    assert same(whole, line_image(loose(hull), aspect=20, depression=3.84))


def test_facets_without_area_and_twice_change_nothing():
    """Corners that coincide, three in a line, and a third of all facets once more."""
    hull = ship("connole")
    whole = line_image(hull, aspect=20, depression=3.84)
    faces = np.asarray(hull.faces)
    edges = hull.vertices[faces[::50, :2]]
    count = len(hull.vertices)
    needles = np.column_stack([faces[::50, :2], count + np.arange(len(edges))])
    flat = faces[::70][:, [0, 1, 1]]
    more = trimesh.Trimesh(
        np.concatenate([hull.vertices, edges.mean(axis=1)]),
        np.concatenate([faces, flat, needles, faces[::3]]),
        process=False,
    )
    found = line_image(more, aspect=20, depression=3.84)
    assert found.area.sum() == pytest.approx(whole.area.sum(), rel=1e-9)
    far = dict(side=1e3, near=-125, bin_width=1.0, bin_count=250)
    difference = np.abs(found.bin(**far).area.sum(0) - whole.bin(**far).area.sum(0))
    assert difference.sum() < 1e-6 * whole.area.sum()


def deck(seam):
    """A level plate of 6 x 6 squares, with seams within it."""
    x, y = np.meshgrid(np.linspace(-50, 50, 7), np.linspace(-10, 10, 7), indexing="ij")
    corners = [*np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)]
    faces = []
    for i, j in np.ndindex(6, 6):
        a, b, c, d = 7 * i + j, 7 * i + j + 7, 7 * i + j + 8, 7 * i + j + 1
        inner = 0 < i < 5 and 0 < j < 5 and (i + j) % 2 == 0
        faces += [[a, c, d]]
        if not inner or seam in ("none", "coincident facets"):
            faces += [[a, b, c]]
        if inner and seam in ("split edges", "needles"):
            middle = len(corners)
            corners.append(corners[a] + 0.37 * (corners[c] - corners[a]))
            faces += [[a, b, middle], [middle, b, c]]
            faces += [[a, middle, c]] if seam == "needles" else []
        if inner and seam == "coincident facets":
            faces += [[a, b, d], [b, c, d]]
    return trimesh.Trimesh(corners, faces, process=False)


@pytest.mark.parametrize("seam", ["split edges", "needles", "coincident facets"])
@pytest.mark.parametrize(("depression", "aspect"), [(90, 0), (20, 37), (5, 123)])
def test_seams_within_a_surface_leave_no_gaps(seam, depression, aspect):
    view = dict(depression=depression, aspect=aspect, spacing=0.25)
    whole, found = line_image(deck("none"), **view), line_image(deck(seam), **view)
    assert whole.area.sum() == pytest.approx(2000 * np.sin(np.radians(depression)), rel=0.01)
    assert found.area.sum() == pytest.approx(whole.area.sum(), rel=1e-9)


def test_missing_facets_leave_what_lies_behind():
    """One facet in twenty is not there: what faces the sensor behind it is seen."""
    hull = ship("duncan")
    kept = np.random.default_rng(3).random(len(hull.faces)) > 0.05
    torn = trimesh.Trimesh(hull.vertices, hull.faces[kept], process=False)
    lines = line_image(torn, aspect=70, depression=5, spacing=0.125)
    assert lines.area.sum() == pytest.approx(outline(torn, View(70, 5)), rel=1e-3)


@pytest.mark.parametrize(("aspect", "depression"), [(0, 3.84), (70, 3.84), (140, 30), (20, 90)])
def test_what_is_under_water_is_what_the_sea_hides(aspect, depression, tmp_path):
    """A keel and a bulb, cut off as a ship is loaded, and left there below a sea that is drawn."""
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
    # Of what is seen, the ship is what has a height above the sea.
    axes = View(aspect, depression).axes
    middle = [
        deep.piece[:, :2].mean(axis=1),
        (deep.line + deep.phase) * deep.spacing,
        deep.piece[:, 2:].mean(axis=1),
    ]
    above = axes[:, 2] @ middle > 1e-3
    found, plain = (
        [np.bincount(line - dry.line[0], part) for part in (area, area * r)]
        for line, area, r in (
            (dry.line, dry.area, dry.piece[:, 2:].mean(axis=1)),
            (deep.line[above], deep.area[above], middle[2][above]),
        )
    )
    np.testing.assert_allclose(found, plain, atol=1e-9 * np.abs(plain).max())


@pytest.mark.parametrize("aspect", [0, 33, 90, 146])
def test_solids_that_run_through_one_another_hide_as_if_united(aspect):
    rng = np.random.default_rng(5)
    parts = []
    for _ in range(30):
        low = rng.uniform((-40, -8, 0), (30, 4, 10))
        part = box(low, low + rng.uniform(1, 20, 3))
        part.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        parts.append(part)
    united = trimesh.boolean.union(parts, engine="manifold")
    grid = dict(side=1e3, near=-125, bin_width=1.0, bin_count=250)
    apart, one = (
        line_image(mesh, aspect=aspect, depression=7, spacing=0.25).bin(**grid).area.sum(0)
        for mesh in (trimesh.util.concatenate(parts), united)
    )
    # 'manifold' rounds where parts meet to some 1e-5 m, along a kilometre of edges
    assert np.abs(apart - one).sum() < 1e-4 * one.sum()


def test_finer_lines_keep_those_done():
    hull = ship("texas")
    view = dict(aspect=61, depression=3.84, slant_range=5e3)
    fine = line_image(hull, spacing=2.0, **view)
    for spacing in (1.0, 0.5, 0.25):
        fine = refined(hull, fine)
        assert fine.spacing == spacing
        assert same(fine, line_image(hull, spacing=spacing, phase=fine.phase, **view))


@pytest.mark.parametrize("factor", [2, 3, 5, 12])
def test_lines_between_are_those_that_a_finer_view_has_more(factor):
    """No line is drawn twice; spacings divided by three are rounded."""
    hull = ship("texas")
    view = dict(aspect=61, depression=3.84, slant_range=5e3)
    coarse = line_image(hull, spacing=1.5, **view)
    new = between(hull, coarse, factor)
    whole = line_image(hull, spacing=new.spacing, phase=new.phase, **view)
    kept = factor * coarse.line + int(np.floor(factor * coarse.phase))
    assert not set(kept) & set(new.line)
    assert set(kept) | set(new.line) == set(whole.line)
    found = refined(hull, coarse, factor)
    assert found.line.tolist() == whole.line.tolist()
    np.testing.assert_allclose(found.piece, whole.piece, atol=1e-6)
    assert np.mean(found.surface != whole.surface) < 1e-3


@pytest.mark.parametrize("factor", [1, 0, -2, 1.5, None])
def test_what_does_not_divide_a_spacing_is_refused(factor):
    lines = line_image(box(), aspect=10, depression=3, spacing=2.0)
    with pytest.raises(ValueError, match="factor is"):
        refined(box(), lines, factor)


@pytest.mark.parametrize("depression", [0.0, 90.0])
def test_a_face_on_the_edge_of_two_bins_is_in_the_bin_behind(depression):
    """As in the reference, whatever rounding says."""
    mesh = trimesh.creation.box((40.0, 12.0, 8.0))
    image = line_image(mesh, aspect=0, depression=depression)
    area = image.bin(side=1e3, near=-25.0, bin_width=1.0, bin_count=50).strands.sum(0)
    assert np.flatnonzero(area).tolist() == [25 - (20 if depression == 0 else 4)]


@pytest.mark.parametrize("threads", ["2", "3", "7"])
def test_threads_change_no_bit(threads, monkeypatch):
    hull = ship("texas")
    view = dict(aspect=61, depression=3.84, spacing=0.1)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    alone = line_image(hull, **view)
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    assert same(alone, line_image(hull, **view))


@pytest.mark.parametrize("side", [0.6, 3.0, 15.0, 1e3])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.3, 0.8)])
def test_cells_share_the_area_out(side, shift):
    """Binned, no area is lost; every cell's is that of the parts of pieces within it."""
    image = line_image(ship("horne"), aspect=37, depression=3.84)
    parts = image.bin(side=side, shift=shift)
    assert parts.area.sum() == pytest.approx(image.area.sum(), rel=1e-12)
    # plainly: every piece as two hundred points
    share = (np.arange(200) + 0.5) / 200
    some = np.flatnonzero(image.line % 24 == 0)
    horizontal, vertical = (at[some] for at in image.cross_range())
    h, v = (at[:, :1] + (at[:, 1:] - at[:, :1]) * share for at in (horizontal, vertical))
    cells = np.stack([np.floor(h / side + shift[0]), np.floor(v / side + shift[1])], axis=-1)
    weights = np.repeat(image.area[some] / 200, 200)
    found, which = np.unique(cells.reshape(-1, 2), axis=0, return_inverse=True)
    plain = dict(zip(map(tuple, found), np.bincount(which.reshape(-1), weights), strict=True))
    few = line_image(ship("horne"), aspect=37, depression=3.84)
    object.__setattr__(few, "line", image.line[some])
    object.__setattr__(few, "piece", image.piece[some])
    exact = few.bin(side=side, shift=shift)
    exact = dict(zip(map(tuple, exact.cell), exact.area.sum(1), strict=True))
    # a piece ends in a cell by a point more or less
    longest = image.area[some].max() / 200
    assert all(
        abs(exact.get(cell, 0) - plain.get(cell, 0)) <= 2 * longest * len(some)
        for cell in {*exact, *plain}
    )


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from([0.2, 0.3, 0.6, 0.75, 1.0]),
    st.integers(1, 9),
    st.sampled_from([0, 90, 180, 270]),
)
def test_ends_on_the_borders_of_cells_stay_within_them(side, half, aspect):
    """Rounding must not put area into a neighbour's bins, or where no cell is."""
    mesh = box((-half * side, -half * side, 0), (half * side, half * side, half * side))
    image = line_image(mesh, aspect=aspect, depression=0, spacing=0.1)
    parts = image.bin(side=side)
    assert parts.area.sum() == pytest.approx(image.area.sum(), rel=1e-12)
    assert np.all(parts.cell >= [-half, 0])
    assert np.all(parts.cell < half)


def test_threads_survive_a_fork(monkeypatch):
    """A pool of threads is of the process that made it."""
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    hull = ship("connole")
    here = line_image(hull, aspect=61, depression=3.84, spacing=0.1)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("fork")) as others:
        there = others.submit(line_image, hull, aspect=61, depression=3.84, spacing=0.1)
        assert same(here, there.result(timeout=60))


@pytest.mark.parametrize("slant_range", [200.0, 4e3])
def test_bins_hold_the_exact_distances(slant_range):
    """A plate across the line of sight, near enough for its wavefront to bend over many bins."""
    plate = box((-1, -30, -30), (0, 30, 30))
    image = line_image(plate, aspect=0, depression=0, spacing=0.05, slant_range=slant_range)
    count, width = 400, 0.01
    area = image.bin(side=1e3, near=0.0, bin_width=width, bin_count=count).area.sum(0)
    # distance d past the plate's: a disc of radius s, s^2 = (R + d)^2 - R^2, within the square
    edges = slant_range + width * np.arange(count + 1)
    disc = np.pi * (edges**2 - slant_range**2)
    inside = edges**2 - slant_range**2 < 30**2
    expected = np.diff(disc)[inside[1:]]
    # Chords stay within 1e-4 of a bin of the arc; lines 0.05 m apart err by some (0.05 m / s)^1.5
    # of a disc of radius s.
    assert np.cumsum(area[: len(expected)]) == pytest.approx(
        disc[1:][inside[1:]], abs=disc[1] / 1e4 + 0.02, rel=3e-3
    )
    assert area.sum() == pytest.approx(3600, rel=1e-3)


@pytest.mark.parametrize(("slant_range", "depression"), [(500.0, 1.0), (4e3, 0.3), (1e5, 0.3)])
def test_perspective_spreads_a_deck_over_its_ranges(slant_range, depression):
    """A narrow level strip along the line of sight, in closed form.

    At depth R0 - x cos d a patch dx dy of a plane that lies H = R0 sin d below the sensor covers
    R0^2 H dx dy / depth^3 of the view; summed up to x, (R0^2 H / 2 cos d) / depth^2.
    """
    width, half = 0.5, 50.0
    strip = trimesh.Trimesh(
        [(-half, -width, 0), (half, -width, 0), (half, width, 0), (-half, width, 0)],
        [(0, 1, 2), (0, 2, 3)],
        process=False,
    )
    d = np.radians(depression)
    height = slant_range * np.sin(d)
    image = line_image(
        strip, aspect=0, depression=depression, spacing=2e-4, slant_range=slant_range, roll=90.0
    )
    count, bin_width = 440, 0.25
    bins = dict(near=-55, bin_width=bin_width, bin_count=count)
    area = image.bin(side=1e3, shift=(0.5, 0.5), **bins).area
    edges = -55 + bin_width * np.arange(1, count + 1)
    # x where the distance to the sensor, on the middle of the strip, is R0 + r
    ground = np.sqrt(np.maximum((slant_range + edges) ** 2 - height**2, 0.0))
    x = np.clip(slant_range * np.cos(d) - ground, -half, half)
    below = 1 / (slant_range - x * np.cos(d)) ** 2
    nearest = 1 / (slant_range - half * np.cos(d)) ** 2
    exact = slant_range**2 * height * 2 * width / (2 * np.cos(d)) * (nearest - below)
    found = np.cumsum(area.sum(0))
    # Chords leave 1e-4 of a bin; lines and the strip's own width little more.
    per_bin = np.diff(exact, prepend=0.0).max()
    assert np.abs(found - exact).max() < per_bin / 1e4 + 2e-3 * exact[-1]


@pytest.mark.parametrize(
    ("argument", "value", "allowed"),
    [
        ("spacing", 0.0, "spacing"),
        ("spacing", 1e-9, "at most 1048576 are allowed"),
        ("spacing", float("nan"), "spacing"),
        ("depression", 91.0, "depression"),
        ("aspect", 1e3, "aspect"),
        ("slant_range", 50.0, "beyond"),
        ("slant_range", -1.0, "slant_range"),
        ("phase", 1e10, "phase"),
    ],
)
def test_nonsense_is_refused(argument, value, allowed):
    given = dict(aspect=0.0, depression=3.0) | {argument: value}
    with pytest.raises(ValueError, match=allowed):
        line_image(box(), **given)


def test_data_set_has_units():
    image = line_image(box(), aspect=30, depression=3, spacing=1.0)
    found = image.to_xarray()
    assert float(found.area.sum()) == pytest.approx(image.area.sum())
    assert all(found[name].attrs["units"] for name in found.variables if name != "piece")
    inner = np.diff(found.horizontal, axis=1)[:, 0]
    assert np.hypot(inner, np.diff(found.vertical, axis=1)[:, 0]) == pytest.approx(
        image.piece[:, 1] - image.piece[:, 0]
    )


def test_machine_code_is_kept_outside_the_package(tmp_path):
    """In the cache folder, and nowhere if that cannot be written."""
    script = (
        "from ncti.compiled import compiled\n"
        "@compiled\n"
        "def double(x):\n"
        "    return 2 * x\n"
        "assert double(21) == 42\n"
    )
    (tmp_path / "module.py").write_text(script)
    root = Path(__file__).resolve().parents[2]
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": f"{tmp_path}:{root}", "PYTHONDONTWRITEBYTECODE": "1"}
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)  # where others could put code of theirs
    cases = [
        ("XDG_CACHE_HOME", tmp_path / "a", True),
        ("XDG_CACHE_HOME", Path("/dev/null/a"), False),
    ]
    cases += [("NUMBA_CACHE_DIR", tmp_path / "b", True), ("NUMBA_CACHE_DIR", shared, False)]
    cases += [("NUMBA_CACHE_DIR", Path("/dev/null/b"), False)]
    for variable, folder, kept in cases:
        subprocess.run(
            [sys.executable, "-c", "import module"],
            env=environment | {"XDG_CACHE_HOME": "/dev/null/a", variable: str(folder)},
            check=True,
        )
        assert any(folder.glob("**/*.nbi")) == kept
    assert not list(tmp_path.glob("__pycache__"))


@pytest.mark.parametrize("aspect", [0.0, 30.0, 90.0])
def test_bounds_are_those_of_all_ends(aspect):
    lines = line_image(box(), aspect=aspect, depression=3.84)
    for bound, ends in zip(lines.bounds, lines.cross_range(), strict=True):
        np.testing.assert_array_equal(bound, [ends.min(), ends.max()])
    nothing = replace(lines, line=lines.line[:0], piece=lines.piece[:0], surface=lines.surface[:0])
    assert [bound.size for bound in nothing.bounds] == [0, 0]
