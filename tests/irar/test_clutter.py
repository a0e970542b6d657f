"""Sea clutter has the stated variance and correlation, and is fixed to the water."""

import dataclasses
import math

import numpy as np
import pytest
from flown import seen_from

from ncti.irar.clutter import clutter, sea_places

DEVIATION, LENGTH = 0.3, 12.0
DRAWS = 2000


def with_sea(passed, **sea):
    """Return the same pass with other sea parameters."""
    changed = dataclasses.replace(passed.plan.flight, **sea)
    return dataclasses.replace(passed, plan=dataclasses.replace(passed.plan, flight=changed))


APART = np.array([0.0, 3.0, 6.0, 12.0, 24.0, 60.0])


def test_clutter_has_stated_deviation_and_correlation():
    """Check 2,000 draws at six distances on two lines, each within 4.5 standard errors.

    The product of two normals of correlation r has the deviation sqrt(1 + r^2). Any of the 24
    comparisons exceeds 4.5 with a probability of 2e-4.
    """
    rng = np.random.default_rng(6)
    # One line along x, and an oblique one far from it.
    lines = [(APART, 0 * APART), (100.0 + 0.6 * APART, 0.8 * APART)]
    places = np.moveaxis(np.array(lines), 1, -1)
    sea = {"deviation": DEVIATION, "length": LENGTH}
    scaled = np.array([clutter(places, **sea, rng=rng) for _ in range(DRAWS)]) / DEVIATION
    assert np.abs(scaled.mean(axis=0)).max() < 4.5 / math.sqrt(DRAWS)
    expected = np.exp(-((APART / LENGTH) ** 2))
    for line in np.moveaxis(scaled, 1, 0):
        ours = (line * line[:, :1]).mean(axis=0)
        error = np.sqrt((1 + expected**2) / DRAWS)
        assert (np.abs(ours - expected) < 4.5 * error).all()


def test_sea_points_lie_on_their_lines_of_sight(flown):
    """Points computed on the water lie on their lines of sight at that time."""
    planned = flown.plan.flight
    columns = np.arange(0, planned.samples, 17)
    time = flown.plan.time(columns)[::40]
    along = np.broadcast_to(planned.scan_angles(columns), time.shape)
    places = sea_places(planned, time, along, np.zeros_like(along))
    on_ship = np.stack(
        [places[..., 0] - planned.ship_speed * time, places[..., 1], np.zeros_like(time)], axis=-1
    )
    right, above = planned.angles_to(on_ship, time)
    np.testing.assert_allclose(right, along, atol=1e-12)
    np.testing.assert_allclose(above, 0.0, atol=1e-12)
    assert (seen_from(planned, on_ship, time)[..., 2] > -planned.slant_range).all()


def test_clutter_changes_only_infrared_sea_pixels(flown):
    plain, rough = (
        with_sea(flown, clutter=level).record(np.random.default_rng(5))
        for level in (0.0, DEVIATION)
    )
    np.testing.assert_array_equal(plain.intensity, rough.intensity)
    np.testing.assert_array_equal(plain.range, rough.range)
    share = 1 - flown.returns.drop_leading(11).coverage()
    added = rough.infrared[0] - plain.infrared[0]
    np.testing.assert_allclose(added[share == 0], 0.0, atol=1e-6)
    assert added[share == 1].std() == pytest.approx(DEVIATION, rel=0.5)  # a few patches
    # Detector k looks k samples behind the first, at the same water.
    after = (rough.infrared - plain.infrared)[7, :, 7:]
    np.testing.assert_allclose(after, added[:, :-7], atol=1e-6)
    quiet = with_sea(flown, clutter=DEVIATION).noiseless()
    np.testing.assert_array_equal(quiet.infrared, flown.noiseless().infrared)
