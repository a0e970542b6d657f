"""Sobol indices and interpolation of a grid agree with closed forms."""

import numpy as np
import pytest

from docs._tables.sensitivity import grid_interpolant, interpolation_errors, sobol_indices


def test_sobol_indices_of_a_product_are_analytic():
    """Of x + x y, uniform from -1 to 1, three quarters of the variance are of x alone."""
    ends = dict.fromkeys("xy", (-1.0, 1.0))
    indices = sobol_indices(lambda at: at[:, 0] * (1 + at[:, 1]), ends, samples=4096, seed=3)
    np.testing.assert_allclose(indices["first"], [0.75, 0.0], atol=0.02)
    np.testing.assert_allclose(indices["total"], [1.0, 0.25], atol=0.02)
    assert (indices["total_interval"] < 0.1).all()


def test_interpolant_is_exact_for_multilinear_functions_of_logarithms():
    axes = [np.array([1.0, 3.0, 20.0]), np.array([2.0, 5.0])]
    x, y = np.meshgrid(*map(np.log, axes), indexing="ij")
    between = grid_interpolant(axes, 1 + 2 * x - y + 0.5 * x * y)
    points = np.random.default_rng(0).uniform(np.log([1, 2]), np.log([20, 5]), (50, 2))
    a, b = points.T
    assert np.allclose(between(points), 1 + 2 * a - b + 0.5 * a * b)


def test_interpolation_errors_of_a_parabola():
    places = np.exp(np.arange(7) * 0.3)
    values = np.add.outer(np.log(places) ** 2, np.zeros(2))
    # Between places 2 h apart a parabola x^2 is h^2 below its chord.
    errors = interpolation_errors([places, [1.0, 2.0]], values)
    assert errors[0] == pytest.approx(0.3**2) and np.isnan(errors[1])
