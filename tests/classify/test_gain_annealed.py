"""The multilayered network against finite differences, sums node by node, and what it claims."""

from __future__ import annotations

import math
import warnings
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils.estimator_checks import parametrize_with_checks

from ncti.classify import GainAnnealedNetwork
from ncti.classify.back_propagation import GAIN_FACTOR, MOMENTUM, Layer, Network

PARAMETERS = [(i, name) for i in (0, 1) for name in ("weights", "offsets", "factors")]


@parametrize_with_checks([GainAnnealedNetwork()])
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
def test_it_is_a_scikit_learn_classifier(estimator, check):
    check(estimator)


def bumps(rng, *, classes=4, each=10, features=60, noise=0.05):
    """Vectors of `classes` kinds, each three bumps at places of its own."""
    places = rng.uniform(0, features, (classes, 3))
    shapes = np.exp(-0.5 * ((np.arange(features) - places[..., None]) / 3.0) ** 2).sum(axis=1)
    y = np.repeat(np.arange(classes), each)
    return shapes[y] + noise * rng.normal(size=(len(y), features)), y


def fit(X, y, **parameters) -> GainAnnealedNetwork:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GainAnnealedNetwork(**{"random_state": 0} | parameters).fit(X, y)


def random_network(rng, *, features=5, hidden=4, classes=3) -> Network:
    def layer(nodes, inputs):
        return Layer(
            rng.normal(size=(nodes, inputs)), rng.normal(size=nodes), rng.uniform(0.5, 2.0, nodes)
        )

    return Network(layer(hidden, features), layer(classes, hidden))


def random_task(rng, *, samples=7, features=5, classes=3):
    X = rng.normal(size=(samples, features))
    targets = np.where(rng.integers(0, classes, samples)[:, None] == np.arange(classes), 1.0, -1.0)
    return X, targets


def values(pair: list[Layer] | tuple[Layer, Layer], i: int, name: str):
    return getattr(pair[i], name)


def layers(network: Network) -> tuple[Layer, Layer]:
    return network.hidden, network.output


# The node and its gradient ---------------------------------------------------------------------


def test_a_node_answers_as_the_article_prints_it_but_for_the_sign():
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
def test_the_gradient_is_that_of_the_loss(seed, level):
    """Central differences of every weight, offset and gain.

    They err by h^2/6 |f'''| and eps |f| / h. At h = 1e-5 the third derivative, up to some
    hundreds at the largest level, leaves 1e-8 and the rounding 1e-10.
    """
    rng = np.random.default_rng(seed)
    network, (X, targets) = random_network(rng), random_task(rng)
    _, gradient = network.loss_and_gradient(X, targets, level)
    h, outputs = 1e-5, targets.shape[1]
    for i, name in PARAMETERS:
        parameter = values(layers(network), i, name)
        slope = np.empty_like(parameter)
        for index in np.ndindex(parameter.shape):
            kept = parameter[index]
            losses = []
            for side in (1, -1):
                parameter[index] = kept + side * h
                losses.append(network.loss_and_gradient(X, targets, level)[0])
            parameter[index] = kept
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
    network, (X, targets) = random_network(rng), random_task(rng)
    start = deepcopy(layers(network))
    slopes = []
    for _ in range(2):
        slopes.append(network.loss_and_gradient(X, targets, 1.0)[1])
        network.step(slopes[-1], 0.01)
    for i, name in PARAMETERS:
        first, second = (values(slope, i, name) for slope in slopes)
        expected = values(start, i, name) - 0.01 * ((1 + MOMENTUM) * first + second)
        np.testing.assert_allclose(values(layers(network), i, name), expected, rtol=1e-13)


