"""Primitives against closed forms: volume, extent, and which way they point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shipyard import packaged_sheet

from ncti.ships import fittings, solids
from ncti.ships.lofting import loft, tube

SIZE = st.floats(0.1, 20)


def bounds(solid) -> np.ndarray:
    return np.reshape(solid.bounding_box(), (2, 3))


def polygon_share(sides: int) -> float:
    """Area of a regular polygon over that of its circumscribed circle."""
    return sides / (2 * np.pi) * np.sin(2 * np.pi / sides)


@settings(deadline=None)
@given(length=SIZE, width=SIZE, height=SIZE, top_length=SIZE, top_width=SIZE)
def test_frustum_has_the_volume_of_a_prismatoid(
    length, width, height, top_length, top_width
) -> None:
    """Simpson's rule is exact for an area quadratic in height."""
    solid = solids.box(
        length=length, width=width, height=height, top_length=top_length, top_width=top_width
    )
    middle = (length + top_length) * (width + top_width) / 4
    volume = height / 6 * (length * width + 4 * middle + top_length * top_width)
    # The sides of such a frustum are ruled surfaces, which two triangles each cut or fill.
    assert solid.volume() == pytest.approx(volume, rel=0.2)
    if top_length == length:
        assert solid.volume() == pytest.approx(volume)


def test_sunk_box_keeps_its_size_at_the_base() -> None:
    solid = solids.box(length=4, width=2, height=3, sink=0.5)
    np.testing.assert_allclose(bounds(solid), [[-2, -1, -0.5], [2, 1, 3]])
    assert solid.volume() == pytest.approx(4 * 2 * 3.5)


def test_yaw_swings_the_starboard_end_aft() -> None:
    """In the sense of an azimuth: a wing set across the ship with its starboard end swept aft."""
    wing = solids.box(length=0.2, width=5.0, height=1.0, yaw=25)
    starboard = wing ^ solids.box(length=50, width=1, height=1).translate((0, 2, 0))
    assert bounds(starboard).mean(axis=0)[0] > 0.5


def test_cylinder_and_cone() -> None:
    share = polygon_share(32)
    assert solids.cylinder(radius=2, height=3).volume() == pytest.approx(12 * np.pi * share)
    cone = solids.cylinder(radius=2, height=3, top_radius=1)
    assert cone.volume() == pytest.approx(np.pi * 3 / 3 * (4 + 2 + 1) * share)


def test_sphere_and_ellipsoid_fill_their_volume_to_one_percent() -> None:
    assert solids.sphere(radius=1.5).volume() == pytest.approx(4 / 3 * np.pi * 1.5**3, rel=0.011)
    egg = solids.ellipsoid(length_radius=1, width_radius=2, height_radius=3)
    assert egg.volume() == pytest.approx(4 / 3 * np.pi * 6, rel=0.011)
    np.testing.assert_allclose(bounds(egg)[1], [1, 2, 3])


def test_barrel_points_ahead_and_up() -> None:
    barrel = solids.barrel(length=10, radius=0.1, elevation=30)
    tip = bounds(barrel)[1]
    assert tip[0] == pytest.approx(10 * np.cos(np.radians(30)), abs=0.1)
    assert tip[2] == pytest.approx(10 * np.sin(np.radians(30)), abs=0.1)
    assert barrel.volume() == pytest.approx(np.pi * 0.01 * 10 * polygon_share(12))


def test_beam_is_its_length_times_its_section() -> None:
    beam = solids.beam(length=6, width=0.7, height=0.9, elevation=15)
    assert beam.volume() == pytest.approx(6 * 0.7 * 0.9)
    assert bounds(beam)[1, 1] == pytest.approx(0.35)


def test_plate_leans_back() -> None:
    """Tilt takes the top away from where the antenna looks, +u."""
    plate = solids.plate(width=5, height=4, thickness=0.2, tilt=15)
    top = plate.trim_by_plane((0, 0, 1), 1.5)
    assert bounds(top)[1, 0] < 0
    assert plate.volume() == pytest.approx(5 * 4 * 0.2)


def test_dish_is_hollow_towards_where_it_looks() -> None:
    dish = solids.dish(radius=1.2, depth=0.5)
    low, high = bounds(dish)
    assert high[0] == pytest.approx(0, abs=1e-9)
    assert low[0] == pytest.approx(-0.6)
    assert dish.volume() == pytest.approx(np.pi * 1.2**2 * 0.1, rel=0.02)


def test_mesh_dish_is_as_large_and_mostly_air() -> None:
    dish = solids.mesh_dish(width=7.3, height=3.6, depth=0.9)
    spread = np.diff(bounds(dish), axis=0)[0]
    np.testing.assert_allclose(spread[1:], [7.3, 3.6], atol=0.15)
    silhouette = dish.rotate((0, 90, 0)).project().area()
    assert 0.15 < silhouette / (7.3 * 3.6) < 0.4


