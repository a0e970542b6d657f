"""The network computed from cosines alone agrees with the article's rule."""

import numpy as np
import pytest
from memory import peak_memory
from plain_network import plain_network

from ncti.classify import Similarities, cluster, clustering
from ncti.classify.directions import SAME_DIRECTION


@pytest.fixture(params=[clustering.BLOCK, 12], ids="block of {}".format, autouse=True)
def block(request, monkeypatch):
    """Set the number of vectors whose cosines are held at once: all of them, or some."""
    monkeypatch.setattr(clustering, "BLOCK", request.param)


def assert_is_plain_rule(training, tests, order, *, vigilance, learning_rate, max_passes):
    similarities = Similarities.of(training, tests)
    clusters = cluster(
        similarities,
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
        order=order,
    )
    presented = order[training[order].any(axis=1)]
    traces, assigned, passes, converged = plain_network(
        training[presented], min(vigilance, SAME_DIRECTION), learning_rate, max_passes
    )
    live, labels = np.unique(assigned, return_inverse=True)
    traces = traces[live]
    np.testing.assert_array_equal(clusters.labels[presented], labels)
    assert (clusters.labels[~training.any(axis=1)] == -1).all()
    assert (clusters.passes, clusters.converged) == (passes, converged)
    # Each presentation rounds some ten numbers of order 1.
    rounding = 1e-14 + 1e-15 * len(training) * passes
    np.testing.assert_allclose(
        clusters.category_vectors(similarities), traces, atol=rounding * np.abs(training).max()
    )
    norms = np.linalg.norm(tests, axis=1)[:, None] * np.linalg.norm(traces, axis=1)
    cosines = np.divide(tests @ traces.T, norms, where=norms > 0, out=np.zeros(norms.shape))
    category, cosine = clusters.match(similarities)
    answered = tests.any(axis=1)
    np.testing.assert_array_equal(category, np.where(answered, cosines.argmax(axis=1), -1))
    np.testing.assert_allclose(cosine, cosines.max(axis=1), atol=rounding)


@pytest.mark.parametrize("vigilance", [0.0, 0.8, 0.95, 1.0])
@pytest.mark.parametrize("learning_rate", [0.01, 0.5, 1.0])
@pytest.mark.parametrize("max_passes", [1, 50])
def test_clustering_follows_the_plain_rule(vigilance, learning_rate, max_passes):
    """Test random vectors of several lengths, with zero vectors, in random order."""
    rng = np.random.default_rng(3)
    groups = rng.normal(size=(6, 30))
    training = groups[rng.integers(0, 6, 80)] + 0.3 * rng.normal(size=(80, 30))
    training *= np.exp(rng.normal(size=(80, 1)))
    training[[5, 40]] = 0.0
    tests = groups[rng.integers(0, 6, 50)] + 0.5 * rng.normal(size=(50, 30))
    tests[7] = 0.0
    assert_is_plain_rule(
        training,
        tests,
        rng.permutation(80),
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
    )


def test_a_vector_must_exceed_the_vigilance():
    """A match equal to the vigilance is not enough."""
    assert cluster(Similarities.of(np.eye(2)), vigilance=0.0).labels.tolist() == [0, 1]
    assert cluster(Similarities.of(np.eye(2)), vigilance=-1e-300).labels.tolist() == [0, 0]


@pytest.mark.parametrize("features", [5, 30])
def test_samples_left_out_of_the_order_are_not_learned(features):
    """This holds for more samples than features, and for fewer."""
    rng = np.random.default_rng(0)
    training, tests = rng.normal(size=(9, features)), rng.normal(size=(7, features))
    all_nine, few = Similarities.of(training, tests), Similarities.of(training[:4], tests)
    clusters, of_few = (
        cluster(all_nine, vigilance=0.9, order=np.arange(4)),
        cluster(few, vigilance=0.9),
    )
    np.testing.assert_array_equal(clusters.labels, [*of_few.labels, *[-1] * 5])
    (category, cosine), (other, same) = clusters.match(all_nine), of_few.match(few)
    np.testing.assert_array_equal(category, other)
    np.testing.assert_allclose(cosine, same, atol=1e-13)


def test_clustering_memory_grows_linearly():
    def peak(count):
        vectors = np.random.default_rng(1).normal(size=(count, 12))
        found = []

        def form():
            found.append(cluster(Similarities.of(vectors), vigilance=0.95, max_passes=2))

        return peak_memory(form), len(found[0].weights)

    (small, few), (large, many) = peak(500), peak(4_000)
    assert many < 8 * few  # categories, whose cosines to a block are held
    assert large < 10 * small  # sixty-four times, if all were held against all
