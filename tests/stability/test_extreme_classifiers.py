"""Classifiers at the ends of their parameters, and on profiles of nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti.classify import (
    AdaptiveClusteringNetwork,
    CorrelationNeighbour,
    GainAnnealedNetwork,
    GaussianTemplates,
)
from ncti.features import profile_vector

EPS = np.finfo(np.float64).eps
pytestmark = pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")

LABELS = np.repeat(["a", "b", "c", "d"], 8)
EVERYONE = (AdaptiveClusteringNetwork, CorrelationNeighbour, GainAnnealedNetwork)


def profiles(seed=0):
    """(32, 40) vectors that all agree a little: their cosines are in (0, 1)."""
    return np.random.default_rng(seed).random((32, 40))


@pytest.mark.parametrize("learning_rate", [np.nextafter(0, 1), 1e-12, 0.1, 1.0])
def test_vigilance_of_nought_and_one(learning_rate):
    """Vectors that all agree are one category at 0; at 1 every direction has its own."""
    one, all_ = (
        AdaptiveClusteringNetwork(vigilance=v, learning_rate=learning_rate).fit(profiles(), LABELS)
        for v in (0.0, 1.0)
    )
    assert (one.n_categories_, all_.n_categories_) == (1, 32)
    assert one.converged_
    assert all_.converged_
    assert (all_.predict(profiles()) == LABELS).all()


def test_a_category_of_learning_rate_one_is_its_last_vector_and_of_nought_its_first():
    """W += (X - W) dt. 64 steps of 1e-15 in two passes leave it within 1e-13 of the first."""
    last, first = (
        AdaptiveClusteringNetwork(vigilance=0.0, learning_rate=rate).fit(profiles(), LABELS)
        for rate in (1.0, 1e-15)
    )
    np.testing.assert_allclose(last.categories_[0], profiles()[-1], rtol=8 * EPS)
    np.testing.assert_allclose(first.categories_[0], profiles()[0], rtol=0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("classifier", "name", "value"),
    [
        (AdaptiveClusteringNetwork, "learning_rate", 0),
        (AdaptiveClusteringNetwork, "learning_rate", 1.1),
        (AdaptiveClusteringNetwork, "vigilance", np.nextafter(1, 2)),
        (AdaptiveClusteringNetwork, "vigilance", np.nan),
        (GainAnnealedNetwork, "learning_rate", 0),
        (GainAnnealedNetwork, "learning_rate", 1001.0),
        (GainAnnealedNetwork, "final_gain", 1.1e6),
        (GainAnnealedNetwork, "initial_gain", 0),
    ],
)
def test_parameters_out_of_range_are_refused(classifier, name, value):
    with pytest.raises(ValueError, match=f"The '{name}' parameter of .* in the range .* Got "):
        classifier(**{name: value}).fit(profiles(), LABELS)


@settings(max_examples=25)
@given(
    st.floats(1e-6, 1e6),
    st.floats(1.0, 1e12),
    st.floats(1e-300, 1e3),
    st.integers(0, 100),
    st.sampled_from(["none", "common", "standard"]),
    st.floats(-90.0, 90.0),
)
def test_networks_of_any_gain_answer_within_one(gain, rise, rate, seed, scaling, size):
    """tanh is bounded: outputs are in [-1, 1], the error at most 2, whatever the steps were."""
    network = GainAnnealedNetwork(
        initial_gain=gain,
        final_gain=min(gain * rise, 1e6),
        learning_rate=rate,
        epochs=25,
        scaling=scaling,
        random_state=seed,
    )
    vectors = profiles(seed) * 10.0**size
    outputs = network.fit(vectors, LABELS).outputs(np.concatenate([vectors, vectors * 1e6]))
    assert np.abs(outputs).max() <= 1.0
    assert max(network.loss_curve_) <= 4.0


def test_a_gain_of_a_million_is_a_step():
    """tanh(1e6 x / 2) is +-1 to rounding from |x| = 4e-5 on, and odd everywhere."""
    network = GainAnnealedNetwork(
        initial_gain=1e6, final_gain=1e6, learning_rate=1e-12, epochs=20, random_state=0
    ).fit(profiles(), LABELS)
    net = network.outputs(profiles())
    assert np.isfinite(net).all()
    assert all(np.isfinite(part).all() for part in network.weights_)


def templates(gain_sigma):
    rng = np.random.default_rng(2)
    signal = rng.random((3, 30))
    covariance = np.zeros((3, 2, 30))
    covariance[:, 0], covariance[:, 1, :-1] = 0.04, 0.01
    fitted = GaussianTemplates(gain_sigma=gain_sigma, floor_sigma=0.0).fit(
        signal + 5.0, covariance, list("abc"), floor=5.0
    )
    return fitted, signal


@settings(max_examples=40)
@given(st.floats(1e-3, 1e3), st.integers(1, 10**6))
def test_a_flat_prior_of_the_gain_takes_any_gain(gain, frames):
    """Along its own signal, (g - 1)^2 s'C's / (1 + sigma^2 s'C's) < (g - 1)^2 / sigma^2.

    A profile of another gain is thus less likely by (g - 1)^2 / 2 sigma^2 at most. The square of
    the distance, n (g - 1)^2 s'C's, is taken away again, and rounds by some ulp of itself.
    """
    fitted, signal = templates(1e6)
    at_mean, scaled = fitted.log_likelihood([signal[0] + 5.0, gain * signal[0] + 5.0], frames)[:, 0]
    distance = frames * (gain - 1) ** 2 * (signal[0] ** 2).sum() / 0.02
    allowed = (gain - 1) ** 2 / 2e12 + 64 * EPS * (distance + abs(at_mean) + frames * 1e6 * EPS)
    assert abs(at_mean - scaled) <= allowed + 1e-9


@pytest.mark.parametrize("gain_sigma", [0.0, 1.0, 1e6])
def test_profiles_of_nothing_have_a_posterior(gain_sigma):
    fitted, _ = templates(gain_sigma)
    for level in (0.0, 5.0, 1e6):
        posterior = fitted.posterior(np.full((1, 30), level), 16)
        assert posterior.sum() == pytest.approx(1.0, abs=8 * EPS)
        assert posterior.min() >= 0.0
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError, match=r"^X is (nan|inf), but must be a finite number"):
            fitted.posterior(np.full((1, 30), value), 16)
    with pytest.raises(ValueError, match=r"^X reaches 1e\+200, but its squared distance"):
        fitted.posterior(np.full((1, 30), 1e200), 16)


@pytest.mark.parametrize("classifier", EVERYONE)
def test_profiles_of_nothing_and_of_one_bin(classifier):
    """Zero vectors match nothing, one bin matches itself, NaN is refused."""
    learned = profile_vector(np.eye(60)[20:40])
    named = classifier().fit(learned, np.repeat(["a", "b", "c", "d"], 5))
    nothing = profile_vector(np.stack([np.zeros(60), np.full(60, 3.7)]))
    assert set(named.predict(nothing)) <= set("abcd")
    if classifier is not GainAnnealedNetwork:
        place, cosine = named.match(np.concatenate([nothing, learned]))
        assert place[:2].tolist() == [-1, -1]
        assert cosine[:2].tolist() == [0.0, 0.0]
        assert len(set(place[2:])) == 20
        np.testing.assert_allclose(cosine[2:], 1.0, atol=8 * EPS)
        with pytest.raises(ValueError, match="X has only zero vectors, but must have one"):
            classifier().fit(nothing, ["a", "b"])
    learned[3, 4] = np.nan
    for call in (named.predict, lambda some: classifier().fit(some, np.arange(20) % 2)):
        with pytest.raises(ValueError, match="Input X contains NaN"):
            call(learned)


@settings(max_examples=40)
@given(st.floats(-320.0, 307.0), st.sampled_from(EVERYONE[:2]))
def test_names_do_not_depend_on_the_size_of_vectors(size, classifier):
    """Directions are taken of vectors over their peak: 1e-308 and 1e308 alike, until digits go."""
    scale = 10.0 ** max(size, -300.0)
    named = classifier().fit(profiles(), LABELS)
    assert (named.predict(profiles() * scale) == LABELS).all()
    assert (classifier().fit(profiles() * scale, LABELS).predict(profiles()) == LABELS).all()


@pytest.mark.parametrize("scaling", ["none", "common", "standard"])
def test_subnormal_features_leave_the_network_finite(scaling):
    tiny = np.eye(5)[:4] * 5e-324
    network = GainAnnealedNetwork(epochs=20, scaling=scaling, random_state=0)
    assert np.isfinite(network.fit(tiny, list("abab")).outputs(tiny)).all()
