"""Range images against closed forms, limits and an independent tracer."""

import dataclasses

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st
from traced_box import plane_down_range, trace

from ncti.render import range_image
from ncti.render.choice import choose_engine
from ncti.render.solid import Solid, surface
from ncti.render.view import ROLL, Lattice, View

OPENGL = choose_engine("auto")
ENGINES = sorted({OPENGL, "embree"})
every_engine = pytest.mark.parametrize("engine", ENGINES)

LOW, HIGH = (-60.0, -7.0, -2.0), (70.0, 9.0, 12.0)


def box(low=LOW, high=HIGH):
    return trimesh.creation.box(bounds=[low, high])


def view_of(image):
    return View(image.aspect, image.depression, image.roll, image.slant_range)


def check_against_tracer(image, *, low=LOW, high=HIGH):
    """Exact where both see the same side; another side, or none, on its very border only."""
    view = view_of(image)
    horizontal, vertical = image.cross_range()
    expected, side = trace(view, horizontal, vertical, low=low, high=high)
    both = image.hit & ~np.isnan(expected)
    # Rounding of float64, where the line of sight meets the side no flatter than 1e-3.
    same = np.abs(image.down_range - expected) < 1e-8

    # A rasteriser snaps vertices to 1/256 pixel: a pixel that differs is to be within 1/128 of a
    # border, so that a trace beside it sees something else.
    differs = (image.hit != ~np.isnan(expected)) | (both & ~same)
    beside = [
        trace(
            view,
            horizontal[differs] + i * image.pixel / 128,
            vertical[differs] + j * image.pixel / 128,
            low=low,
            high=high,
        )
        for i in (-1, 1)
        for j in (-1, 1)
    ]
    seen = np.array([np.where(np.isnan(down_range), -1, facing) for down_range, facing in beside])
    assert np.all(np.ptp(seen, axis=0) > 0)

    # And the slope, from a plane's range a little to either side.
    inner = both & same
    cos, sin = np.cos(np.radians(view.roll)), np.sin(np.radians(view.roll))
    # From nearby the slope of a grazing face changes within a millimetre; from afar it does not,
    # and ranges are rounded by more.
    step = np.longdouble(np.clip(1e-8 * (view.slant_range or np.inf), 1e-5, 1e-3))
    for axis in range(3):
        here = inner & (side == axis)
        for index, (along, up) in enumerate([(cos, sin), (-sin, cos)]):
            ahead, behind = (
                plane_down_range(
                    view,
                    horizontal[here] + sign * step * along,
                    vertical[here] + sign * step * up,
                    point=side_point(view, axis, low, high),
                    normal=np.eye(3)[axis],
                )
                for sign in (1, -1)
            )
            slope = (ahead - behind) / (2 * step)
            computed = image.gradient[..., index][here]
            assert np.allclose(computed, slope.astype(float), rtol=1e-4, atol=1e-6)


def side_point(view, axis, low, high):
    """A point of the side normal to `axis` that faces the sensor."""
    return np.where(-view.axes[2][axis] > 0, high, low)


@every_engine
@pytest.mark.parametrize("slant_range", [None, 1e3, 4e3, 1e5, 1e7, 1e9])
@pytest.mark.parametrize(("aspect", "depression"), [(37.3, 3.84), (91.1, 0.7), (203.9, 61.3)])
def test_box_at_any_distance(engine, aspect, depression, slant_range):
    image = range_image(
        box(), aspect=aspect, depression=depression, slant_range=slant_range, engine=engine
    )
    check_against_tracer(image)


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
@pytest.mark.parametrize("pixel", [0.005, 0.03, 40.0])
def test_pixels_of_any_size(engine, pixel):
    low, high = (-1.0, -0.5, 0.0), (2.0, 0.7, 1.0)
    image = range_image(
        box(low, high), aspect=31, depression=12, pixel=pixel, slant_range=3e3, engine=engine
    )
    check_against_tracer(image, low=low, high=high)


@every_engine
def test_far_from_the_ship_origin(engine):
    """A mesh 100 km off its origin keeps its accuracy: float32 sees it from its own middle."""
    low, high = np.array(LOW) + 1e5, np.array(HIGH) + 1e5
    image = range_image(box(low, high), aspect=31, depression=12, engine=engine)
    check_against_tracer(image, low=low, high=high)


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


