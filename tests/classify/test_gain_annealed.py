"""The multilayered network agrees with finite differences and sums node by node."""

from __future__ import annotations

import math
import warnings
from copy import deepcopy

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils.estimator_checks import parametrize_with_checks

from ncti.classify import GainAnnealedNetwork
from ncti.classify.back_propagation import MOMENTUM, Layer, Network

PARAMETERS = [(i, name) for i in (0, 1) for name in ("weights", "offsets", "factors")]


@parametrize_with_checks([GainAnnealedNetwork()])
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
def test_it_is_a_scikit_learn_classifier(estimator, check):
    check(estimator)


def bumps(rng):
    """Return ten vectors of each of four kinds; each kind has three bumps."""
    places = rng.uniform(0, 60, (4, 3))
    shapes = np.exp(-0.5 * ((np.arange(60) - places[..., None]) / 3.0) ** 2).sum(axis=1)
    y = np.repeat(np.arange(4), 10)
    return shapes[y] + 0.05 * rng.normal(size=(len(y), 60)), y


def fit(X, y, **parameters) -> GainAnnealedNetwork:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GainAnnealedNetwork(**{"random_state": 0} | parameters).fit(X, y)


def random_case(rng) -> tuple[Network, np.ndarray, np.ndarray]:
    """Return a network of four hidden nodes, seven vectors and their targets of three classes."""

    def layer(nodes, inputs):
        return Layer(
            rng.normal(size=(nodes, inputs)), rng.normal(size=nodes), rng.uniform(0.5, 2.0, nodes)
        )

    network, X = Network(layer(4, 5), layer(3, 4)), rng.normal(size=(7, 5))
    targets = np.where(rng.integers(0, 3, 7)[:, None] == np.arange(3), 1.0, -1.0)
    return network, X, targets


def values(pair: list[Layer] | tuple[Layer, Layer], i: int, name: str):
    return getattr(pair[i], name)


def layers(network: Network) -> tuple[Layer, Layer]:
    return network.hidden, network.output


# The node and its gradient ---------------------------------------------------------------------


def test_outputs_match_printed_formula_up_to_sign():
    rng = np.random.default_rng(0)
    X, y = bumps(rng)
    network = fit(X, y, epochs=60, scaling="common")
    a, c = 2.0, -0.5
    for x, outputs in zip(X, network.outputs(X), strict=True):
        answers = (x - network.centre_) / network.scale_
        for weights, offsets, gains in zip(
            network.weights_, network.offsets_, network.gains_, strict=True
        ):
            answers = [
                a * (1 / (1 + math.exp(-beta * (math.fsum(w * answers) + theta))) + c)
                for w, theta, beta in zip(weights, offsets, gains, strict=True)
            ]
        # Sums of some 60 terms of order 1, then of 6.
        np.testing.assert_allclose(outputs, answers, rtol=0, atol=1e-13)


@pytest.mark.parametrize("level", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_gradient_matches_finite_differences(seed, level):
    """Compare with central differences in every weight, offset and gain.

    They err by h^2/6 |f'''| and eps |f| / h. At h = 1e-5 the third derivative, up to some
    hundreds at the largest level, leaves 1e-8 and the rounding 1e-10.
    """
    rng = np.random.default_rng(seed)
    network, X, targets = random_case(rng)
    _, gradient = network.loss_and_gradient(X, targets, level)
    h, outputs = 1e-5, targets.shape[1]
    for i, name in PARAMETERS:
        parameter = values(layers(network), i, name)
        slope = np.empty_like(parameter)
        for index in np.ndindex(parameter.shape):
            value = parameter[index]
            losses = []
            for side in (1, -1):
                parameter[index] = value + side * h
                losses.append(network.loss_and_gradient(X, targets, level)[0])
            parameter[index] = value
            # The gradient is of half the sum over outputs, the loss their mean.
            slope[index] = (losses[0] - losses[1]) / (2 * h) * outputs / 2
        assert np.abs(slope).max() > 1e-3, "there is something to compare"
        np.testing.assert_allclose(values(gradient, i, name), slope, rtol=0, atol=1e-7)


def test_the_loss_is_the_mean_square_error():
    rng = np.random.default_rng(1)
    X, y = bumps(rng)
    network = fit(X, y, epochs=37)
    targets = np.where(y[:, None] == network.classes_, 1.0, -1.0)
    error = np.mean((network.outputs(X) - targets) ** 2)
    np.testing.assert_allclose(network.loss_curve_[-1], error, rtol=1e-12)
    assert len(network.loss_curve_) == network.n_iter_ + 1
    assert network.loss_curve_[0] == 1.0, "at first no output says anything"


def test_a_step_follows_the_gradient_with_momentum():
    rng = np.random.default_rng(2)
    network, X, targets = random_case(rng)
    start = deepcopy(layers(network))
    slopes = []
    for _ in range(2):
        slopes.append(network.loss_and_gradient(X, targets, 1.0)[1])
        network.step(slopes[-1], 0.01)
    for i, name in PARAMETERS:
        first, second = (values(slope, i, name) for slope in slopes)
        expected = values(start, i, name) - 0.01 * ((1 + MOMENTUM) * first + second)
        np.testing.assert_allclose(values(layers(network), i, name), expected, rtol=1e-13)


# Annealing -------------------------------------------------------------------------------------


def level_after(epochs, **parameters):
    """Return the gain level of the last of some epochs, from nodes of constant own gain."""
    X, y = bumps(np.random.default_rng(10))
    network = fit(X, y, epochs=epochs, learning_rate=1e-300, tolerance=1e-9, **parameters)
    assert len(np.unique(np.concatenate(network.gains_))) == 1
    return network.gains_[0][0]


def test_gain_schedule_is_geometric():
    schedule = {"initial_gain": 0.25, "final_gain": 4.0, "max_hidden": 5, "grow_every": 3}
    levels = [level_after(epochs, **schedule) for epochs in range(1, 19)]
    expected = np.repeat([0.25, 0.5, 1.0, 2.0, 4.0, 4.0], 3)
    np.testing.assert_allclose(levels, expected, rtol=1e-14)


# Any numbers -----------------------------------------------------------------------------------


def test_invalid_arguments_are_refused():
    X, y = bumps(np.random.default_rng(14))
    with pytest.raises(ValueError, match=r"^initial_gain is 2.0, but must be .* at most 1$"):
        fit(X, y, initial_gain=2.0)
    with pytest.raises(ValueError, match=r"^the largest magnitude in X is 1e\+300"):
        fit(X / X.max() * 1e300, y)
    with pytest.raises(ValueError, match=r"^the largest magnitude in X is 1e\+300"):
        fit(X, y).predict(X / X.max() * 1e300)
    for name, value in {
        "max_hidden": 0,
        "grow_every": 0,
        "tolerance": 0.0,
        "epochs": 0,
        "learning_rate": 0.0,
        "final_gain": 1e7,
        "scaling": "raw",
    }.items():
        with pytest.raises(ValueError, match=name):
            fit(X, y, **{name: value})
