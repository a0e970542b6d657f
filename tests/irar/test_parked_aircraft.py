"""The source's first test of its range profiling, an aircraft parked on the ground, on a box.

Article, 'Range Profiling', before its Figure 14: of a parked airplane "gross features such as the
airplane's length were discernible from the profile". It prints neither that profile nor a figure,
a size or a range, so that there is nothing of the source to compare with: what is held here is
that length, breadth, height and profile come out within what pixel, bin, pulse and speckle leave.

The box has the size of a Gulfstream G-1's fuselage, which is 19.4 m long; the aircraft has its
span of 23.9 m, too. Neither moves, and what they stand on returns nothing. Of 19.4 m the profile
has 19.7 m without noise, nose-on, and 20.4 m with a standard deviation of 0.5 m over 20 draws.
"""

import math

import numpy as np
import pytest
import trimesh
from flown import flight
from scipy import stats

from ncti.irar import correct, fly, profile, segmented, ship_window

LENGTH, BREADTH, HEIGHT = 19.4, 2.4, 2.4  # m
SPAN, CHORD, WING = 23.9, 2.4, 0.6  # m; the last is the wing's height above ground
BINS = 60  # of 1 m
DRAWS = 20
DOWN = math.radians(15.0)
DOWN_RANGE = np.arange(BINS) - (BINS - 1) / 2


def fuselage():
    return trimesh.creation.box((LENGTH, BREADTH, HEIGHT)).apply_translation((0, 0, HEIGHT / 2))


def aeroplane():
    wing = trimesh.creation.box((CHORD, SPAN, 0.4)).apply_translation((0, 0, WING))
    fin = trimesh.creation.box((3.0, 0.4, 4.0)).apply_translation((-8.2, 0, HEIGHT + 2.0))
    return trimesh.util.concatenate([fuselage(), wing, fin])


def passed(mesh, aspect):
    """A pass at 2 km, steeper than those by ships: ten lines a pixel of 0.41 m."""
    of_air = {"ship_speed": 0.0, "line_rate": 600.0, "pulse_rate": 80_000.0, "samples": 120}
    seen = flight(
        aspect, slant_range=2000.0, depression=15.0, cnr=100.0, range_gate=100.0, **of_air
    )
    return fly(mesh, seen)


def profiled(mesh, scan):
    """The segmented image of a scan, and its profile."""
    window = ship_window(mesh, scan.flight)
    fine = segmented(correct(scan, window=window, overscanned=True), scan.flight)
    return fine, profile(fine, scan.flight, bins=BINS)


@pytest.fixture(scope="module")
def nose_on():
    return passed(fuselage(), 0.0)


@pytest.fixture(scope="module")
def draws(nose_on):
    """(draw, bin): profiles of independent scans."""
    rng = np.random.default_rng(19)
    return np.stack([profiled(fuselage(), nose_on.record(rng))[1] for _ in range(DRAWS)])


def depth_of_pixel(flown):
    """Range that a pixel spans on the level roof [m]: p cot(depression)."""
    return flown.pixel / math.tan(DOWN)


def roof_level(flown):
    """Noiseless profile of the roof, in noise powers a metre.

    A metre of range is tan(depression) metres of image, of the box's breadth. A pixel sees a depth
    D of roof at once: its mean intensity over range, the convolution of D with the response
    exp(-4 r^2 / l^2), peaks at sqrt(pi) / 2 erf(D / l) / (D / l) of what a flat target returns.
    """
    spread = depth_of_pixel(flown) / flown.pulse_length
    peak = math.sqrt(math.pi) / 2 * math.erf(spread) / spread
    return flown.cnr * peak * BREADTH * math.tan(DOWN) / flown.pixel**2


def seen_length(line, flown):
    """Depth from the first to the last bin with at least half of the roof's level [m]."""
    on = DOWN_RANGE[line >= roof_level(flown) / 2]
    return float(np.ptp(on)) + 1.0


def depth(aspect):
    """Range from the nearest to the farthest edge of the roof [m]."""
    a = math.radians(aspect)
    return (LENGTH * abs(math.cos(a)) + BREADTH * abs(math.sin(a))) * math.cos(DOWN)


AHEAD = (0.0, 30.0, 180.0, 330.0)  # wings reach no farther than the fuselage


@pytest.mark.parametrize(
    ("target", "aspect"),
    [(fuselage, 60.0), *((target, one) for target in (fuselage, aeroplane) for one in AHEAD)],
)
def test_length_of_a_noiseless_profile_is_the_targets(target, aspect):
    """Off by a bin, and by the range that the last pixels, which the roof fills in part, span."""
    mesh = target()
    flown = passed(mesh, aspect)
    line = profiled(mesh, flown.noiseless())[1]
    seen = flown.plan.flight
    assert seen_length(line, seen) == pytest.approx(depth(aspect), abs=1.0 + depth_of_pixel(seen))


