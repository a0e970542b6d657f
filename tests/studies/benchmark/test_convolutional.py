"""The convolutional network is a scikit-learn classifier that depends on its seed alone."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

from studies.benchmark.convolutional import ConvolutionalNetwork

torch = pytest.importorskip("torch", reason="the extra torch is not installed")

CLASSES, BINS, BLIP = 3, 60, 5


def blips(rng, places, *, each=40, noise=0.2):
    """Return vectors with one narrow blip, whose place tells the class, and their classes."""
    y = np.repeat(np.arange(CLASSES), each)
    bins = np.arange(BINS)
    shapes = np.abs(bins - np.array(places)[y][:, None]) <= BLIP // 2
    return shapes + noise * rng.normal(size=(len(y), BINS)), y


@parametrize_with_checks([ConvolutionalNetwork(epochs=10)])
def test_it_is_a_scikit_learn_classifier(estimator, check):
    check(estimator)


def test_network_learns_feature_positions():
    """Noise of 0.2 hides no blip of five bins of height 1, at 10, 30 or 50."""
    rng = np.random.default_rng(0)
    X, y = blips(rng, [10, 30, 50])
    network = ConvolutionalNetwork(random_state=0).fit(X, y)
    tests, truth = blips(rng, [10, 30, 50])
    probability = network.predict_proba(tests)
    np.testing.assert_allclose(probability.sum(axis=1), 1.0, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(network.predict(tests), truth)
    assert network.loss_curve_[-1] < 0.1 * np.log(CLASSES)


def test_training_shifts_improve_accuracy_on_shifted_tests():
    rng = np.random.default_rng(1)
    X, y = blips(rng, [25, 30, 35], noise=0.3)
    tests, truth = blips(rng, [27, 32, 37], noise=0.3)  # nearer to the class's own place

    def right(shift):
        scores = (
            ConvolutionalNetwork(shift=shift, random_state=k).fit(X, y).score(tests, truth)
            for k in range(3)
        )
        return np.mean([*scores])

    assert right(2) > right(0)


def test_answers_depend_on_the_seed_but_not_on_threads():
    """They are equal to the bit; torch's random state and number of threads do not change."""
    X, y = blips(np.random.default_rng(2), [10, 30, 50], each=20)
    answers, threads = [], torch.get_num_threads()
    try:
        for number in (1, 2, 4):
            torch.set_num_threads(number)
            torch.manual_seed(number)
            state = torch.get_rng_state()
            network = ConvolutionalNetwork(epochs=3, random_state=7).fit(X, y)
            answers.append(network.predict_proba(X))
            assert torch.get_num_threads() == number
            assert torch.equal(torch.get_rng_state(), state)
    finally:
        torch.set_num_threads(threads)
    for answer in answers[1:]:
        np.testing.assert_array_equal(answer, answers[0])
    answer = ConvolutionalNetwork(epochs=3, random_state=8).fit(X, y).predict_proba(X)
    assert not np.array_equal(answer, answers[0])
