"""Normals drawn by compiled loops are numpy's, bit for bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ncti.normals import draw_normals


def test_numbers_are_those_of_numpy():
    """3,000,000: some 800 beyond the lowest layer, and 30,000 that are drawn again."""
    ours, theirs = np.random.default_rng(4), np.random.default_rng(4)
    found = np.empty((3, 1_000_000), dtype=np.float32)
    draw_normals(ours, found)
    np.testing.assert_array_equal(found, theirs.standard_normal(found.shape, dtype=np.float32))
    assert ours.bit_generator.state == theirs.bit_generator.state


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**64), st.lists(st.tuples(st.booleans(), st.integers(0, 40)), max_size=8))
def test_both_ways_alternate(seed, turns):
    """Also after an odd number of halves of words, and with numbers of other kinds between."""
    ours, theirs = np.random.default_rng(seed), np.random.default_rng(seed)
    for compiled, count in turns:
        found = np.empty(count, dtype=np.float32)
        if compiled:
            draw_normals(ours, found)
        else:
            ours.standard_normal(out=found, dtype=np.float32)
        np.testing.assert_array_equal(found, theirs.standard_normal(count, dtype=np.float32))
        assert ours.integers(0, 9) == theirs.integers(0, 9)  # takes half a word, or none


@pytest.mark.parametrize("kind", ["PCG64DXSM", "Philox", "MT19937", "SFC64"])
def test_other_generators_draw_themselves(kind):
    ours, theirs = (np.random.Generator(getattr(np.random, kind)(7)) for _ in range(2))
    found = np.empty(1000, dtype=np.float32)
    draw_normals(ours, found)
    np.testing.assert_array_equal(found, theirs.standard_normal(1000, dtype=np.float32))
