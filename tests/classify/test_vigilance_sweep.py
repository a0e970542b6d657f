"""The network from cosines alone, against the network itself."""

import warnings

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.classify import AdaptiveClusteringNetwork, Similarities, cluster

vectors = arrays(float, st.tuples(st.integers(1, 20), st.just(4)), elements=st.integers(-3, 3))


def assert_same(training, tests, order, *, vigilance, learning_rate, max_passes):
    network = AdaptiveClusteringNetwork(
        vigilance=vigilance, learning_rate=learning_rate, max_passes=max_passes
    )
    classes = np.arange(len(training)) % 3
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        network.fit(training[order], classes[order])
    similarities = Similarities.of(training, tests)
    found = cluster(
        similarities,
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
        order=order,
    )
    np.testing.assert_array_equal(found.labels[order], network.labels_)
    assert (found.passes, found.converged) == (network.n_passes_, network.converged_)
    np.testing.assert_array_equal(found.names(classes), network.category_labels_)
    category, similarity = network.match(tests)
    ours, cosine = found.match(similarities)
    np.testing.assert_array_equal(ours, category)
    # Each presentation rounds some ten numbers of order 1.
    rounding = 1e-15 * len(training) * found.passes
    np.testing.assert_allclose(cosine, similarity, atol=1e-14 + rounding)