@pytest.mark.parametrize("gain", [0.25, 3.0])
def test_a_gain_is_larger_weights_and_a_larger_step(gain):
    """Thimm, Moerland and Fiesler: gain g at step s is gain 1, weights times g, at step g^2 s.

    A node's own factor multiplies w.x + theta as it stands in either network: its step is s in
    both.
    """
    rng = np.random.default_rng(3)
    network, (X, targets) = random_network(rng), random_task(rng)
    twin = deepcopy(network)
    for layer in layers(twin):
        layer.weights *= gain
        layer.offsets *= gain
    for _ in range(50):
        loss, gradient = network.loss_and_gradient(X, targets, gain)
        twin_loss, twin_gradient = twin.loss_and_gradient(X, targets, 1.0)
        np.testing.assert_allclose(twin_loss, loss, rtol=1e-10)
        network.step(gradient, 0.02)
        for slope in twin_gradient:
            slope.weights *= gain**2
            slope.offsets *= gain**2
        twin.step(twin_gradient, 0.02)
    for mine, theirs in zip(layers(network), layers(twin), strict=True):
        # Fifty steps of a smooth map, each good to a few units in the last place.
        np.testing.assert_allclose(theirs.weights, gain * mine.weights, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(theirs.offsets, gain * mine.offsets, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(theirs.factors, mine.factors, rtol=1e-9)


# Growing ---------------------------------------------------------------------------------------


def test_a_new_node_changes_nothing_until_it_has_learned():
    rng = np.random.default_rng(4)
    network, (X, targets) = random_network(rng), random_task(rng)
    network.step(network.loss_and_gradient(X, targets, 1.0)[1], 0.01)
    before, old = network.loss_and_gradient(X, targets, 1.0)
    network.grow(np.random.RandomState(0))
    after, new = network.loss_and_gradient(X, targets, 1.0)
    np.testing.assert_allclose(after, before, rtol=1e-14)
    np.testing.assert_allclose(new[0].weights[:-1], old[0].weights, rtol=1e-12)
    np.testing.assert_array_equal(new[0].weights[-1], 0.0)
    assert np.all(new[1].weights[:, -1] != 0.0), "the outputs begin to hear it"
    network.step(new, 0.01)
    network.step(network.loss_and_gradient(X, targets, 1.0)[1], 0.01)
    assert network.loss_and_gradient(X, targets, 1.0)[0] < before


@pytest.mark.parametrize("features", [4, 250])
def test_new_weights_keep_the_sum_of_a_node_of_order_one(features):
    """Uniform within 1 / sqrt(features): of inputs of variance 1 the sum has variance 1/3.

    Over 2,000 nodes, by chi-square with as many degrees (the sums are nearly normal, and of few
    features less heavy-tailed) at 1e-4 on either side.
    """
    random, rng, count = np.random.RandomState(1), np.random.default_rng(1), 2000
    network = Network.seed(features, 3, random)
    for _ in range(count - 1):
        network.grow(random)
    weights, offsets = network.hidden.weights, network.hidden.offsets
    largest = 1 / np.sqrt(features)
    for drawn in (weights, offsets):
        assert np.abs(drawn).max() <= largest
        # None of 2,000 or more beyond 99 % of it has a chance of 1e-8.
        assert np.abs(drawn).max() > 0.99 * largest
    sums = np.einsum("nf,nf->n", weights, rng.choice([-1.0, 1.0], weights.shape))
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], count)
    assert low < 3 * np.sum(sums**2) < high


def test_without_annealing_the_loss_does_not_jump_when_a_node_is_added():
    X, y = bumps(np.random.default_rng(5))
    loss = np.array(
        fit(X, y, annealing=False, learning_rate=0.005, epochs=250, tolerance=0.01).loss_curve_
    )
    # At so small a step the error falls all the way, at the epochs of growth too.
    assert np.all(np.diff(loss) < 0.0)


@pytest.mark.parametrize(
    ("epochs", "hidden"), [(1, 1), (10, 1), (11, 2), (20, 2), (21, 3), (40, 4), (41, 5), (90, 5)]
)
def test_every_cycle_adds_a_node_up_to_the_limit(epochs, hidden):
    X, y = bumps(np.random.default_rng(6))
    network = fit(X, y, epochs=epochs, max_hidden=5, tolerance=1e-6)
    assert network.n_hidden_ == hidden == len(network.weights_[0])
    assert network.n_iter_ == epochs


def test_training_stops_and_stops_growing_at_the_tolerance():
    X, y = bumps(np.random.default_rng(7))
    full = fit(X, y, tolerance=1e-9, epochs=300)
    curve = np.array(full.loss_curve_)
    tolerance = 1.0001 * np.sqrt(curve[120])
    network = fit(X, y, tolerance=tolerance, epochs=300)
    assert network.converged_
    assert network.n_iter_ == np.flatnonzero(curve <= tolerance**2)[0]
    np.testing.assert_array_equal(network.loss_curve_, curve[: network.n_iter_ + 1])
    assert network.n_hidden_ == math.ceil(network.n_iter_ / 10) < full.n_hidden_


def test_an_error_above_the_tolerance_is_reported():
    X, y = bumps(np.random.default_rng(8))
    with pytest.warns(ConvergenceWarning, match="after 3 epochs"):
        network = GainAnnealedNetwork(epochs=3).fit(X, y)
    assert not network.converged_


def test_a_shorter_training_is_the_beginning_of_a_longer_one():
    X, y = bumps(np.random.default_rng(9))
    short, long = (fit(X, y, epochs=epochs, tolerance=1e-6) for epochs in (77, 300))
    np.testing.assert_array_equal(short.loss_curve_, long.loss_curve_[:78])


# Annealing -------------------------------------------------------------------------------------


def level_after(epochs, **parameters):
    """Gain level of the last of so many epochs, from nodes whose own gain does not move."""
    X, y = bumps(np.random.default_rng(10))
    network = fit(X, y, epochs=epochs, learning_rate=1e-300, tolerance=1e-9, **parameters)
    assert len(np.unique(np.concatenate(network.gains_))) == 1
    return network.gains_[0][0]


