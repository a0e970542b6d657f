"""Averages over several frame counts share one random walk that does not depend on the counts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from ncti.infrared import scene, shifted_images, thermal_images

LEVEL = 1e-3  # of each statistical test, over all that it compares (Bonferroni)
SHIP = np.zeros((7, 12), bool)
SHIP[2:4, 3:9] = True
DRAWERS = {
    "thermal": thermal_images,
    "shifted": shifted_images,
}
ANY_COUNT = st.integers(1, 70) | st.integers(1, 2**53)


def images(drawer, counts, rng, **parameters):
    return DRAWERS[drawer](SHIP, contrast=0.7, frame_counts=counts, rng=rng, **parameters)


@settings(max_examples=30, deadline=None)
@given(counts=st.lists(ANY_COUNT, min_size=1, max_size=6), seed=st.integers(0, 2**32 - 1))
@pytest.mark.parametrize("drawer", DRAWERS)
def test_image_does_not_depend_on_other_frame_counts(drawer, counts, seed):
    rng = np.random.default_rng(seed)
    together = images(drawer, counts, rng)
    for place, count in enumerate(counts):
        other = np.random.default_rng(seed)
        (single,) = images(drawer, [count], other)
        np.testing.assert_array_equal(together[place], single)
        # Later draws do not depend on the counts either.
        assert other.bit_generator.state == rng.bit_generator.state
        assert other.bit_generator.seed_seq.state == rng.bit_generator.seed_seq.state


def test_frames_are_white_standard_normal():
    """Frames 1 to 70, as differences of sums, pass KS and correlation tests at 1e-3.

    There are 40,000 pixels. These counts cover the bridge below 16, three shells above, and the
    seams between.
    """
    counts = np.arange(1, 71)
    _, averages = scene.draw_scene(
        np.zeros((200, 200), bool),
        contrast=0.0,
        frame_counts=counts,
        rng=np.random.default_rng(32),
        nedt=1.0,
        target_spread=0.0,
        sea_spread=0.0,
    )
    sums = averages.reshape(len(counts), -1) * counts[:, None]
    frames = np.diff(sums, axis=0, prepend=0.0)
    for frame in frames:
        assert stats.kstest(frame, "norm").pvalue > LEVEL / len(counts)
    products = frames @ frames.T / frames.shape[1]
    pairs = np.triu_indices(len(counts), k=1)
    z = products[pairs] * np.sqrt(frames.shape[1])
    assert np.abs(z).max() < stats.norm.isf(LEVEL / 2 / z.size)


def test_calls_with_one_generator_share_no_noise():
    """Two images of 40,000 pixels are uncorrelated by Fisher's z at 1e-3."""
    rng = np.random.default_rng(34)
    first, second = (
        thermal_images(
            np.zeros((200, 200), bool), contrast=1.0, frame_counts=[4], rng=rng, sea_spread=0.0
        ).ravel()
        for _ in range(2)
    )
    assert abs(np.corrcoef(first, second)[0, 1]) < stats.norm.isf(LEVEL / 2) / np.sqrt(first.size)
