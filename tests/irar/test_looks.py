"""Looks are gathered into the right pixels, and reduced to mean, median or fullest cluster."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from ncti.irar.looks import average, gather_looks, histogram_cluster_average, median

# Eighths and quarters lie on the pixels' edges often.
places = st.one_of(st.integers(-24, 64).map(lambda n: n / 8), st.floats(-3, 8), st.just(math.nan))
values = arrays(float, 12, elements=st.one_of(st.floats(-1e6, 1e6), st.just(math.nan)))


def plain_looks(row, column, rows, columns):
    """Return the looks of each pixel by the definition, sample by sample."""
    looks = {}
    for k, centre in enumerate(rows):
        for c in range(columns):
            inside = [
                (r, n)
                for n, (r, x) in enumerate(zip(row, column, strict=True))
                if centre - 0.5 <= r < centre + 0.5 and c - 0.5 <= x < c + 0.5
            ]
            looks[k, c] = [n for _, n in sorted(inside)]
    return looks


def listed(index):
    """Return the lists of looks in an index, and check that all gaps are at its end."""
    lists = {}
    for k, c in np.ndindex(index.shape[:2]):
        looks = index[k, c].tolist()
        count = sum(n >= 0 for n in looks)
        assert looks[count:] == [-1] * (len(looks) - count)
        lists[k, c] = looks[:count]
    return lists


@given(
    st.lists(st.tuples(places, places), max_size=40),
    st.sampled_from([np.arange(6), np.arange(0, 6, 1 / 8), np.arange(0, 6, 1 / 3), np.arange(0)]),
    st.integers(1, 5),
)
def test_gather_looks_matches_its_definition(samples, rows, columns):
    row, column = np.array(samples, dtype=float).reshape(-1, 2).T
    index = gather_looks(row, column, rows=rows, columns=columns)
    expected = plain_looks(row, column, rows, columns)
    assert listed(index) == expected
    assert index.shape == (len(rows), columns, max([1, *map(len, expected.values())]))


@given(
    values,
    st.lists(st.lists(st.integers(0, 11), max_size=5), min_size=1, max_size=6),
)
def test_average_and_median_ignore_missing_looks(samples, pixels):
    index = np.array([[(*looks, *[-1] * (5 - len(looks))) for looks in pixels]])
    means, middles = average(samples, index), median(samples, index)
    for c, looks in enumerate(pixels):
        known = [samples[n] for n in looks if not math.isnan(samples[n])]
        if known:
            # Sums of five, each rounded at 1e-16 of the largest term.
            assert means[0, c] == pytest.approx(np.mean(known), rel=1e-14, abs=1e-8)
            assert middles[0, c] == np.median(known)
        else:
            assert math.isnan(means[0, c]) and math.isnan(middles[0, c])


# Quarters tie often, and their differences are exact.
quarters = st.integers(-40, 40).map(lambda n: n / 4)
maybe = st.one_of(quarters, st.just(math.nan))


def plain_average(looks, window):
    """Return the average by its definition, window by window."""
    known = sorted(r for r in looks if not math.isnan(r))
    held = [[r for r in known if 0 <= r - begin <= window] for begin in known]
    if not held:
        return math.nan
    return np.mean(min(held, key=lambda h: (-len(h), h[-1] - h[0], h[0])))


shapes = array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=9)


@given(
    arrays(float, shapes.filter(lambda shape: shape[-1] > 0), elements=maybe),
    st.sampled_from([0.25, 1.0, 4.0, 30.0]),
)
def test_cluster_average_is_the_mean_of_the_fullest_window(ranges, window):
    averages = histogram_cluster_average(ranges, window=window)
    assert averages.shape == ranges.shape[:-1]
    flat = ranges.reshape(-1, ranges.shape[-1])
    expected = [plain_average(looks, window) for looks in flat]
    np.testing.assert_allclose(averages.ravel(), expected, rtol=0, atol=1e-13)