def test_the_gain_rises_in_equal_ratios_with_the_cycles():
    schedule = {"initial_gain": 0.25, "final_gain": 4.0, "max_hidden": 5, "grow_every": 3}
    levels = [level_after(epochs, **schedule) for epochs in range(1, 19)]
    expected = np.repeat([0.25, 0.5, 1.0, 2.0, 4.0, 4.0], 3)
    np.testing.assert_allclose(levels, expected, rtol=1e-14)


def test_without_annealing_the_gain_is_the_final_one():
    schedule = {"annealing": False, "initial_gain": 0.25, "final_gain": 4.0}
    assert level_after(1, **schedule) == 4.0
    assert level_after(1, max_hidden=1, initial_gain=0.25, final_gain=4.0) == 4.0


# Any numbers -----------------------------------------------------------------------------------


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("gain", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("size", [1e-300, 1.0, 1e6, 1e100])
@pytest.mark.parametrize("scaling", ["none", "common", "standard"])
@pytest.mark.parametrize("rate", [1e-3, 1e3])
def test_nothing_overflows(gain, size, scaling, rate):
    X, y = bumps(np.random.default_rng(11), each=3, features=20)
    X /= np.abs(X).max()
    network = fit(
        X * size,
        y,
        initial_gain=gain,
        final_gain=gain,
        scaling=scaling,
        learning_rate=rate,
        epochs=350,
        tolerance=1e-9,
    )
    parts = [*network.weights_, *network.offsets_, *network.gains_]
    assert all(np.isfinite(part).all() for part in parts)
    assert np.isfinite(network.loss_curve_).all()
    for other in (0.0, size, 1e100):
        outputs = network.outputs(X * other)
        assert np.all(np.abs(outputs) <= 1.0)
    for gains in network.gains_:
        assert np.all(gains >= GAIN_FACTOR[0] * gain * (1 - 1e-12))
        assert np.all(gains <= GAIN_FACTOR[1] * gain * (1 + 1e-12))


@settings(max_examples=20, deadline=None)
@given(power=st.integers(-300, 300))
def test_scaled_inputs_forget_their_unit(power):
    X, y = bumps(np.random.default_rng(12), each=4, features=20)
    for scaling in ("common", "standard"):
        network = fit(X, y, scaling=scaling, epochs=40)
        scaled = fit(X * 2.0**power, y, scaling=scaling, epochs=40)
        np.testing.assert_array_equal(scaled.outputs(X * 2.0**power), network.outputs(X))


def test_scaling_is_what_it_says():
    X, y = bumps(np.random.default_rng(13))
    X[:, 3] = 0.7
    common, standard = (fit(X, y, scaling=name) for name in ("common", "standard"))
    inputs = (X - common.centre_) / common.scale_
    np.testing.assert_allclose(inputs.mean(axis=0), 0.0, atol=1e-14)
    np.testing.assert_allclose(np.sqrt(np.mean(inputs**2)), 1.0, rtol=1e-14)
    inputs = (X - standard.centre_) / standard.scale_
    np.testing.assert_allclose(inputs[:, 3], 0.0, atol=1e-14)
    np.testing.assert_allclose(np.delete(inputs, 3, axis=1).std(axis=0), 1.0, rtol=1e-14)


def test_constant_inputs_are_no_reason_to_fail():
    for scaling in ("none", "common", "standard"):
        network = fit(np.ones((6, 4)), [0, 0, 0, 0, 1, 1], scaling=scaling)
        assert np.all(network.predict(np.ones((2, 4))) == 0), "the more frequent class"


def test_what_cannot_be_meant_is_refused():
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


# Answers ---------------------------------------------------------------------------------------


def test_it_learns_what_it_is_shown():
    X, y = bumps(np.random.default_rng(15))
    names = np.array(["texas", "duncan", "horne", "spruance"])
    network = fit(X, names[y], tolerance=0.1, epochs=2000, scaling="common")
    assert network.converged_
    np.testing.assert_array_equal(network.predict(X), names[y])
    np.testing.assert_array_equal(network.decision_function(X), network.outputs(X))
    best = network.outputs(X).argmax(axis=1)
    np.testing.assert_array_equal(network.predict(X), network.classes_[best])


def test_one_hidden_node_cannot_tell_what_is_not_on_a_line_but_three_can():
    X = np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0]])
    y = [0, 0, 1, 1]
    task = {"scaling": "common", "epochs": 2000, "learning_rate": 0.2, "tolerance": 0.1}
    one, three = (fit(X, y, max_hidden=nodes, **task) for nodes in (1, 3))
    # One node orders the corners along a line: an output that is monotonous in it fails on one.
    assert not one.converged_
    assert np.mean(one.predict(X) == y) <= 0.75
    assert three.converged_
    np.testing.assert_array_equal(three.predict(X), y)


def test_the_same_seed_gives_the_same_network_and_another_seed_another():
    X, y = bumps(np.random.default_rng(16))
    first, second, third = (fit(X, y, random_state=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.outputs(X), second.outputs(X))
    assert np.any(first.outputs(X) != third.outputs(X))
