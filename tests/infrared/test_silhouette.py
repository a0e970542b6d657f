"""Coverage conserves area, follows the phase, and agrees with clipped outlines."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, FillRule
from warm_views import points, ship

import ncti.ships
from ncti.infrared import coverage_of, silhouette
from ncti.render import line_image
from ncti.render.view import View

phases = st.tuples(*[st.floats(0, 1, exclude_max=True)] * 2)


@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 3000),
    footprint=st.floats(0.3, 60),
    phase=phases,
    margin=st.integers(0, 5),
    slack=st.one_of(st.none(), st.floats(0, 50)),
)
def test_area_is_conserved(seed, count, footprint, phase, margin, slack):
    rng = np.random.default_rng(seed)
    horizontal, vertical = rng.uniform(-90, 90, count), rng.uniform(-10, 40, count)
    extent = slack if slack is None else (-90 - slack, 90 + slack, -10 - slack, 40 + slack)
    outline = coverage_of(
        horizontal,
        vertical,
        area=0.07,
        footprint=footprint,
        phase=phase,
        margin=margin,
        extent=extent,
    )
    # A sum of counts, exact, times one constant: two roundings, and as many in the sum as pixels.
    rounding = (2 + outline.coverage.size) * 2.3e-16
    assert outline.coverage.sum() * footprint**2 == pytest.approx(0.07 * count, rel=rounding)
    # The first moment shows that the area is in place, to half a pixel at most.
    cols = outline.origin[0] + footprint * np.arange(outline.coverage.shape[1])
    rows = outline.origin[1] + footprint * np.arange(outline.coverage.shape[0])
    share = outline.coverage / outline.coverage.sum()
    assert abs((share.sum(0) * cols).sum() - horizontal.mean()) <= footprint / 2 * (1 + 1e-9)
    assert abs((share.sum(1) * rows).sum() - vertical.mean()) <= footprint / 2 * (1 + 1e-9)


@settings(max_examples=50, deadline=None)
@given(phase=phases)
def test_phase_moves_the_ship_in_the_pixel(phase):
    """Phase p moves the ship right and up by p pixels, and the origin back by as much."""
    horizontal, vertical = points(ship("duncan", 60.0))
    window = {"area": 0.0625, "footprint": 7.5, "extent": (-100.0, 100.0, -50.0, 60.0)}
    shifted = coverage_of(horizontal, vertical, phase=phase, **window)
    moved = coverage_of(
        horizontal + 7.5 * phase[0],
        vertical + 7.5 * phase[1],
        **window | {"extent": tuple(np.add(window["extent"], 7.5 * np.repeat(phase, 2)))},
    )
    # A patch within rounding of an edge may fall on the other side of it.
    assert np.abs(shifted.coverage - moved.coverage).sum() * 7.5**2 <= 4 * 0.0625
    np.testing.assert_allclose(
        np.add(shifted.origin, 7.5 * np.array(phase)), moved.origin, atol=1e-9
    )


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 99), phase=phases, cells=st.integers(1, 5), window=st.booleans())
def test_cells_make_up_their_pixels(seed, phase, cells, window):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-60, 60, 3_000), rng.uniform(0, 30, 3_000)
    options = {"area": 0.1, "footprint": 3.75, "phase": phase, "margin": 2}
    options["extent"] = (-70.0, 65.0, -5.0, 40.0) if window else None
    pixels = coverage_of(x, y, **options)
    fine = coverage_of(x, y, **options, subdivision=cells)
    rows, cols = pixels.coverage.shape
    assert fine.coverage.shape == (rows * cells, cols * cells)
    assert fine.footprint == 3.75 / cells
    # First cell and first pixel have one corner.
    corners = [np.array(grid.origin) - grid.footprint / 2 for grid in (pixels, fine)]
    np.testing.assert_allclose(*corners, atol=1e-9)
    means = fine.coverage.reshape(rows, cells, cols, cells).mean(axis=(1, 3))
    # A point within rounding of an edge may fall on either side of it.
    assert np.abs(means - pixels.coverage).sum() * 3.75**2 <= 2 * 0.1


@pytest.mark.parametrize(("footprint", "phase"), [(3.75, (0.0, 0.0)), (7.5, (0.3, 0.8))])
@pytest.mark.parametrize("subdivision", [1, 2])
def test_lines_cover_pixels_as_the_outline_does(footprint, phase, subdivision):
    """0.25 m lines agree with polygons clipped at pixel borders to rms 0.1 % of a pixel."""
    hull, axes = ncti.ships.load("connole"), View(31.0, 3.84, roll=0.0).axes
    corners = (np.asarray(hull.vertices) @ axes.T)[np.asarray(hull.faces)]
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    facing = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0] > 0
    outline = CrossSection(list(corners[facing][..., :2]), FillRule.Positive)
    lines = line_image(hull, aspect=31.0, depression=3.84)
    image = silhouette(lines, footprint=footprint, phase=phase, margin=1, subdivision=subdivision)
    side = footprint / subdivision
    assert image.footprint == side
    square = CrossSection.square((side, side), center=True)
    exact = np.array(
        [
            [
                (outline ^ square.translate(np.add(image.origin, (side * c, side * r)))).area()
                for c in range(image.coverage.shape[1])
            ]
            for r in range(image.coverage.shape[0])
        ]
    )
    error = image.coverage - exact / side**2
    # an outline's part in a pixel meets side / 0.25 lines: errors fall with their 3/2 power
    assert np.sqrt(np.mean(error**2)) < 0.001 * (3.75 / side) ** 1.5
    assert image.coverage.sum() * side**2 == pytest.approx(lines.area.sum(), rel=1e-12)
