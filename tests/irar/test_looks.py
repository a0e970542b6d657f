"""Looks: each sample in the right pixel, and what averaging them gains."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ncti.irar.looks import average, gather_looks, looks_of, median

# Eighths and quarters lie on the pixels' edges often.
places = st.one_of(st.integers(-24, 64).map(lambda n: n / 8), st.floats(-3, 8), st.just(math.nan))
values = arrays(float, 12, elements=st.one_of(st.floats(-1e6, 1e6), st.just(math.nan)))


def plain_looks(row, column, rows, columns):
    """The definition, sample by sample."""
    found = {}
    for k, centre in enumerate(rows):
        for c in range(columns):
            inside = [
                (r, n)
                for n, (r, x) in enumerate(zip(row, column, strict=True))
                if centre - 0.5 <= r < centre + 0.5 and c - 0.5 <= x < c + 0.5
            ]
            found[k, c] = [n for _, n in sorted(inside)]
    return found


def listed(index):
    """Lists of looks out of an index, whose gaps must all be at its end."""
    found = {}
    for k, c in np.ndindex(index.shape[:2]):
        looks = index[k, c].tolist()
        count = sum(n >= 0 for n in looks)
        assert looks[count:] == [-1] * (len(looks) - count)
        found[k, c] = looks[:count]
    return found


def scanned(lines, samples, overscan, seed=0):
    """Places of samples that climb as a flight does, uneven by a tenth of a pixel."""
    jitter = np.random.default_rng(seed).uniform(-0.05, 0.05, (2, lines, samples))
    row = (np.arange(lines)[:, None] + 0.5) / overscan - 0.5 + jitter[0] / overscan
    return row, np.arange(samples) + jitter[1]


@given(
    st.lists(st.tuples(places, places), max_size=40),
    st.sampled_from([np.arange(6), np.arange(0, 6, 1 / 8), np.arange(0, 6, 1 / 3), np.arange(0)]),
    st.integers(1, 5),
)
def test_looks_are_those_of_the_definition(samples, rows, columns):
    row, column = np.array(samples, dtype=float).reshape(-1, 2).T
    index = gather_looks(row, column, rows=rows, columns=columns)
    expected = plain_looks(row, column, rows, columns)
    assert listed(index) == expected
    assert index.shape == (len(rows), columns, max([1, *map(len, expected.values())]))


def test_output_pixels_share_no_sample_and_lose_none():
    row, column = scanned(lines=240, samples=50, overscan=9.7)
    column = column + 0.37  # across the pixels' edges
    index = gather_looks(row, column, rows=np.arange(25), columns=51)
    held = index[index >= 0]
    assert len(held) == len(set(held.tolist()))
    assert sorted(held.tolist()) == list(range(row.size))


def test_a_place_next_to_an_edge_is_on_its_own_side():
    below = math.nextafter(0.5, 0.0)  # which rounds up to 1 when half is added
    index = gather_looks([below, 0.5], [0, 0], rows=np.arange(2), columns=1)
    assert index[:, 0, 0].tolist() == [0, 1]
    index = gather_looks([0, 0], [below, 0.5], rows=np.arange(2), columns=2)
    assert index[0, :, 0].tolist() == [0, 1]


def test_windows_at_line_rate_overlap():
    row, column = scanned(lines=120, samples=4, overscan=12)
    index = gather_looks(row, column, rows=np.arange(1, 8, 1 / 12), columns=4)
    assert (index >= 0).sum(axis=-1).min() >= 11 and index.shape[-1] <= 13
    shared = np.intersect1d(index[0, 0], index[1, 0])
    assert len(shared[shared >= 0]) >= 10


def test_samples_without_a_place_are_left_out():
    row, column = scanned(lines=40, samples=5, overscan=8)
    placed = np.random.default_rng(1).random(row.shape) < 0.7
    row = np.where(placed, row, math.nan)
    index = gather_looks(row, column, rows=np.arange(5), columns=5)
    assert sorted(index[index >= 0].tolist()) == np.flatnonzero(placed).tolist()


def test_values_stand_where_the_index_says():
    index = np.array([[[2, 0], [1, -1]]])
    np.testing.assert_array_equal(
        looks_of([[5.0], [6.0], [7.0]], index), [[[7.0, 5.0], [6.0, math.nan]]]
    )
    assert np.isnan(looks_of([], np.full((1, 1, 1), -1))).all()


@given(
    values,
    st.lists(st.lists(st.integers(0, 11), max_size=5), min_size=1, max_size=6),
)
def test_average_and_median_are_those_of_the_looks_there_are(samples, pixels):
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


@pytest.mark.parametrize("overscan", [8, 10, 12])
def test_independent_speckle_gains_the_root_of_the_looks(overscan):
    """SNR over 3,000 pixels within 5 %: 3.3 standard errors at N = 8, a level of 1e-3.

    The relative standard error of a standard deviation is sqrt((kurtosis - 1) / 4 n), and the
    kurtosis of N averaged exponentials 3 + 6 / N.
    """
    row, column = scanned(lines=60 * overscan, samples=50, overscan=overscan)
    index = gather_looks(row, column, rows=np.arange(60), columns=50)
    assert (index >= 0).all() and index.shape[-1] == overscan
    speckle = np.random.default_rng(overscan).exponential(size=row.shape)
    image = average(speckle, index)
    assert image.size == 3000
    gain = (image.mean() / image.std()) / (speckle.mean() / speckle.std())
    assert gain == pytest.approx(math.sqrt(overscan), rel=0.05)


def test_speckle_that_does_not_decorrelate_gains_nothing():
    """With one value for all looks of a pixel the SNR stays that of an exponential's 3,000."""
    row, column = scanned(lines=600, samples=50, overscan=10)
    index = gather_looks(row, column, rows=np.arange(60), columns=50)
    static = np.random.default_rng(4).exponential(size=(60, 50))
    image = average(np.repeat(static, 10, axis=0), index)
    np.testing.assert_allclose(image, static, rtol=1e-14)
    assert image.mean() / image.std() == pytest.approx(1.0, rel=0.1)  # 3.9 standard errors


def test_inputs_are_left_alone():
    row, column = scanned(lines=40, samples=5, overscan=8)
    before = row.copy(), column.copy()
    index = gather_looks(row, column, rows=np.arange(5), columns=5)
    kept = index.copy()
    average(row, index), median(row, index)
    np.testing.assert_array_equal((row, column), before)
    np.testing.assert_array_equal(index, kept)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"column": [0.0]}, r"column has shape \(1,\)"),
        ({"rows": [1, 0]}, r"rows is \[1\. 0\.\], but must be ascending"),
        ({"rows": [0, math.nan]}, "rows is nan"),
        ({"columns": 0}, "columns is 0"),
        ({"columns": 2.5}, r"columns is 2\.5"),
    ],
)
def test_bad_input_is_named(change, message):
    given = {"row": [0.0, 1.0], "column": [0.0, 1.0], "rows": [0, 1], "columns": 2} | change
    with pytest.raises(ValueError, match=message):
        gather_looks(given.pop("row"), given.pop("column"), **given)


def test_an_index_of_other_samples_is_refused():
    with pytest.raises(ValueError, match="index is 2 at most, but must be below the 2 values"):
        average([1.0, 2.0], np.array([[[2]]]))