def test_a_pixel_beside_a_steep_facet_stays_within_its_range():
    """A rasteriser may give a pixel to a facet whose border is half a snap away; on a wall seen at
    0.06 deg the plane there is half a metre before or behind the wall."""
    wall = box((-5, -1, 0), (5, 1, 4))
    view = View(aspect=90.0 - 0.06, depression=0.0, roll=0.0)
    solid = Solid.of(wall)
    points = solid.along(view)
    bow = np.flatnonzero(solid.normals @ [1, 0, 0] > 0.9)
    edge = points[0, solid.faces[bow[0]]]
    for off in (-5e-4, 5e-4):
        # One pixel, centred a half millimetre off the wall's edge.
        lattice = Lattice(2 * (edge.max() + off), 0, 0, 1, 1, near=-9, far=9)
        down_range, gradient = surface(solid, view, lattice, points, bow[:1])
        away = points[2, solid.faces[bow[0]]]
        assert away.min() <= down_range[0, 0] <= away.max()
        assert abs(gradient[0, 0, 0]) == pytest.approx(1 / np.tan(np.radians(0.06)), rel=1e-6)


@every_engine
def test_tilted_plate_is_a_plane(engine):
    """Neighbours differ by slope times pixel, rolled or not, and the slope is that of the plate."""
    normal = np.array([0.6, 0.3, 0.7416198487095663])
    plate = box((-20, -20, -0.5), (20, 20, 0))
    plate.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], normal))
    for roll in (0.0, ROLL, 77.0):
        image = range_image(plate, aspect=40, depression=25, roll=roll, engine=engine)
        view = view_of(image)
        facing = view.axes @ normal
        slope = -facing[:2] / facing[2]
        on_plate = np.abs(image.gradient - slope).max(axis=-1) < 1e-5
        assert on_plate.sum() > 0.8 * image.hit.sum()
        horizontal, vertical = image.cross_range()
        right, up = View(40, 25, roll=0).axes[:2]
        plane = -(horizontal * (right @ normal) + vertical * (up @ normal)) / facing[2]
        assert np.abs(image.down_range - plane)[on_plate].max() < 1e-12 * 100


@every_engine
def test_what_is_left_and_right_up_and_down(engine):
    """Three balls of different size: one to port, one aloft, one at the bow."""
    at = {2.0: (0, 30, 0), 1.0: (0, 0, 25), 3.0: (40, 0, 0)}
    mesh = trimesh.util.concatenate(
        [trimesh.creation.icosphere(3, radius=r).apply_translation(p) for r, p in at.items()]
    )
    image = range_image(mesh, aspect=0, depression=0, engine=engine)
    horizontal, vertical = image.cross_range()
    # From ahead, port is to the right.
    for radius, (x, y, z) in at.items():
        near = image.hit & (np.hypot(horizontal - y, vertical - z) < radius + 1)
        assert near.sum() * image.pixel**2 == pytest.approx(np.pi * radius**2, rel=0.1)
        assert np.nanmin(image.down_range[near]) == pytest.approx(-x - radius, abs=0.05)
    assert image.hit.sum() * image.pixel**2 == pytest.approx(14 * np.pi, rel=0.05)


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
        shown = np.argwhere(inner) + shift[::-1]
        differences.append(image.down_range[tuple(shown.T)] - far.down_range[inner])
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


@every_engine
@pytest.mark.parametrize("slant_range", [1e3, 4e3, 1e5])
def test_a_small_target_is_at_its_distance(engine, slant_range):
    where = np.array([12.0, -31.0, 22.0])
    size = 1e-3
    image = range_image(
        box(where - size, where + size),
        aspect=70,
        depression=10,
        pixel=size / 3,
        slant_range=slant_range,
        engine=engine,
    )
    sensor = slant_range * -View(70, 10).axes[2]
    expected = np.linalg.norm(sensor - where) - slant_range
    assert np.nanmedian(image.down_range) == pytest.approx(expected, abs=2 * size)
    # The sagitta is what a far-field image would miss: 0.7 m at 1 km.
    if slant_range == 1e3:
        far = -(where @ -View(70, 10).axes[2])
        assert abs(expected - far) > 0.3


