"""Averages over several frame counts: one walk, of which no step depends on what is asked for."""

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


def noise(counts, *, seed, side=200, nedt=1.0):
    """Noise of each average over a window of sea, (count, pixel)."""
    _, drawn = scene.draw_scene(
        np.zeros((side, side), bool),
        contrast=0.0,
        frame_counts=counts,
        rng=np.random.default_rng(seed),
        nedt=nedt,
        target_spread=0.0,
        sea_spread=0.0,
    )
    return drawn.reshape(len(counts), -1)


@settings(max_examples=60, deadline=None)
@given(counts=st.lists(ANY_COUNT, min_size=1, max_size=6), seed=st.integers(0, 2**32 - 1))
@pytest.mark.parametrize("drawer", DRAWERS)
def test_an_image_does_not_depend_on_its_company(drawer, counts, seed):
    rng = np.random.default_rng(seed)
    together = images(drawer, counts, rng)
    for place, count in enumerate(counts):
        other = np.random.default_rng(seed)
        (alone,) = images(drawer, [count], other)
        np.testing.assert_array_equal(together[place], alone)
        # Whatever is drawn next does not depend on it either.
        assert other.bit_generator.state == rng.bit_generator.state
        assert other.bit_generator.seed_seq.state == rng.bit_generator.seed_seq.state


@pytest.mark.parametrize("drawer", DRAWERS)
def test_nor_do_many(drawer):
    every = range(1, 41)
    together, alone = (
        [images(drawer, counts, np.random.default_rng(5)) for counts in groups]
        for groups in ([list(every)], [[count] for count in every])
    )
    np.testing.assert_array_equal(together[0], np.concatenate(alone))


COUNTS = (1, 3, 4, 10, 16, 24, 64)


def test_joint_law_of_the_sums():
    """Means and all 28 covariances over 40,000 pixels, z-tests at 1e-3.

    The sums over the first M and N frames have covariance min(M, N).
    """
    sums = noise(COUNTS, seed=31) * np.array(COUNTS)[:, None]
    pixels = sums.shape[1]
    expected = np.minimum.outer(COUNTS, COUNTS).astype(float)
    variances = np.diagonal(expected)
    z_mean = sums.mean(axis=1) / np.sqrt(variances / pixels)
    # Wick: Var(x y) = Cov^2 + Var x Var y.
    error = np.sqrt((expected**2 + np.outer(variances, variances)) / pixels)
    z_covariance = (sums @ sums.T / pixels - expected) / error
    z = np.concatenate([z_mean, z_covariance[np.triu_indices(len(COUNTS))]])
    assert np.abs(z).max() < stats.norm.isf(LEVEL / 2 / z.size)


def test_every_frame_is_one_white_normal():
    """Frames 1 to 70, differences of sums: KS of each, and all pairs uncorrelated, at 1e-3.

    40,000 pixels. It covers the bridge below 16, three shells above, and the seams between.
    """
    counts = np.arange(1, 71)
    sums = noise(counts, seed=32) * counts[:, None]
    frames = np.diff(sums, axis=0, prepend=0.0)
    for frame in frames:
        assert stats.kstest(frame, "norm").pvalue > LEVEL / len(counts)
    products = frames @ frames.T / frames.shape[1]
    pairs = np.triu_indices(len(counts), k=1)
    z = products[pairs] * np.sqrt(frames.shape[1])
    assert np.abs(z).max() < stats.norm.isf(LEVEL / 2 / z.size)


@pytest.mark.parametrize("counts", [(1, 16), (5, 24), (64, 10**12)])
def test_whole_increments_are_normal(counts):
    """KS of the step from one sum to another over 40,000 pixels at 1e-3."""
    first, last = noise(counts, seed=33) * np.array(counts)[:, None]
    step = (last - first) / np.sqrt(counts[1] - counts[0])
    assert stats.kstest(step, "norm").pvalue > LEVEL / 3
    # The past tells nothing of it.
    correlation = np.corrcoef(step, first)[0, 1]
    assert abs(correlation) < stats.norm.isf(LEVEL / 2 / 3) / np.sqrt(step.size)


def test_the_average_of_sixteen_is_the_generators_own():
    """By the definition: a normal a pixel for the sea, then one for the sum of 16 frames."""
    rng = np.random.default_rng(3)
    sea, total = rng.standard_normal((2, 30 * 40)).reshape(2, 30, 40)
    ours = thermal_images(
        np.zeros((30, 40), bool), contrast=1.0, frame_counts=[16], rng=np.random.default_rng(3)
    )
    np.testing.assert_array_equal(ours[0], 0.1 * sea + 4 * total * (0.4 / 16))


@pytest.mark.parametrize(
    ("counts", "drawn"),
    [
        ([16], []),
        ([8], [8]),
        ([1], [8, 4, 2, 1]),
        ([3, 1], [8, 4, 2, 1, 3]),
        ([64], [32, 64]),
        ([24], [32, 24]),
        ([40, 16, 24], [32, 24, 64, 48, 40]),
        ([2**40], [2**k for k in range(5, 41)]),
    ],
)
def test_only_the_way_to_a_count_is_drawn(counts, drawn, monkeypatch):
    keys = []

    class Sequence(np.random.SeedSequence):
        def __init__(self, entropy=None, *, spawn_key=(), pool_size=4):
            keys.append(spawn_key[-1])
            super().__init__(entropy, spawn_key=spawn_key, pool_size=pool_size)

    rng = np.random.default_rng(0)
    monkeypatch.setattr(scene.np.random, "SeedSequence", Sequence)
    monkeypatch.setattr(scene, "_family", lambda rng: np.random.SeedSequence(1, spawn_key=(0,)))
    images("thermal", counts, rng)
    assert keys[1:] == drawn


def test_calls_with_one_generator_share_no_noise():
    """Fisher's z at 1e-3 of 40,000 pixels of a sum that has a generator of its own."""
    rng = np.random.default_rng(34)
    first, second = (
        thermal_images(
            np.zeros((200, 200), bool), contrast=1.0, frame_counts=[4], rng=rng, sea_spread=0.0
        ).ravel()
        for _ in range(2)
    )
    assert abs(np.corrcoef(first, second)[0, 1]) < stats.norm.isf(LEVEL / 2) / np.sqrt(first.size)


def test_the_sea_is_one_whatever_is_asked_for():
    quiet = [
        images("thermal", counts, np.random.default_rng(2), nedt=0.0)
        for counts in ((4,), (4, 16), (100,))
    ]
    for image in (quiet[1][0], quiet[1][1], quiet[2][0]):
        np.testing.assert_array_equal(image, quiet[0][0])


@pytest.mark.parametrize("drawer", DRAWERS)
def test_a_generator_that_cannot_spawn_is_refused(drawer):
    legacy = np.random.Generator(np.random.RandomState(5)._bit_generator)
    with pytest.raises(ValueError, match=r"^rng has a MT19937 without a seed sequence, but must"):
        images(drawer, [16], legacy)
