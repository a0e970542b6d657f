"""Normals are numpy's ziggurat of words that their place in a stream alone decides."""

import ctypes
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from ncti.normals import draw_key, draw_places, draw_run, put_streams

GOLDEN = 0x9E3779B97F4A7C15
CELLS = np.array([[0, 0], [-1, 0], [0, -1], [1, 0], [0, 1], [3, 2**40]])
KEY = draw_key(np.random.default_rng(4))


def mixed(word):
    """Return a word after the finaliser of SplitMix64, in Python's whole numbers."""
    word %= 2**64
    word = (word ^ word >> 30) * 0xBF58476D1CE4E5B9 % 2**64
    word = (word ^ word >> 27) * 0x94D049BB133111EB % 2**64
    return word ^ word >> 31


def word(stream, number):
    return mixed(stream + (number + 1) * int(KEY[1]))


def streams(*, first=0, frames=1, cells=CELLS):
    out = np.empty((frames, len(cells)), dtype=np.uint64)
    put_streams(KEY, first, np.asarray(cells), out)
    return out


def run(stream, count, *, begin=0):
    out = np.empty((len(stream), 2 * stream.shape[1], count), dtype=np.float32)
    draw_run(KEY, stream, begin, out)
    return out


class Halves:
    """Generator of numpy's normals from 32 bits and, where they are too few, from a SplitMix64."""

    def __init__(self):
        self.half, self.state = None, 0
        halves = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_void_p)(lambda _: self.further())
        words = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_void_p)(lambda _: self.further())
        cast = ctypes.cast
        places = [None, *(cast(f, ctypes.c_void_p) for f in (words, halves, words, words))]
        bits = (ctypes.c_void_p * 5)(*places)
        new = ctypes.pythonapi.PyCapsule_New
        new.restype, new.argtypes = (
            ctypes.py_object,
            (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p),
        )
        self.kept = bits, halves, words
        capsule = new(ctypes.addressof(bits), b"BitGenerator", None)
        self.rng = np.random.Generator(SimpleNamespace(capsule=capsule, lock=threading.Lock()))

    def further(self):
        half, self.half = self.half, None
        if half is None:
            self.state = (self.state + GOLDEN) % 2**64
            half = mixed(self.state) >> 32
        return half

    def normal(self, half, state):
        self.half, self.state = half, state
        return self.rng.standard_normal(dtype=np.float32)


def test_normal_pairs_match_numpy_for_both_halves_of_a_word():
    """Of 100,000 some 25 are beyond the lowest layer, and 1,000 are drawn again or evaluated."""
    numpys, [[stream]] = Halves(), streams(cells=CELLS[:1]).tolist()
    words = [word(stream, number) for number in range(-50, 50_000)]
    expected = [
        (numpys.normal(w % 2**32, w), numpys.normal(w >> 32, w ^ (2**64 - 1))) for w in words
    ]
    pairs = run(np.array([[stream]], dtype=np.uint64), len(words), begin=-50)
    np.testing.assert_array_equal(pairs[0].T, expected)


def test_streams_are_keyed_by_frame_and_cell():
    numbers = streams(first=5, frames=2)
    for frame, row in enumerate(numbers.tolist(), start=5):
        of_frame = word(int(KEY[0]), frame)
        assert row == [word(word(of_frame, int(c)), int(r)) for c, r in CELLS]


def test_random_access_matches_sequential_draws():
    """They depend neither on the other places drawn nor on the order."""
    stream = streams(frames=3)
    number = np.array([7, 2, 2, 90, 0, 1, 40])
    first = np.array([0, 2, 2, 3, 5, 5, 7])
    out = np.empty((3, 2, 5), dtype=np.float32)
    draw_places(KEY, stream[:, 2:], first[2:], number, out)
    normals = run(stream, 100).reshape(3, len(CELLS), 2, 100)
    expected = [normals[:, i, :, n] for i, n in ((2, 2), (3, 90), (3, 0), (5, 1), (5, 40))]
    np.testing.assert_array_equal(out, np.stack(expected, axis=-1))


AXES = ("frame", "column", "cell", "quadrature", "pair")


@pytest.mark.parametrize("axis", AXES)
def test_neighbours_are_independent(axis):
    """400,000 normals, their squares and their signs do not correlate with their neighbours'."""
    level, side = 1e-4, np.arange(20)
    cells = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    drawn = run(streams(frames=10, cells=cells), 50)
    drawn = drawn.reshape(10, len(side), len(side), 2, 50).astype(float)
    drawn = np.moveaxis(drawn, AXES.index(axis), 0)
    a, b = drawn[:-1], drawn[1:]
    correlations = [
        np.corrcoef(transform(a).ravel(), transform(b).ravel())[0, 1] * np.sqrt(a.size)
        for transform in (np.asarray, np.square, np.sign)
    ]
    assert np.abs(correlations).max() < stats.norm.isf(level / 2 / len(correlations) / len(AXES))


def test_draws_are_normally_distributed():
    """A million pass Kolmogorov and Smirnov's test at 1e-4: the distribution is within 0.0023."""
    drawn = run(streams(frames=5), 17_000)
    assert stats.kstest(drawn.ravel(), "norm").pvalue > 1e-4
