"""Range images of a box agree with an independent tracer."""

from functools import partial

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st
from traced_box import plane_down_range, trace

from ncti.render import range_image
from ncti.render.choice import choose_engine
from ncti.render.view import ROLL, View

OPENGL = choose_engine("auto")
ENGINES = sorted({OPENGL, "embree"})
LOW, HIGH = (-60.0, -7.0, -2.0), (70.0, 9.0, 12.0)


@pytest.mark.parametrize("engine", ENGINES)
@settings(max_examples=25, deadline=None)
@example(aspect=237.625, depression=60.9375, roll=1.25, pixel=0.765625, slant_range=230.825)
@given(
    aspect=st.floats(1, 359).filter(lambda a: abs(a % 90 - 45) < 44),
    depression=st.floats(0.2, 89),
    roll=st.floats(-180, 180),
    pixel=st.floats(0.2, 3),
    slant_range=st.none() | st.floats(2.1, 9).map(lambda exponent: 10**exponent),
)
@example(aspect=1.5, depression=0.2, roll=ROLL, pixel=0.25, slant_range=400.0)
def test_box_matches_tracer_from_any_view(engine, aspect, depression, roll, pixel, slant_range):
    """Ranges are exact where both see the same side; sides differ only at a border."""
    seen = {"aspect": aspect, "depression": depression, "roll": roll, "slant_range": slant_range}
    box = trimesh.creation.box(bounds=[LOW, HIGH])
    image = range_image(box, pixel=pixel, engine=engine, **seen)
    view = View(image.aspect, image.depression, image.roll, image.slant_range)
    traced = partial(trace, view, low=LOW, high=HIGH)
    horizontal, vertical = image.cross_range()
    expected, side = traced(horizontal, vertical)
    shared = image.hit & ~np.isnan(expected)
    # float64 rounding, for lines of sight that meet the side at 1e-3 or steeper
    same = np.abs(image.down_range - expected) < 1e-8

    # A rasteriser snaps vertices to 1/256 pixel: a pixel that differs must be within 1/128 pixel of
    # a border, so that a trace beside it meets another side.
    differs = (image.hit != ~np.isnan(expected)) | (shared & ~same)
    beside = [
        traced(
            horizontal[differs] + i * image.pixel / 128,
            vertical[differs] + j * image.pixel / 128,
        )
        for i in (-1, 1)
        for j in (-1, 1)
    ]
    sides = np.array([np.where(np.isnan(down_range), -1, facing) for down_range, facing in beside])
    assert np.all(np.ptp(sides, axis=0) > 0)

    # The slope by central differences of a plane's range.
    inner = shared & same
    cos, sin = np.cos(np.radians(view.roll)), np.sin(np.radians(view.roll))
    # At short range the slope of a grazing face changes within a millimetre; at long range it does
    # not, and the rounding of ranges is larger.
    step = np.longdouble(np.clip(1e-8 * (view.slant_range or np.inf), 1e-5, 1e-3))
    corner = np.where(view.axes[2] < 0, HIGH, LOW)  # of all sides that face the sensor
    for axis in range(3):
        on_side = inner & (side == axis)
        for index, (along, up) in enumerate([(cos, sin), (-sin, cos)]):
            ahead, behind = (
                plane_down_range(
                    view,
                    horizontal[on_side] + sign * step * along,
                    vertical[on_side] + sign * step * up,
                    point=corner,
                    normal=np.eye(3)[axis],
                )
                for sign in (1, -1)
            )
            slope = (ahead - behind) / (2 * step)
            computed = image.gradient[..., index][on_side]
            assert np.allclose(computed, slope.astype(float), rtol=1e-4, atol=1e-6)