def test_breadth_and_height_are_those_of_the_image(nose_on):
    """Within a pixel at each side: the front face and, above it, the whole roof."""
    fine, _ = profiled(fuselage(), nose_on.noiseless())
    pixel = nose_on.plan.flight.pixel
    there = fine.intensity > 0
    columns, rows = (fine.column[there.any(axis=0)], fine.row[there.any(axis=1)])
    assert np.ptp(columns) * pixel == pytest.approx(BREADTH, abs=2 * pixel)
    tall = HEIGHT * math.cos(DOWN) + LENGTH * math.sin(DOWN)
    assert np.ptp(rows) * pixel == pytest.approx(tall, abs=2 * pixel)


def test_noiseless_profile_is_a_spike_and_a_level_roof(nose_on):
    """The face's area in one spike, and tan(depression) of each metre of roof behind it.

    Five rays a pixel find the box's sides to a fifth of a pixel, 3 % of its breadth; of the ten
    bins of roof a pixel more or less lies within, D / 10.
    """
    seen = nose_on.plan.flight
    _, line = profiled(fuselage(), nose_on.noiseless())
    rays = 0.2 * seen.pixel / BREADTH
    middle = np.abs(DOWN_RANGE) <= 5
    share = rays + depth_of_pixel(seen) / np.count_nonzero(middle)
    assert line[middle].mean() == pytest.approx(roof_level(seen), rel=share)
    # The spike is where the front of the box is, and has what the roof does not.
    front = -(LENGTH * math.cos(DOWN) + HEIGHT * math.sin(DOWN)) / 2
    assert DOWN_RANGE[line.argmax()] == pytest.approx(front, abs=1.0)
    face = seen.cnr * BREADTH * HEIGHT * math.cos(DOWN) / seen.pixel**2
    rest = line.sum() - roof_level(seen) * depth(0.0)
    edge = roof_level(seen) * depth_of_pixel(seen)  # a pixel of roof, on the spike or not
    assert rest == pytest.approx(face, abs=rays * line.sum() + edge)


def test_length_survives_speckle_and_noise(nose_on, draws):
    """Each of 20 draws: as without noise, and four deviations of averaged ranges beyond it."""
    seen = nose_on.plan.flight
    scatter = seen.range_sigma / math.sqrt(seen.lines_per_pixel)
    bound = 1.0 + depth_of_pixel(seen) + 4 * scatter
    for line in draws:
        assert seen_length(line, seen) == pytest.approx(depth(0.0), abs=bound)


def test_roof_of_noisy_profiles_has_the_level_and_the_scatter_of_speckle(nose_on, draws):
    """Mean and scatter over 20 draws of ten bins of roof.

    A peak is no less than what is at one range, and of exponential intensities that are correlated
    over more than the pixel is deep no more than of two independent ones, which has the mean 1.5.
    Looks are independent and scatter by their mean at most: the variance of the mean over draws
    stays below what one draw in 1,000 exceeds, chi-squared of 19 degrees of freedom.
    """
    seen = nose_on.plan.flight
    middle = np.abs(DOWN_RANGE) <= 5
    found = (
        draws[:, middle].mean(axis=1) / profiled(fuselage(), nose_on.noiseless())[1][middle].mean()
    )
    area = BREADTH * math.tan(DOWN) * np.count_nonzero(middle) / seen.pixel**2
    speckle = 1 / math.sqrt(area * seen.lines_per_pixel)
    error = 4 * speckle / math.sqrt(DRAWS)
    assert 1.0 - error < found.mean() < 1.5 + error
    most = stats.chi2(DRAWS - 1).ppf(0.999) / (DRAWS - 1)
    # Ranges that scatter carry pixels over either end of the bins: one pixel's depth in ten.
    carried = seen.range_sigma / math.sqrt(seen.lines_per_pixel) / np.count_nonzero(middle)
    assert found.var(ddof=1) < most * found.mean() ** 2 * (speckle**2 + 2 * carried**2)


def test_wing_stands_where_it_is(nose_on):
    """Nose-on the wing's leading edge and its top return more than the fuselage about them."""
    mesh = aeroplane()
    flown = passed(mesh, 0.0)
    edge = -(CHORD / 2 * math.cos(DOWN) + WING * math.sin(DOWN))
    for scan in (flown.noiseless(), flown.record(np.random.default_rng(23))):
        line = profiled(mesh, scan)[1]
        at = edge - 1.0 <= DOWN_RANGE
        at &= edge + CHORD + 1.0 >= DOWN_RANGE
        assert at[line.argmax()]
        beside = np.abs(DOWN_RANGE - edge) <= 6
        assert line[at].max() > 4 * np.median(line[beside & ~at])
