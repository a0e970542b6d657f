"""Primitive solids match closed forms in volume, extent and direction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shipyard import bounds, packaged_sheet

from ncti.ships import solids

SIZE = st.floats(0.1, 20)


def polygon_share(sides: int) -> float:
    """Return the area of a regular polygon over that of its circumscribed circle."""
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


def test_cylinder_and_cone() -> None:
    share = polygon_share(32)
    assert solids.cylinder(radius=2, height=3).volume() == pytest.approx(12 * np.pi * share)
    cone = solids.cylinder(radius=2, height=3, top_radius=1)
    assert cone.volume() == pytest.approx(np.pi * 3 / 3 * (4 + 2 + 1) * share)


def test_sphere_and_ellipsoid_volumes_agree_to_one_percent() -> None:
    assert solids.sphere(radius=1.5).volume() == pytest.approx(4 / 3 * np.pi * 1.5**3, rel=0.011)
    egg = solids.ellipsoid(length_radius=1, width_radius=2, height_radius=3)
    assert egg.volume() == pytest.approx(4 / 3 * np.pi * 6, rel=0.011)
    np.testing.assert_allclose(bounds(egg)[1], [1, 2, 3])


def test_dish_is_concave_towards_its_boresight() -> None:
    dish = solids.dish(radius=1.2, depth=0.5)
    low, high = bounds(dish)
    assert high[0] == pytest.approx(0, abs=1e-9)
    assert low[0] == pytest.approx(-0.6)
    assert dish.volume() == pytest.approx(np.pi * 1.2**2 * 0.1, rel=0.02)


@pytest.mark.parametrize("legs", [3, 4])
def test_lattice_is_connected_with_all_legs_at_its_base(legs) -> None:
    mast = solids.Lattice(
        length=4, width=3, height=10, top_length=2, top_width=1, leg_radius=0.1,
        brace_radius=0.05, legs=legs, bays=3, sink=0.3,
    ).solid()  # fmt: skip
    assert len(mast.decompose()) == 1
    assert mast.slice(0.02).num_contour() == legs
    low, high = bounds(mast)
    assert low[2] == pytest.approx(-0.3, abs=0.02)
    assert high[2] == pytest.approx(10.1, abs=0.02)


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