@pytest.mark.parametrize("legs", [3, 4])
def test_lattice_stands_on_its_legs(legs) -> None:
    mast = solids.lattice(
        length=4, width=3, height=10, top_length=2, top_width=1, leg_radius=0.1,
        brace_radius=0.05, legs=legs, bays=3, sink=0.3,
    )  # fmt: skip
    assert len(mast.decompose()) == 1
    assert mast.slice(0.02).num_contour() == legs
    low, high = bounds(mast)
    assert low[2] == pytest.approx(-0.3, abs=0.02)
    assert high[2] == pytest.approx(10.1, abs=0.02)


def test_boat_is_pointed_and_floats_upright() -> None:
    boat = solids.boat(length=8, width=2, height=1.6)
    np.testing.assert_allclose(bounds(boat)[:, 0], [-4, 4])
    assert bounds(boat)[0, 2] == pytest.approx(0, abs=1e-9)
    assert boat.slice(1.0).area() > boat.slice(0.3).area()


@pytest.mark.parametrize(
    ("face", "inside"),
    [("aft", (-0.5, 0)), ("fore", (0.5, 0)), ("starboard", (0, -0.5)), ("port", (0, 0.5))],
)
def test_recess_goes_in_behind_its_face(face, inside) -> None:
    cut = solids.recess(length=1, width=1, height=2, face=face)
    middle = bounds(cut).mean(axis=0)
    assert np.dot(middle[:2], inside) > 0
    assert cut.volume() == pytest.approx(1 * 1.2 * 2)


def test_loft_turns_its_facets_outward_whatever_the_sense_of_its_rings() -> None:
    ring = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    prism = np.array([ring, ring + np.array([0, 0, 1])])
    assert loft(prism).volume() == pytest.approx(1)
    assert loft(prism[:, ::-1]).volume() == pytest.approx(1)


def test_hoop_is_a_torus() -> None:
    angle = 2 * np.pi * np.arange(64) / 64
    path = np.column_stack([3 * np.cos(angle), 3 * np.sin(angle), 0 * angle])
    hoop = tube(path, 0.2, sides=24, closed=True)
    assert hoop.genus() == 1
    assert hoop.volume() == pytest.approx(2 * np.pi**2 * 3 * 0.04, rel=0.02)


def test_net_is_ten_to_twenty_percent_solid() -> None:
    net = fittings.net(path=np.array([[0, 0, 0], [20.0, 0, 0]]), height=1.5, pitch=1.6)
    fence = net.trim_by_plane((0, 0, 1), 0)
    assert 0.10 < fence.rotate((90, 0, 0)).project().area() / (20 * 1.5) < 0.21


def test_windows_miss_the_back_of_the_house() -> None:
    corners = np.array([[0, -4], [6, -4], [6, 4], [0, 4.0]])
    panes = fittings.windows(
        solids.house_plan(corners, 3.0), 3.0, sill=1.0, height=1, width=0.8, pitch=1, depth=0.1
    )
    assert len(panes.decompose()) == 8 + 2 * 6
    assert bounds(panes)[1, 0] < 6
    assert panes.volume() == pytest.approx(20 * 0.8 * 1.0 * (0.1 + 0.1))


def test_raked_front_leans_forward() -> None:
    corners = np.array([[0, -4], [6, -4], [6, 4], [0, 4.0]])
    house = solids.house(outline=corners, height=2.0, front_rake=-10)
    assert bounds(house)[0, 0] == pytest.approx(-2 * np.tan(np.radians(10)))
    assert house.volume() == pytest.approx(8 * 2 * (6 + np.tan(np.radians(10))))


@pytest.mark.parametrize("name", ["duncan", "spruance", "texas"])
def test_hull_passes_through_its_stations(name) -> None:
    """At every wet station the section has the sheet's breadth at the deck and at the water."""
    hull = packaged_sheet(name).hull
    solid = hull.solid()
    for x, deck, half_deck, half_water in hull.stations[4:-4]:
        section = solid.rotate((0, 90, 0)).slice(-x)  # x comes to -z, z to x
        height, across = np.concatenate(section.to_polygons()).T
        assert height.max() == pytest.approx(deck, abs=1e-3)
        assert across[height > deck - 1e-3].max() == pytest.approx(half_deck, abs=1e-3)
        assert across[height < 1e-3].max() == pytest.approx(half_water, abs=1e-3)


def test_hull_never_bulges_past_its_stations() -> None:
    for name in ("duncan", "horne", "spruance", "texas", "connole", "roberts"):
        hull = packaged_sheet(name).hull
        assert bounds(hull.solid())[1, 1] <= hull.stations[:, 2].max() + 1e-9