@every_engine
def test_gradient_is_the_limit_of_differences_with_curvature(engine):
    """Central differences over a facet approach the gradient as the square of the pixel."""
    errors = []
    for pixel in (2.0, 1.0, 0.5):
        image = range_image(
            box(), aspect=80, depression=30, pixel=pixel, slant_range=400.0, engine=engine
        )
        middle = (image.down_range[:, 2:] - image.down_range[:, :-2]) / (2 * pixel)
        computed = image.gradient[:, 1:-1, 0]
        same = (
            np.ptp(np.stack([image.gradient[:, i : i - 2 or None, 0] for i in range(3)]), axis=0)
            < 0.05
        )
        errors.append(np.median(np.abs(middle - computed)[same]))
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.allclose(slopes, 2, atol=0.25)


@every_engine
def test_a_mesh_changed_in_place_is_drawn_anew(engine):
    mesh = box()
    before = range_image(mesh, aspect=10, depression=5, engine=engine)
    mesh.apply_translation([-7.0, 0, 0])
    after = range_image(mesh, aspect=10, depression=5, engine=engine)
    moved = 7.0 * np.cos(np.radians(5)) * np.cos(np.radians(10))
    assert np.nanmin(after.down_range) - np.nanmin(before.down_range) == pytest.approx(
        moved, abs=0.05
    )


@every_engine
def test_more_ships_than_are_kept(engine):
    """A ship that was dropped from the engine's memory looks as it did the first time."""
    boxes = [box((-20.0 - i, -3, 0), (20, 3, 5)) for i in range(11)]
    first, second = (
        [range_image(b, aspect=30, depression=10, engine=engine).down_range for b in boxes]
        for _ in range(2)
    )
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a, b, equal_nan=True)
    assert len({image.shape for image in first}) > 1


@every_engine
def test_input_is_left_alone(engine):
    mesh = box()
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    image = range_image(mesh, aspect=10, depression=5, engine=engine)
    assert np.array_equal(mesh.vertices, vertices)
    assert np.array_equal(mesh.faces, faces)
    assert image.down_range.dtype == np.float64
    assert image.gradient.dtype == np.float32
    assert np.array_equal(image.hit, ~np.isnan(image.gradient).any(axis=-1))


def test_an_image_carries_its_view():
    image = range_image(box(), aspect=10, depression=5, pixel=0.5, slant_range=2e4, engine=OPENGL)
    carried = {
        f.name: getattr(image, f.name)
        for f in dataclasses.fields(image)
        if f.name not in {"down_range", "gradient", "origin"}
    }
    assert carried == {
        "aspect": 10,
        "depression": 5,
        "pixel": 0.5,
        "roll": ROLL,
        "slant_range": 2e4,
    }


def test_xarray_keeps_names_and_units():
    image = range_image(box(), aspect=10, depression=5, engine=OPENGL)
    data = image.to_xarray()
    assert data.down_range.attrs["units"] == "m"
    assert np.array_equal(data.down_range, image.down_range, equal_nan=True)
    assert np.array_equal(data.horizontal, image.cross_range()[0])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"aspect": np.nan}, "aspect is nan, but must be a finite number"),
        ({"aspect": 361}, "aspect is 361, but must be .* at most 360"),
        ({"depression": -1}, "depression is -1, but must be .* at least 0 and at most 90"),
        ({"depression": 90.1}, "depression is 90.1"),
        ({"roll": np.inf}, "roll is inf"),
        ({"pixel": 0}, "pixel is 0, but must be a finite number above 0"),
        ({"pixel": -0.25}, "pixel is -0.25"),
        ({"pixel": np.nan}, "pixel is nan"),
        ({"pixel": 1e-3}, "neither side may exceed 16384"),
        ({"slant_range": 0}, "slant_range is 0"),
        ({"slant_range": np.inf}, "slant_range is inf"),
        ({"slant_range": 40.0}, "slant_range is 40 m, and the ship reaches"),
        ({"engine": "vulkan"}, "engine is 'vulkan': it must be auto"),
    ],
)
def test_bad_parameters_are_named(wrong, message):
    with pytest.raises(ValueError, match=message):
        range_image(box(), **({"aspect": 10, "depression": 5} | wrong))


def test_bad_meshes_are_refused():
    empty = trimesh.Trimesh()
    with pytest.raises(ValueError, match="no facets"):
        range_image(empty, aspect=0, depression=0)
    broken = box()
    broken.vertices[0, 0] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        range_image(broken, aspect=0, depression=0)
