"""A frame does not depend on how many frames are drawn with it: equality bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ncti.ladar import RangeExtent, frames, sample_frames

COUNTS = st.integers(1, 100)


def extent(*, bins, ifovs, bin_width=1.0):
    """IFOVs filled over some bins each, as by a sloping deck."""
    rng = np.random.default_rng(bins)
    fraction = np.zeros((ifovs, bins))
    for row in fraction:
        length = int(rng.integers(1, 1 + min(bins, 40)))
        start = int(rng.integers(0, 1 + bins - length))
        row[start : start + length] = rng.random(length) / length
    cell = np.stack([np.arange(ifovs), np.zeros(ifovs, int)], axis=1)
    down_range = (np.arange(bins) - (bins - 1) / 2) * bin_width
    return RangeExtent(fraction, down_range, bin_width, cell, 150e-6, 1e5)


def drawn(seen, count, *, rng=None, target_free_ifovs=0, receiver="full_profile"):
    return sample_frames(
        seen,
        pulse_width=30e-9,
        cnr=1e3,
        frame_count=count,
        rng=np.random.default_rng(11) if rng is None else rng,
        target_free_ifovs=target_free_ifovs,
        receiver=receiver,
    )


# 500 bins: there the last bit of a product of 4 rows is not that of 32, and of 1 row anywhere.
@settings(max_examples=25, deadline=None)
@given(counts=st.tuples(COUNTS, COUNTS), target_free_ifovs=st.sampled_from([0, 3, 100, 4000]))
@example(counts=(1, 33), target_free_ifovs=4000)
@pytest.mark.parametrize("bins", [1, 7, 250, 500])
def test_fewer_frames_are_the_first_of_more(bins, counts, target_free_ifovs):
    few, many = sorted(counts)
    seen = extent(bins=bins, ifovs=3)
    first, all_ = (drawn(seen, count, target_free_ifovs=target_free_ifovs) for count in (few, many))
    np.testing.assert_array_equal(first, all_[:few])


@pytest.mark.parametrize("receiver", ["full_profile", "first_pulse", "peak_pulse"])
@pytest.mark.parametrize("bin_width", [0.5, 1.0])
def test_every_number_up_to_two_blocks_is_a_prefix(receiver, bin_width):
    seen = extent(bins=500, ifovs=2, bin_width=bin_width)
    most = 2 * frames.FRAMES_AT_ONCE + 1
    # Only the full profile draws many target-free IFOVs as their sum.
    others = {"receiver": receiver, "target_free_ifovs": 120 if receiver == "full_profile" else 2}
    whole = drawn(seen, most, **others)
    for count in (*range(1, 6), *range(30, 36), most - 1):
        np.testing.assert_array_equal(drawn(seen, count, **others), whole[:count])


@pytest.mark.parametrize("at_once", [1, 2, 5, 31])
def test_so_many_ifovs_that_few_frames_are_computed_at_once(at_once, monkeypatch):
    seen = extent(bins=250, ifovs=3)
    whole = drawn(seen, 40)
    per_frame = per_frame_of(seen)
    monkeypatch.setattr(frames, "NORMALS_AT_ONCE", at_once * per_frame + per_frame // 2)
    most = drawn(seen, 40)
    for count in range(1, 40, 3):
        np.testing.assert_array_equal(drawn(seen, count), most[:count])
    # The normals are the same ones, whatever the size of a block: float32 rounding is left.
    np.testing.assert_allclose(most, whole, rtol=1e-4)


def per_frame_of(seen):
    """Normals that one frame takes."""
    taken = []

    class Counting(np.random.Generator):
        def standard_normal(self, size=None, dtype=np.float64, out=None):
            taken.append(out.size)
            return super().standard_normal(size, dtype, out)

    drawn(seen, 1, rng=Counting(np.random.PCG64(0)))
    return sum(taken)


@given(first=st.sampled_from([32, 64]), then=st.integers(1, 40))
@settings(max_examples=20, deadline=None)
def test_a_generator_goes_on_where_the_last_frame_ended(first, then):
    """No normal is drawn that no frame needs: whole blocks can be followed by more."""
    seen, rng = extent(bins=64, ifovs=2), np.random.default_rng(11)
    apart = [drawn(seen, count, rng=rng, target_free_ifovs=200) for count in (first, then)]
    together = drawn(seen, first + then, target_free_ifovs=200)
    np.testing.assert_array_equal(np.concatenate(apart), together)


@pytest.mark.parametrize("pulse_width", [10e-9, 30e-9, 50e-9])
def test_bins_outside_the_target_add_nothing(pulse_width):
    """Speckle drawn in every bin has the covariance of that on occupied ones, up to rounding."""
    seen = extent(bins=250, ifovs=4)
    everywhere = replace(seen, fraction=np.maximum(seen.fraction, 1e-60))
    signal = {"pulse_width": pulse_width, "cnr": 1e3, "target_free_ifovs": 0}
    for few, all_ in zip(
        *(frames._field_factors(one, **signal) for one in (seen, everywhere)), strict=True
    ):
        assert len(few) < len(all_)
        plain = all_.astype(float).T @ all_
        np.testing.assert_allclose(few.astype(float).T @ few, plain, atol=1e-12 * plain.max())
