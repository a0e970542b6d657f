"""Evidence is a Gaussian density, and shares of the first ships do not depend on others."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from studies.operate.fleets import (
    bootstrap_uniforms,
    fleet_order,
    fleet_shares,
    views_of_ships,
)
from studies.operate.matching import log_evidence


@given(st.integers(0, 2**32 - 1), st.floats(0, 5))
def test_evidence_is_a_gaussian_density_up_to_a_constant_of_each_sample(seed, gain_sigma):
    rng = np.random.default_rng(seed)
    samples, templates = rng.standard_normal((4, 3)), rng.standard_normal((5, 3))
    evidence = log_evidence(
        samples @ templates.T, (templates**2).sum(axis=1), gain_sigma=gain_sigma
    )
    exact = np.array(
        [
            multivariate_normal(
                template, np.eye(3) + gain_sigma**2 * np.outer(template, template)
            ).logpdf(samples)
            for template in templates
        ]
    ).T
    difference = (evidence - evidence[:, :1]) - (exact - exact[:, :1])
    assert np.abs(difference).max() < 1e-4


def test_fleet_order_puts_nominal_ships_before_variants():
    names = [
        "texas@0.2x4",
        "roberts",
        "duncan@0.10",
        "horne",
        "duncan@0.2",
        "my.stl",
        "duncan",
        "texas",
    ]
    assert [names[k] for k in fleet_order(names)] == [
        *("duncan", "horne", "texas", "my.stl", "roberts"),
        *("duncan@0.2", "texas@0.2x4", "duncan@0.10"),
    ]


@given(st.integers(1, 400), st.integers(4, 60))
def test_every_fleet_size_has_enough_tests(tests, ships):
    rows = views_of_ships(tests, ships)
    for fleet in range(4, ships + 1):
        least = rows[fleet - 1]
        assert min(rows[:fleet]) >= least and tests <= least * fleet < tests + fleet


def test_shares_of_some_ships_do_not_depend_on_others():
    rng = np.random.default_rng(2)
    rows = sum(views_of_ships(40, 9))
    evidence = rng.standard_normal((rows, 9))
    uniforms = bootstrap_uniforms(7, 40, 9, np.random.default_rng(0))
    share, resampled = fleet_shares(evidence, 40, [4, 9, 6], uniforms)
    row_count = sum(views_of_ships(40, 6))
    first_share, first_resampled = fleet_shares(
        evidence[:row_count, :6], 40, [6], bootstrap_uniforms(7, 40, 6, np.random.default_rng(0))
    )
    assert share[2] == first_share[0] and np.array_equal(resampled[2], first_resampled[0])


def test_resampled_shares_have_binomial_variance():
    tests, resamples = 400, 4000
    right = np.random.default_rng(3).random((4, 100)) < 0.8
    evidence = np.zeros((400, 4))
    ship = np.repeat(np.arange(4), 100)
    evidence[np.arange(400), np.where(right.ravel(), ship, (ship + 1) % 4)] = 1
    uniforms = bootstrap_uniforms(resamples, tests, 4, np.random.default_rng(1))
    share, resampled = fleet_shares(evidence, tests, [4], uniforms)
    assert share[0] == right.mean()
    variance = (right.mean(axis=1) * (1 - right.mean(axis=1))).sum() / 16 / 100
    # Bounds are four standard errors of a mean and of a variance of Gaussians, ship by ship.
    assert abs(resampled.mean() - share[0]) < 4 * math.sqrt(variance / resamples)
    assert abs(resampled.var() / variance - 1) < 4 * math.sqrt(2 / resamples)
