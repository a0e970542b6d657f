"""Comparisons in blocks of samples agree with the plain computation, in less memory."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from memory import peak_memory

from ncti.classify import CorrelationNeighbour
from ncti.classify.baselines import TIE_TOLERANCE
from ncti.classify.blocks import ROWS, row_blocks
from ncti.classify.directions import unit_vectors


@given(count=st.integers(0, 3000), half=st.integers(1, 500))
def test_row_blocks_cover_rows_once_without_singletons(count, half):
    blocks = list(row_blocks(count, 2 * half))
    assert [row for block in blocks for row in range(block.start, block.stop)] == [*range(count)]
    sizes = [block.stop - block.start for block in blocks]
    assert all(size % 2 == 0 for size in sizes[:-1])
    assert all(2 <= size <= 2 * half + 1 for size in sizes) or count <= 1


@settings(deadline=None, max_examples=40)
@given(
    samples=st.one_of(st.integers(1, 40), st.integers(ROWS - 3, 2 * ROWS + 3)),
    templates=st.integers(2, 60),
    features=st.integers(2, 300),
    hidden=st.sampled_from(["none", "all alike", "each its own"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_blocked_matches_equal_plain_cosines(samples, templates, features, hidden, seed):
    rng = np.random.default_rng(seed)
    X, T = rng.standard_normal((samples, features)), rng.standard_normal((templates, features))
    T[-1] = T[0]  # equal matches
    X[rng.random(samples) < 0.1] = 0.0
    exclude = {
        "none": np.False_,
        "all alike": rng.random(templates) < 0.3,
        "each its own": rng.random((samples, templates)) < 0.7,
    }[hidden]
    cosines = np.clip(unit_vectors(X)[0] @ unit_vectors(T)[0].T, -1.0, 1.0)
    cosines[np.broadcast_to(exclude, cosines.shape)] = -np.inf
    best = cosines.max(axis=1)
    plain = (cosines >= best[:, None] - TIE_TOLERANCE).argmax(axis=1)
    none = (best == -np.inf) | ~X.any(axis=1)
    template, similarity = (
        CorrelationNeighbour().fit(T, np.arange(templates)).match(X, exclude=exclude)
    )
    np.testing.assert_array_equal(template, np.where(none, -1, plain))
    expected = np.where(none, 0.0, cosines[np.arange(samples), plain])
    # Rounding of a sum of as many products.
    atol = 2 * features * np.finfo(float).eps
    np.testing.assert_allclose(similarity, expected, rtol=0, atol=atol)


@pytest.mark.parametrize("hidden", [False, True])
def test_match_memory_grows_linearly(hidden):
    def peak(count):
        vectors = np.random.default_rng(1).standard_normal((count, 12))
        neighbour = CorrelationNeighbour().fit(vectors, np.arange(count) % 5)
        exclude = np.arange(count) % 3 == 0 if hidden else False
        return peak_memory(lambda: neighbour.match(vectors, exclude=exclude))

    small, large = peak(2_000), peak(8_000)
    # Sixteen times as many cosines would be half a gigabyte; those of a block grow fourfold.
    assert large < 5 * small
    assert large < 8_000**2
