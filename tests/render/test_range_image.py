"""Range images against closed forms, limits and an independent tracer."""

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
every_engine = pytest.mark.parametrize("engine", ENGINES)

LOW, HIGH = (-60.0, -7.0, -2.0), (70.0, 9.0, 12.0)


def box():
    return trimesh.creation.box(bounds=[LOW, HIGH])


def check_against_tracer(image):
    """Exact where both see the same side; another side, or none, on its very border only."""
    view = View(image.aspect, image.depression, image.roll, image.slant_range)
    traced = partial(trace, view, low=LOW, high=HIGH)
    horizontal, vertical = image.cross_range()
    expected, side = traced(horizontal, vertical)
    shared = image.hit & ~np.isnan(expected)
    # Rounding of float64, where the line of sight meets the side no flatter than 1e-3.
    same = np.abs(image.down_range - expected) < 1e-8

    # A rasteriser snaps vertices to 1/256 pixel: a pixel that differs is to be within 1/128 of a
    # border, so that a trace beside it sees something else.
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

    # And the slope, from a plane's range a little to either side.
    inner = shared & same
    cos, sin = np.cos(np.radians(view.roll)), np.sin(np.radians(view.roll))
    # From nearby the slope of a grazing face changes within a millimetre; from afar it does not,
    # and ranges are rounded by more.
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


@every_engine
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
def test_box_from_anywhere(engine, aspect, depression, roll, pixel, slant_range):
    image = range_image(
        box(),
        aspect=aspect,
        depression=depression,
        roll=roll,
        pixel=pixel,
        slant_range=slant_range,
        engine=engine,
    )
    check_against_tracer(image)


@every_engine
def test_sphere(engine):
    """Range, slope, incidence and area of a ball whose facets are finer than a pixel."""
    radius, subdivisions = 10.0, 5
    ball = trimesh.creation.icosphere(subdivisions, radius=radius)
    sagitta = radius - np.linalg.norm(ball.triangles_center, axis=1).min()
    tilt = ball.edges_unique_length.max() / radius  # no facet is further off its sphere's normal
    image = range_image(ball, aspect=20, depression=30, pixel=0.125, engine=engine)

    column = image.origin[0] + image.pixel * np.arange(image.down_range.shape[1])
    row = image.origin[1] + image.pixel * np.arange(image.down_range.shape[0])[:, None]
    with np.errstate(invalid="ignore"):
        incidence = np.sqrt(1 - (column**2 + row**2) / radius**2)
    inner = incidence > 0.3
    assert image.hit[inner].all()
    error = image.down_range[inner] + radius * incidence[inner]
    assert error.min() > -1e-9  # facets lie within the ball, so behind its surface
    assert error.max() < sagitta / (0.3 - tilt)

    gradient = image.gradient[inner]
    cosine = 1 / np.sqrt(1 + (gradient**2).sum(axis=-1))
    assert np.abs(cosine - incidence[inner]).max() < tilt
    outward = np.stack(np.broadcast_arrays(column, row), axis=-1)[inner]
    assert ((gradient * outward).sum(axis=-1) >= -tilt * 10).all()  # grows towards the rim

    # Area: pixels are samples, of which those on the rim (2 pi R / pixel) are coin tosses; five
    # sigma of half of them, and the area that the facets lack.
    rim = 2 * np.pi * radius / image.pixel
    lattice_error = 5 * 0.5 * np.sqrt(rim) * image.pixel**2
    area = image.hit.sum() * image.pixel**2
    assert abs(area - np.pi * radius**2) < lattice_error + 2 * np.pi * radius * sagitta * 2


@every_engine
def test_far_field_is_approached_as_one_over_distance(engine):
    """The difference to the far field falls with slope -1, to a micrometre and without noise."""
    kwargs = {"aspect": 63.0, "depression": 8.0, "engine": engine}
    far = range_image(box(), **kwargs)
    distances = 10.0 ** np.arange(5, 10)
    inner = far.hit & shifted_hits(far.hit)
    differences = []
    for slant_range in distances:
        image = range_image(box(), slant_range=slant_range, **kwargs)
        shift = np.round((np.array(far.origin) - image.origin) / image.pixel).astype(int)
        places = np.argwhere(inner) + shift[::-1]
        differences.append(image.down_range[tuple(places.T)] - far.down_range[inner])
    size = np.abs(differences).max(axis=1)
    slope = np.diff(np.log(size)) / np.diff(np.log(distances))
    assert np.allclose(slope, -1, atol=1e-3)
    # Pixel by pixel too, but for the next term, of the order of (100 m)^3 / (1e8 m)^2.
    assert np.allclose(10 * differences[-1], differences[-2], rtol=0, atol=1e-9)


def shifted_hits(hit):
    """Where all neighbours are hit: away from silhouettes."""
    padded = np.pad(hit, 1)
    return np.all(
        [
            padded[1 + i :, 1 + j :][: hit.shape[0], : hit.shape[1]]
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
        ],
        axis=0,
    )
