"""Facets that are hard: without area, coincident, slivers, needles, millions."""

import numpy as np
import pytest
from hard_meshes import (
    ENGINES,
    HIGH,
    LOW,
    area,
    box,
    flat_subdivided,
    mesh,
    outline,
    sampling_error,
    see,
    with_coincident_facets,
    with_facets_without_area,
    with_needle,
    with_slivers,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti.ladar import range_extent
from ncti.render import cast_rays

VIEWS = (
    {"aspect": 37.0, "depression": 3.84},
    {"aspect": 0.0, "depression": 0.0, "slant_range": 1e3},
    {"aspect": 90.0, "depression": 90.0},
)
HARD = {
    "without area": with_facets_without_area,
    "coincident": with_coincident_facets,
    "turned": lambda: with_coincident_facets(turned=True),
    **{f"slivers {e:g}": lambda e=e: with_slivers(e) for e in (1e-3, 1e-6, 1e-9, 1e-15, 1e-300)},
    "needle 1e-9": lambda: with_needle(1e-9),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", HARD)
def test_hard_facets_change_nothing(engine, name):
    """The box shows as it does without them.

    Lines see the same surfaces, but for the 1e-9 m within which crossings may change places on a
    line of 200 m; a wavefront that bends them is cut into chords, wherever a surface begins, that
    are within 1/50 of a bin. A pixel or a ray may find a sliver in place of its neighbour, whose
    plane may be wrong by all that its width leaves of its normal: only where its centre is within
    1/256 pixel of an edge, of 30 edges of at most 200 m.
    """
    for view in VIEWS:
        far = view.get("slant_range", 1e12)
        plain, hard = (
            range_extent(see(engine, some, **view), slant_range=far, ifov=15.0 / far)
            for some in (box(), HARD[name]())
        )
        whole = plain.fraction.sum()
        allowed = 2 * 1e-9 * 200 * 200 / 0.5 / 15.0**2 + (2 / 50 * whole if far < 1e12 else 0.0)
        if engine != "lines":
            allowed = min(2 * 30 * 200.0 * 0.5 / 256 / 15.0**2, 0.1 * whole)
        difference = np.abs(plain.fraction.sum(axis=0) - hard.fraction.sum(axis=0)).sum()
        assert difference <= allowed


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("width", [1.0, 1e-1, 1e-3])
def test_a_needle_adds_its_own_area(engine, width):
    view = {"aspect": 37.0, "depression": 3.84}
    exact, perimeter, _ = outline(box().vertices, **view)
    u = np.array([np.cos(np.radians(37.0)), np.sin(np.radians(37.0))])
    exact += 28 * width * u.sum() * np.cos(np.radians(3.84))
    found = area(see(engine, with_needle(width), **view))
    assert found == pytest.approx(exact, abs=sampling_error(perimeter + 2 * 28 + 4 * width, 0.5))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "vertices", [np.zeros((3, 3)), [[0, 0, 0], [1, 0, 0], [2, 0, 0]]], ids=["point", "line"]
)
def test_a_mesh_without_area_is_refused(engine, vertices):
    with pytest.raises(ValueError, match="mesh has no facets with an area: at least one"):
        see(engine, mesh(vertices, [[0, 1, 2]]), aspect=37.0, depression=3.84)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_vertex_that_is_not_finite_is_refused(engine, value):
    vertices = np.array(box().vertices)
    vertices[3, 1] = value
    with pytest.raises(ValueError, match="mesh has vertices that are not finite"):
        see(engine, mesh(vertices, box().faces), aspect=37.0, depression=3.84)


def test_a_ray_meets_coincident_facets_of_either_winding_at_their_plane():
    """The deck is 12 m up: both facets there have that plane."""
    solid = with_coincident_facets(turned=True)
    rng = np.random.default_rng(1)
    origin = np.append(rng.uniform(LOW[:2], HIGH[:2], (500, 2)), np.full((500, 1), 1e4), axis=1)
    hits = cast_rays(solid, origin, np.tile([0.0, 0.0, -1.0], (500, 1)))
    assert len(hits.ray) == 500
    np.testing.assert_allclose(hits.distance, 1e4 - 12.0, rtol=1e-12)
    np.testing.assert_allclose(hits.cosine, 1.0, rtol=1e-12)


@pytest.mark.parametrize("count", [409], ids=["2,007,372 facets"])
def test_millions_of_flat_facets(count):
    """Flat facets are the box again; lines cross no edges but its own."""
    view = {"aspect": 37.0, "depression": 3.84}
    solid = flat_subdivided(count)
    assert len(solid.faces) == 12 * count**2
    exact, perimeter, _ = outline(box().vertices, **view)
    for engine in ENGINES:
        image = see(engine, solid, **view)
        assert area(image) == pytest.approx(exact, abs=sampling_error(perimeter, 0.5))
        if engine == "lines":
            assert len(image.piece) == len(see(engine, box(), **view).piece)


@settings(max_examples=25)
@given(
    engine=st.sampled_from([name for name in ENGINES if name != "osmesa"]),
    seed=st.integers(0, 2**32 - 1),
    share=st.floats(0.0, 1.0),
    aspect=st.floats(0.0, 360.0),
    depression=st.floats(0.0, 90.0),
)
def test_facets_in_any_order_some_of_them_twice_and_in_pieces(
    engine, seed, share, aspect, depression
):
    rng = np.random.default_rng(seed)
    corners = np.asarray(with_slivers(share).triangles)
    corners = corners[rng.permutation(np.append(np.arange(36), rng.integers(36, size=9)))]
    solid = mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    exact, perimeter, _ = outline(box().vertices, aspect=aspect, depression=depression)
    found = area(see(engine, solid, aspect=aspect, depression=depression))
    assert found == pytest.approx(exact, abs=sampling_error(perimeter, 0.5))
