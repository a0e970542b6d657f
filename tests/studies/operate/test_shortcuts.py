"""The quick match loses little against each template's own covariance and sampled frames."""

import numpy as np
import pytest

from docs._tables.operate import Setting, compare_likelihoods, plan_views

TESTS, DRAWS = 240, 8


@pytest.fixture(scope="module")
def views():
    """Return templates and random views of four ships."""
    return plan_views(TESTS)


@pytest.mark.parametrize("setting", [Setting(100, 4), Setting(100, 16, 10)])
def test_shared_covariance_is_as_accurate_as_per_template_ones(views, setting):
    right = compare_likelihoods(setting, views, DRAWS)
    exact, shared, drawn = (right[name].astype(float) for name in ("exact", "one", "drawn"))
    assert 0.4 < exact.mean() < 0.99
    # Of 800 views the answers differ in 2 % at most, so paired differences have a standard
    # deviation of at most sqrt(0.02 / 240) = 0.9 points: four of them, and a loss of half a point.
    assert abs(shared[0].mean() - exact.mean()) < 0.04
    # Draws of the same views are independent: their differences scatter between views.
    difference = drawn.mean(axis=0) - shared.mean(axis=0)
    assert abs(difference.mean()) < 4 * difference.std() / np.sqrt(TESTS)
