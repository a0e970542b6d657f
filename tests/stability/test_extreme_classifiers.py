"""Classifiers stay finite and correct for extreme parameters and sizes of vectors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti.classify import AdaptiveClusteringNetwork, CorrelationNeighbour, GainAnnealedNetwork

pytestmark = pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")

LABELS = np.repeat(["a", "b", "c", "d"], 8)
EVERYONE = (AdaptiveClusteringNetwork, CorrelationNeighbour, GainAnnealedNetwork)


def profiles(seed=0):
    """Return (32, 40) vectors whose cosines are all in (0, 1)."""
    return np.random.default_rng(seed).random((32, 40))


@settings(max_examples=25)
@given(
    st.floats(1e-6, 1e6),
    st.floats(1.0, 1e12),
    st.floats(1e-300, 1e3),
    st.integers(0, 100),
    st.sampled_from(["none", "common", "standard"]),
    st.floats(-90.0, 90.0),
)
def test_network_outputs_stay_within_one_for_any_gain(gain, rise, rate, seed, scaling, size):
    """As tanh is bounded, outputs are in [-1, 1] and errors at most 2 after any steps."""
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


@settings(max_examples=40)
@given(st.floats(-320.0, 307.0), st.sampled_from(EVERYONE[:2]))
def test_predictions_do_not_depend_on_vector_scale(size, classifier):
    """Vectors are scaled by their peak first, so sizes from 1e-300 to 1e307 give equal names."""
    scale = 10.0 ** max(size, -300.0)
    named = classifier().fit(profiles(), LABELS)
    assert (named.predict(profiles() * scale) == LABELS).all()
    assert (classifier().fit(profiles() * scale, LABELS).predict(profiles()) == LABELS).all()
