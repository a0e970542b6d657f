"""Sobol indices and interpolation of a grid agree with closed forms."""

import numpy as np
import pytest

from studies.operate.sensitivity import grid_interpolant, interpolation_errors, sobol_indices


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_indices_of_the_ishigami_function():
    ends = {name: (-np.pi, np.pi) for name in "abc"}
    indices = sobol_indices(ishigami, ends, samples=4096, seed=3)
    # Closed forms, with a = 7 and b = 0.1.
    first = 0.5 * (1 + 0.1 * np.pi**4 / 5) ** 2
    second, interaction = 49 / 8, 0.01 * np.pi**8 * (1 / 18 - 1 / 50)
    variance = first + second + interaction
    expected = np.array([first, second, 0]) / variance
    totals = np.array([first + interaction, second, interaction]) / variance
    # The bound of six figures is twice a 95 % interval, which is 4 standard deviations.
    assert (np.abs(indices.first - expected) < 2 * indices.first_interval + 1e-3).all()
    assert (np.abs(indices.total - totals) < 2 * indices.total_interval + 1e-3).all()
    assert indices.names == ("a", "b", "c") and (indices.total_interval < 0.1).all()


def test_numbers_of_samples_are_powers_of_two():
    with pytest.raises(ValueError, match=r"samples is 1000, but must be a power of 2"):
        sobol_indices(ishigami, {"a": (0.0, 1.0)}, samples=1000)


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
