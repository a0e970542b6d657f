"""Keys of many cells depend on the order of mixing and are distinguished as by a dictionary."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sweeps.engine.resolve.keys import concatenate, digest, fold, hash_texts, key_text, unique_keys

HALVES = st.integers(0, 2).map(lambda n: n * (2**63 - 1))


@given(st.lists(st.tuples(HALVES, HALVES), max_size=12))
def test_distinct_keys_are_those_of_a_dictionary(keys):
    """This also holds for keys of which only one half is equal."""
    first, number = unique_keys(np.array(keys, np.uint64).reshape(-1, 2))
    expected = {key: place for place, key in reversed([*enumerate(keys)])}
    assert first.tolist() == sorted(expected.values())
    assert [first[n] for n in number] == [expected[key] for key in keys]


def test_a_hash_is_blake2_of_the_text():
    (key,) = hash_texts(["pulse width"])
    assert key.astype("<u8").tobytes().hex() == digest("pulse width")
    assert len(key_text(key)) == 32 and len(hash_texts([])) == 0


def test_what_is_mixed_in_counts_and_its_order():
    """No two of 200,000 keys have an equal half; equal halves by chance occur once in 10^9 runs."""
    words = hash_texts(map(str, range(447)))
    pairs = np.repeat(words, len(words), axis=0)
    keys = pairs.copy()
    fold(keys, np.tile(words, (len(words), 1)))
    assert all(len(np.unique(half)) == len(keys) for half in keys.T)


def test_mixing_changes_half_of_the_bits():
    """Flipping any of 64 bits that are mixed in changes 45 to 55% of the bits of 1,000 keys."""
    keys = hash_texts(map(str, range(1000)))
    for bit in range(64):
        first, second = keys.copy(), keys.copy()
        fold(first, np.zeros(2, np.uint64))
        fold(second, np.full(2, 1 << bit, np.uint64))
        changed = np.bitwise_count(first ^ second).sum() / (128 * len(keys))
        assert abs(changed - 0.5) < 0.05


def test_arrays_that_are_joined_are_copied_only_if_several_are_filled():
    filled, none = np.arange(3), np.arange(0)
    assert concatenate(none, filled, none) is filled and concatenate(none, none) is none
    assert concatenate(filled, filled).tolist() == [0, 1, 2, 0, 1, 2]
