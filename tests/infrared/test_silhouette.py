"""Coverage counts every point in its cell, and agrees with clipped outlines."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, FillRule

import ncti.ships
from ncti.infrared import coverage_of, silhouette
from ncti.render import line_image
from ncti.render.view import View

LENGTHS = st.floats(-200, 200)
phases = st.tuples(*[st.floats(0, 1, exclude_max=True)] * 2)


@settings(deadline=None)
@given(
    points=st.lists(st.tuples(LENGTHS, LENGTHS), min_size=1, max_size=60),
    footprint=st.floats(0.5, 60),
    phase=phases,
    cells=st.integers(1, 4),
    margin=st.integers(0, 1),
    slack=st.none() | st.floats(0, 50),
)
def test_every_point_is_counted_in_its_cell(points, footprint, phase, cells, margin, slack):
    """The window is that of the points, or of an extent, here with points at its corners."""
    across, up = np.array(points).T
    extent = None
    if slack is not None:
        end = 200 + slack
        extent = (-end, end, -end, end)
        across, up = np.append(across, [-end, end]), np.append(up, [end, -end])
    options = {"area": 2.0, "footprint": footprint, "margin": margin, "subdivision": cells}
    counted = coverage_of(across, up, phase=phase, extent=extent, **options)
    plain = np.zeros(counted.coverage.shape)
    index = []
    for line, place, size, origin in zip(
        (up, across), phase[::-1], plain.shape, counted.origin[::-1], strict=True
    ):
        first = np.floor((line * (1 / footprint) + place).min()).astype(int) - margin
        cell = np.floor((line * (1 / footprint) + place) * cells).astype(int) - first * cells
        assert (cell < size).all()
        index.append(cell)
        corner = (first - place) * footprint + footprint / cells / 2
        assert origin == pytest.approx(corner, abs=1e-9)
    np.add.at(plain, tuple(index), 1.0)
    np.testing.assert_array_equal(counted.coverage, plain * (2.0 / (footprint / cells) ** 2))
    # The shape of the window of an extent does not depend on the phase.
    if extent:
        corner = coverage_of(across, up, extent=extent, **options)
        assert corner.coverage.shape == counted.coverage.shape


@pytest.mark.parametrize(
    ("footprint", "phase", "subdivision"), [(3.75, (0.0, 0.0), 1), (7.5, (0.3, 0.8), 2)]
)
def test_line_coverage_matches_clipped_outlines(footprint, phase, subdivision):
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
