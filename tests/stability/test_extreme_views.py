"""Every engine is exact at extreme range, aspect, depression, size and place."""

import numpy as np
import pytest
from hard_meshes import ENGINES, area, box, outline, ranges, sampling_error, see
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti.ladar import range_extent

EPS = np.finfo(np.float64).eps


def check(engine, solid, *, pixel, size=130.0, **view):
    """Check the area within sampling error, and ranges within the solid's, up to rounding.

    A range is a plane's distance over a cosine, which loses digits by 1 / cosine; where that is
    over 10, the range is kept within the facet. The tolerance is thus 64 ulp of the farthest
    coordinate, plus for images 1/256 pixel at slope 10, by which a rasteriser may overshoot the
    outline.
    """
    image = see(engine, solid, pixel=pixel, **view)
    exact, perimeter, (near, far) = outline(solid.vertices, **view)
    assert area(image) == pytest.approx(exact, abs=sampling_error(perimeter, pixel))
    seen = ranges(image)
    far_away = np.abs(solid.vertices).max()
    slack = 64 * EPS * (far_away + size)
    if engine != "lines":
        slack += 10 * pixel / 256
    assert np.all((seen >= near - slack) & (seen <= far + slack))
    return image


@pytest.mark.parametrize("engine", ENGINES)
def test_a_ship_around_the_sensor_is_refused(engine):
    view = {"aspect": 37.0, "depression": 3.84}
    with pytest.raises(ValueError, match=r"slant_range is 100 m, and the ship reaches 4768"):
        see(engine, box(1e4 / 130), pixel=40.0, slant_range=100.0, **view)
    far = see(engine, box(1e4 / 130), pixel=40.0, **view)
    with pytest.raises(ValueError, match=r"slant_range is 100 m, and the ship reaches 47"):
        range_extent(far, slant_range=100.0, ifov=0.5, window=20e3)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("offset", [(1e6, 0, 0), (0, -1e6, 0), (0, 0, 1e6), (1e6, 1e6, 1e6)])
def test_views_are_exact_far_from_the_origin(engine, offset):
    """The range extent conserves area in cells far from the line of sight."""
    view = {"aspect": 37.0, "depression": 3.84}
    image = check(engine, box(offset=offset), pixel=0.5, size=1e6, **view)
    with pytest.raises(ValueError, match="window is 250 m, but must be at least"):
        range_extent(image, slant_range=1e12, ifov=15e-12)
    extent = range_extent(image, slant_range=1e12, ifov=15e-12, window=4e6, bin_width=1e4)
    assert extent.fraction.sum() * 15.0**2 == pytest.approx(area(image), rel=1e-9)


@settings(max_examples=30)
@given(
    engine=st.sampled_from([name for name in ENGINES if name != "osmesa"]),
    size=st.floats(0.0, 4.0),
    away=st.floats(1.7, 6.0) | st.none(),
    aspect=st.floats(-360.0, 360.0),
    depression=st.floats(0.0, 90.0),
    roll=st.floats(-360.0, 360.0),
    data=st.data(),
)
def test_convex_solid_covers_its_exact_outline(engine, size, away, aspect, depression, roll, data):
    """Sizes are 1 m to 10 km, seen from 50 to a million half sizes away."""
    import trimesh

    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    scale = 10.0**size
    solid = trimesh.convex.convex_hull(rng.uniform(-0.5, 0.5, (12, 3)) * scale)
    view = {"aspect": aspect, "depression": depression}
    view["slant_range"] = None if away is None else scale * 10.0**away
    image = see(engine, solid, pixel=scale / 64, roll=roll, **view)
    exact, perimeter, _ = outline(solid.vertices, **view)
    assert area(image) == pytest.approx(exact, abs=sampling_error(perimeter, scale / 64))
