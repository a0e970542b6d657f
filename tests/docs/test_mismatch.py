"""Conditions in which tests differ from templates change profiles as their names say."""

import numpy as np
import pytest

from docs._tables import mismatch
from ncti.ladar import range_extent


def extent(**how):
    image = mismatch._image("duncan", 60.0, how.pop("depression", 3.84), **how)
    return range_extent(image, slant_range=100e3)


def test_nearer_ship_shifts_its_profile_forward():
    """It moves by two bins, up to the curvature of the wavefront there: 2e-5 of 0.03 m."""
    here, nearer = (extent(**how).fraction.sum(axis=0) for how in ({}, {"nearer": 2.0}))
    np.testing.assert_allclose(nearer[:-2], here[2:], rtol=0, atol=1e-5 * here.max())


def test_rolled_ifovs_see_the_same_ship():
    """Each bin has the same area, up to the 1e-8 squares of the spacing that a cell drops."""
    plain, rolled = extent(), extent(roll=5.0)
    assert not np.array_equal(plain.cell, rolled.cell)
    np.testing.assert_allclose(rolled.fraction.sum(axis=0), plain.fraction.sum(axis=0), atol=1e-6)


def test_mismatch_report_has_a_row_per_condition():
    report = mismatch.measure(seeds=2, tests=1, step=30.0)
    assert report.rows[0]["what"] == mismatch.UNCHANGED.name
    assert len(report.rows) == 1 + len(mismatch.CONDITIONS)
    for row in report.rows:
        assert all(row[name] for name in mismatch.CLASSIFIERS)


@pytest.mark.parametrize("condition", mismatch.CONDITIONS, ids=lambda one: one.name)
def test_every_condition_differs_from_the_nominal_one(condition):
    def drawn(of):
        seen = []
        mismatch._percent(
            [lambda averages: seen.append(averages) or np.zeros(len(averages))], of, 0, 1
        )
        return seen[0]

    assert not np.array_equal(drawn(condition), drawn(mismatch.UNCHANGED))