@pytest.mark.parametrize("vigilance", [0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0])
@pytest.mark.parametrize("learning_rate", [0.01, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("max_passes", [1, 2, 50])
def test_it_is_the_network(vigilance, learning_rate, max_passes):
    """On random vectors of several lengths, zero ones among them, in random order."""
    rng = np.random.default_rng(3)
    groups = rng.normal(size=(6, 30))
    training = groups[rng.integers(0, 6, 80)] + 0.3 * rng.normal(size=(80, 30))
    training *= np.exp(rng.normal(size=(80, 1)))
    training[[5, 40]] = 0.0
    tests = groups[rng.integers(0, 6, 50)] + 0.5 * rng.normal(size=(50, 30))
    tests[7] = 0.0
    assert_same(
        training,
        tests,
        rng.permutation(80),
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=max_passes,
    )


@settings(max_examples=100, deadline=None)
@given(vectors, st.floats(0, 1), st.floats(0.01, 0.99))
def test_it_is_the_network_on_whatever_comes(training, vigilance, learning_rate):
    assume(training.any())
    # Where two cosines, or a cosine and the vigilance, are equal but for rounding, either answer
    # is right: nudged apart, as measured vectors are.
    nudged = training + 1e-3 * np.random.default_rng(0).normal(size=training.shape) * (
        training.any(axis=1, keepdims=True)
    )
    assert_same(
        nudged,
        nudged[::-1] + 0.1,
        np.arange(len(training)),
        vigilance=vigilance,
        learning_rate=learning_rate,
        max_passes=20,
    )


def test_first_names_are_those_of_the_members_presented_first():
    """Two tight groups; the one joined by a stray first takes the stray's class."""
    rng = np.random.default_rng(0)
    training = np.repeat(np.eye(3)[:2], 4, axis=0) + 0.01 * rng.normal(size=(8, 3))
    classes = np.array([0, 1, 1, 1, 2, 2, 0, 0])
    found = cluster(Similarities.of(training, training), vigilance=0.9)
    np.testing.assert_array_equal(found.labels, [0, 0, 0, 0, 1, 1, 1, 1])
    np.testing.assert_array_equal(found.first_names(classes, np.arange(8)), [0, 2])
    np.testing.assert_array_equal(found.names(classes), [1, 0])  # 0 and 2 are as many
    backwards = np.arange(8)[::-1]
    found = cluster(Similarities.of(training, training), vigilance=0.9, order=backwards)
    np.testing.assert_array_equal(found.first_names(classes, backwards), [0, 1])


def test_samples_left_out_of_the_order_are_not_learned():
    rng = np.random.default_rng(0)
    training = rng.normal(size=(9, 5))
    found = cluster(Similarities.of(training, training), vigilance=0.9, order=np.arange(4))
    alone = cluster(Similarities.of(training[:4], training[:4]), vigilance=0.9)
    np.testing.assert_array_equal(found.labels, [*alone.labels, *[-1] * 5])
    assert not found.weights[:, 4:].any()


def test_more_categories_than_samples_may_come_and_go():
    """A category may move away from its only vector, which then founds another one."""
    rng = np.random.default_rng(1)
    assert_same(
        rng.normal(size=(60, 3)),
        rng.normal(size=(5, 3)),
        np.arange(60),
        vigilance=0.97,
        learning_rate=0.9,
        max_passes=200,
    )


def test_zero_vectors_alone_are_refused():
    with pytest.raises(ValueError, match=r"^training has only zero vectors"):
        Similarities.of(np.zeros((3, 2)), np.ones((1, 2)))


@pytest.mark.parametrize(
    ("training", "tests", "named"),
    [
        (np.full((3, 2), np.nan), np.ones((1, 2)), "^training is nan"),
        (np.ones((3, 2)), np.full((1, 2), np.inf), "^tests is inf"),
        (np.ones((3, 2)), np.ones((1, 3)), r"^tests has shape \(1, 3\), but must be \(test, 2\)"),
        (np.ones((3, 2)), np.ones(2), r"^tests has shape \(2,\)"),
        (np.ones(3), np.ones((1, 3)), r"^training has shape \(3,\)"),
        (np.ones((0, 2)), np.ones((1, 2)), r"^training has shape \(0, 2\)"),
    ],
)
def test_vectors_that_are_none_are_refused(training, tests, named):
    with pytest.raises(ValueError, match=named):
        Similarities.of(training, tests)


def test_no_test_is_no_answer():
    found = Similarities.of(np.eye(3), np.ones((0, 3)))
    category, similarity = cluster(found, vigilance=0.9).match(found)
    assert category.shape == similarity.shape == (0,)


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"vigilance": 1.5}, "^vigilance is 1.5, but must be"),
        ({"vigilance": np.nan}, "^vigilance is nan"),
        ({"learning_rate": 0.0}, "^learning_rate is 0.0"),
        ({"max_passes": 2.5}, "^max_passes is 2.5"),
        ({"order": np.zeros(0, int)}, "^order holds no vector"),
        ({"order": [0, 3]}, "^order is 3, but must be a whole number at least 0 and below 3"),
        ({"order": [0, -1]}, "^order is -1, but must be"),
        ({"order": [0.7, 1]}, "^order is 0.7, but must be a whole number"),
        ({"order": [0, np.nan]}, "^order is nan"),
        ({"order": [2, 0, 2]}, "^order has 2 more than once, but samples must differ"),
        ({"order": [[0, 1]]}, r"^order has shape \(1, 2\), but must be \(sample,\)"),
    ],
)
def test_what_cannot_be_meant_is_refused(parameters, named):
    similarities = Similarities.of(np.eye(3), np.eye(3))
    with pytest.raises(ValueError, match=named):
        cluster(similarities, **{"vigilance": 0.9} | parameters)


def test_tests_may_come_later():
    """And again: what is shared between training vectors is not theirs."""
    rng = np.random.default_rng(5)
    training, tests, others = (rng.normal(size=(count, 6)) for count in (12, 5, 7))
    later = Similarities.of(training)
    assert (later.test.shape, later.answers.shape) == ((0, 12), (0,))
    for shown in (tests, others):
        at_once, found = Similarities.of(training, shown), later.to(shown)
        for name in ("directions", "lengths", "training", "test", "answers"):
            np.testing.assert_array_equal(getattr(found, name), getattr(at_once, name))
        assert found.training is later.training
    with pytest.raises(ValueError, match=r"tests has shape \(5, 4\), but must be \(test, 6\)"):
        later.to(tests[:, :4])
