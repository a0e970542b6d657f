"""Coverage: conservation, phase, windows of one shape, and the refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, FillRule
from warm_views import SHIPS, plate, points, ship

import ncti.ships
from ncti.checks import NothingSeenError
from ncti.infrared import coverage_of, silhouette
from ncti.render import line_image
from ncti.render.view import View

phases = st.tuples(*[st.floats(0, 1, exclude_max=True)] * 2)


@settings(max_examples=150, deadline=None)
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
    seen = coverage_of(
        horizontal,
        vertical,
        area=0.07,
        footprint=footprint,
        phase=phase,
        margin=margin,
        extent=extent,
    )
    # A sum of counts, exact, times one constant: two roundings, and as many in the sum as pixels.
    rounding = (2 + seen.coverage.size) * 2.3e-16
    assert seen.coverage.sum() * footprint**2 == pytest.approx(0.07 * count, rel=rounding)
    # The first moment tells that the area lies where it should: to half a pixel at most.
    cols = seen.origin[0] + footprint * np.arange(seen.coverage.shape[1])
    rows = seen.origin[1] + footprint * np.arange(seen.coverage.shape[0])
    share = seen.coverage / seen.coverage.sum()
    assert abs((share.sum(0) * cols).sum() - horizontal.mean()) <= footprint / 2 * (1 + 1e-9)
    assert abs((share.sum(1) * rows).sum() - vertical.mean()) <= footprint / 2 * (1 + 1e-9)


def test_coverage_is_the_count_by_definition():
    """Every pixel of the window by a plain comparison of coordinates."""
    horizontal, vertical = points(plate(width=23.0, height=7.0, centre=(4.0, 3.0)))
    seen = coverage_of(horizontal, vertical, area=0.0625, footprint=3.1, phase=(0.3, 0.8), margin=1)
    for row, col in np.ndindex(seen.coverage.shape):
        inside = np.abs(horizontal - (seen.origin[0] + 3.1 * col)) < 3.1 / 2
        inside &= np.abs(vertical - (seen.origin[1] + 3.1 * row)) < 3.1 / 2
        assert seen.coverage[row, col] == pytest.approx(inside.sum() * 0.0625 / 3.1**2)


@settings(max_examples=300, deadline=None)
@given(
    phase=phases,
    footprint=st.sampled_from([0.25, 1.875, 3.75, 7.5, 15.0, 1 / 3]),
    left=st.sampled_from([-90.0, -75.0, -7.3, 0.0, 1e-9]),
    span=st.one_of(st.sampled_from([0.0, 15.0, 150.0, 149.99999999]), st.floats(0, 200)),
    margin=st.integers(0, 3),
)
def test_window_of_an_extent_has_one_shape(phase, footprint, left, span, margin):
    extent = (left, left + span, left, left + span)
    corners = np.array([left, left + span])
    window = {"area": 1e-6, "footprint": footprint, "margin": margin, "extent": extent}
    seen = coverage_of(corners, corners, phase=phase, **window)
    assert seen.coverage.shape == coverage_of(corners, corners, **window).coverage.shape
    # Nothing was lost or folded, and the margin is sea.
    assert np.count_nonzero(seen.coverage) in (1, 2)
    assert seen.coverage.sum() * footprint**2 == pytest.approx(2e-6)
    if margin:
        assert not seen.coverage[:margin].any() and not seen.coverage[-margin:].any()
        assert not seen.coverage[:, :margin].any() and not seen.coverage[:, -margin:].any()
    # No wider than it must be: one pixel for where the extent begins, one for the phase.
    assert seen.coverage.shape[0] <= span / footprint + 1e-6 + 2 + 2 * margin


@pytest.mark.parametrize("margin", [0, 1, 4])
def test_own_bounding_box_has_exactly_the_margin(margin):
    seen = silhouette(plate(width=31, height=9), footprint=3.75, margin=margin)
    rows, cols = (np.flatnonzero(seen.coverage.any(axis=axis)) for axis in (1, 0))
    assert (rows[0], cols[0]) == (margin, margin)
    assert (rows[-1], cols[-1]) == tuple(n - 1 - margin for n in seen.coverage.shape)


@pytest.mark.parametrize("footprint", [1.875, 3.75, 15.0])
def test_a_filled_pixel_has_coverage_one_to_a_patch(footprint):
    """Standard deviation of at most one 0.25 m patch over many pixels and phases of a plate."""
    horizontal, vertical = points(plate(width=100, height=100))
    rng = np.random.default_rng(0)
    window = {"area": 0.0625, "footprint": footprint, "margin": 0}
    seen = [
        coverage_of(horizontal, vertical, phase=tuple(rng.random(2)), **window).coverage[1:-1, 1:-1]
        for _ in range(20)
    ]
    error = np.concatenate([coverage[1:-1, 1:-1].ravel() for coverage in seen]) - 1
    assert error.size >= 20 * 3**2
    assert error.std() < 0.0625 / footprint**2


def test_a_half_filled_pixel_obeys_the_rule():
    # 15 m pixels on a corner: the plate fills 2 x 2 of them by 2/3 each, of patches of 0.25 m in
    # lines of 40 by 60, of which one either way may fall across the edge.
    seen = silhouette(plate(width=20, height=30, roll=0.0), footprint=15.0)
    np.testing.assert_allclose(seen.coverage[4:-4, 4:-4], 2 / 3, rtol=1 / 40 + 1 / 60 + 1e-9)
    assert seen.target(0.63).sum() == 4
    assert seen.target(0.70).sum() == 0
    assert seen.target(1e-9).dtype == bool


@pytest.mark.parametrize("name", SHIPS)
def test_ships_are_whole(name):
    image = ship(name, 90.0)
    area = image.hit.sum() * image.pixel**2
    for footprint in (1.875, 3.75, 15.0):
        seen = silhouette(image, footprint=footprint, phase=(0.4, 0.7))
        assert seen.coverage.sum() * footprint**2 == pytest.approx(area, rel=1e-12)
        # A filled pixel errs by about one patch: five of them are no accident.
        assert seen.coverage.max() <= 1 + 5 * 0.0625 / footprint**2
        assert 0 < seen.target(0.5).sum() <= seen.target(0.25).sum()
    # 25 km: the beam-on ship is as long as its hull, to a pixel on either end.
    fine = silhouette(image, footprint=3.75).target(0.25)
    horizontal, _ = points(image)
    length = np.ptp(horizontal)
    assert np.count_nonzero(fine.any(axis=0)) * 3.75 == pytest.approx(length, abs=2 * 3.75)


@settings(max_examples=50, deadline=None)
@given(phase=phases)
def test_phase_moves_the_ship_in_the_pixel(phase):
    """Phase p is the ship moved right and up by p pixels; the origin moves back by as much."""
    horizontal, vertical = points(ship("duncan", 60.0))
    window = {"area": 0.0625, "footprint": 7.5, "extent": (-100.0, 100.0, -50.0, 60.0)}
    seen = coverage_of(horizontal, vertical, phase=phase, **window)
    moved = coverage_of(
        horizontal + 7.5 * phase[0],
        vertical + 7.5 * phase[1],
        **window | {"extent": tuple(np.add(window["extent"], 7.5 * np.repeat(phase, 2)))},
    )
    # A patch within rounding of an edge may fall on the other side of it.
    assert np.abs(seen.coverage - moved.coverage).sum() * 7.5**2 <= 4 * 0.0625
    np.testing.assert_allclose(np.add(seen.origin, 7.5 * np.array(phase)), moved.origin, atol=1e-9)


def test_phase_of_a_whole_pixel_is_a_shift():
    """Just below 1 all is as at 0, one pixel on."""
    image = ship("horne", 30.0)
    still = silhouette(image, footprint=7.5)
    moved = silhouette(image, footprint=7.5, phase=(1 - 1e-12, 1 - 1e-12))
    np.testing.assert_array_equal(still.coverage, moved.coverage)
    np.testing.assert_allclose(still.origin, moved.origin, atol=1e-9)
    # In a window that stands still, as it begins with a pixel, the ship has moved.
    extent = (-97.5, 101.0, -20.0, 61.0)
    still, moved = (
        silhouette(image, footprint=7.5, phase=(p, 0.0), extent=extent) for p in (0.0, 1 - 1e-12)
    )
    np.testing.assert_array_equal(np.roll(still.coverage, 1, axis=1), moved.coverage)


def test_half_a_pixel_of_phase_halves_an_edge():
    """A plate of one pixel: in it, on two, on four."""
    image = plate(width=15, height=15, centre=(7.5, 7.5), roll=0.0)
    whole = silhouette(image, footprint=15.0, margin=0)
    right = silhouette(image, footprint=15.0, phase=(0.5, 0.0), margin=0)
    both = silhouette(image, footprint=15.0, phase=(0.5, 0.5), margin=0)
    np.testing.assert_allclose(whole.coverage, [[1.0]])
    np.testing.assert_allclose(right.coverage, [[0.5, 0.5]])
    np.testing.assert_allclose(both.coverage, np.full((2, 2), 0.25))


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 99), phase=phases, cells=st.integers(1, 5), window=st.booleans())
def test_cells_make_up_their_pixels(seed, phase, cells, window):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-60, 60, 3_000), rng.uniform(0, 30, 3_000)
    given = {"area": 0.1, "footprint": 3.75, "phase": phase, "margin": 2}
    given["extent"] = (-70.0, 65.0, -5.0, 40.0) if window else None
    pixels = coverage_of(x, y, **given)
    fine = coverage_of(x, y, **given, subdivision=cells)
    rows, cols = pixels.coverage.shape
    assert fine.coverage.shape == (rows * cells, cols * cells)
    assert fine.footprint == 3.75 / cells
    # First cell and first pixel have one corner.
    corners = [np.array(seen.origin) - seen.footprint / 2 for seen in (pixels, fine)]
    np.testing.assert_allclose(*corners, atol=1e-9)
    means = fine.coverage.reshape(rows, cells, cols, cells).mean(axis=(1, 3))
    # A point within rounding of an edge may fall on either side of it.
    assert np.abs(means - pixels.coverage).sum() * 3.75**2 <= 2 * 0.1


def test_no_ship_in_an_extent_is_all_sea():
    none = np.zeros(0)
    seen = coverage_of(none, none, area=0.1, footprint=3.0, extent=(-9.0, 9.0, 0.0, 9.0))
    assert seen.coverage.shape == (3 + 2 + 8, 6 + 2 + 8)
    assert not seen.coverage.any()


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"footprint": 0.2}, "footprint is 0.2, but must be .* at least 0.25"),
        ({"footprint": np.nan}, "footprint"),
        ({"phase": (0.0, 1.0)}, r"phase\[1\] is 1"),
        ({"phase": (-0.1, 0.0)}, r"phase\[0\]"),
        ({"phase": (np.nan, 0.0)}, r"phase\[0\]"),
        ({"margin": -1}, "margin"),
        ({"margin": 1.5}, "margin"),
        ({"extent": (-5.0, 5.0, -50.0, 50.0)}, "extent is -5 to 5 m horizontal, .* ship"),
        ({"extent": (-50.0, 50.0, -50.0, 1.0)}, "extent is -50 to 1 m vertical"),
        ({"extent": (50.0, -50.0, -50.0, 50.0)}, "extent"),
        ({"margin": 10**6}, "margin is 1000000, but must be .* at most 16384"),
        ({"margin": 8200}, "which make 1641[12] by 16404 cells, but neither side may exceed 16384"),
        ({"subdivision": 10**6}, "subdivision is 1000000, but must be .* at most 16384"),
        ({"extent": (-1e9, 1e9, -50.0, 50.0)}, "neither side may exceed 16384"),
        ({"extent": (-1e300, 50.0, -50.0, 50.0)}, "extent"),
        ({"extent": (-np.inf, 50.0, -50.0, 50.0)}, "extent"),
    ],
)
def test_bad_parameters_are_named(parameters, named):
    with pytest.raises(ValueError, match=named) as refused:
        silhouette(plate(width=40, height=12), **{"footprint": 3.75} | parameters)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("footprint", [1e-4, 1e-300])
def test_points_in_pixels_too_small_to_count_are_refused(footprint):
    with pytest.raises(ValueError, match=r"^footprint is "):
        coverage_of(np.array([0.0, 90.0]), np.zeros(2), area=0.1, footprint=footprint)


def test_bad_rules_and_empty_images_are_named():
    image = plate(width=40, height=12)
    for rule in (0.0, 1.1, np.nan):
        with pytest.raises(ValueError, match="rule"):
            silhouette(image, footprint=3.75).target(rule)
    image.down_range[:] = np.nan
    with pytest.raises(NothingSeenError, match="extent must be given"):
        silhouette(image, footprint=3.75)


@pytest.mark.parametrize(("footprint", "phase"), [(3.75, (0.0, 0.0)), (7.5, (0.3, 0.8))])
@pytest.mark.parametrize("subdivision", [1, 2])
def test_lines_cover_pixels_as_the_outline_does(footprint, phase, subdivision):
    """Against polygons clipped at the borders of pixels: rms 0.1 % of a pixel by 0.25 m lines."""
    hull, view = ncti.ships.load("connole"), View(31.0, 3.84)
    corners = (np.asarray(hull.vertices) @ view_axes(view).T)[np.asarray(hull.faces)]
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    facing = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0] > 0
    outline = CrossSection(list(corners[facing][..., :2]), FillRule.Positive)
    lines = line_image(hull, aspect=31.0, depression=3.84)
    seen = silhouette(lines, footprint=footprint, phase=phase, margin=1, subdivision=subdivision)
    side = footprint / subdivision
    assert seen.footprint == side
    square = CrossSection.square((side, side), center=True)
    exact = np.array(
        [
            [
                (outline ^ square.translate(np.add(seen.origin, (side * c, side * r)))).area()
                for c in range(seen.coverage.shape[1])
            ]
            for r in range(seen.coverage.shape[0])
        ]
    )
    error = seen.coverage - exact / side**2
    # an outline's part in a pixel meets side / 0.25 lines: errors fall with their 3/2 power
    assert np.sqrt(np.mean(error**2)) < 0.001 * (3.75 / side) ** 1.5
    assert seen.coverage.sum() * side**2 == pytest.approx(lines.area.sum(), rel=1e-12)


def view_axes(view):
    """Unit vectors right, up and away, not rolled."""
    return View(view.aspect, view.depression, roll=0.0).axes
