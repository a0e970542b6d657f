"""A network trained on 124 noiseless profiles reproduces the article's Table 2."""

import numpy as np
import pytest
from scipy import stats

import ncti.ships
from ncti.classify import GainAnnealedNetwork
from ncti.features import profile_vector
from ncti.ladar import cumulative_average, expected_profile, range_extent, sample_frames
from ncti.render import range_image

SHIPS = ("duncan", "horne", "spruance", "texas")
ASPECTS = np.arange(0, 91, 3)
group_of_view = np.tile(np.digitize(ASPECTS, [28.5, 58.5]), len(SHIPS))
class_of_view = 3 * np.repeat(np.arange(len(SHIPS)), len(ASPECTS)) + group_of_view
VIEWS = np.bincount(group_of_view)
FRAME_COUNTS = (32, 16, 8, 4)

# The article's Table 2, 30 ns: aspects 0-27, 30-57 and 60-90 deg.
TRAINING = np.array([1.00, 0.93, 0.43])
TESTING = np.array([[0.83, 0.60, 0.39], [0.78, 0.40, 0.34], [0.63, 0.20, 0.25], [0.48, 0.25, 0.23]])


@pytest.fixture(scope="module")
def vectors():
    """Return profile vectors, (view, bin) without noise and (frame_count, view, bin) averaged."""
    expected, averaged = [], []
    signal = {"pulse_width": 30e-9, "cnr": 10**3.2, "target_free_ifovs": 4000}
    for i, ship in enumerate(SHIPS):
        mesh = ncti.ships.load(ship)
        for aspect in ASPECTS:
            image = range_image(mesh, aspect=float(aspect), depression=3.84, engine="auto")
            extent = range_extent(image, slant_range=100e3)
            rng = np.random.default_rng([i, aspect])
            frames = sample_frames(extent, frame_count=max(FRAME_COUNTS), rng=rng, **signal)
            expected.append(expected_profile(extent, **signal))
            averaged.append(cumulative_average(frames, FRAME_COUNTS))
    return profile_vector(expected), profile_vector(np.stack(averaged, axis=1))


def right(network, vectors):
    """Return the share of views whose ship and aspect group are both right, (..., group)."""
    answers = network.predict(vectors.reshape(-1, vectors.shape[-1]))
    hits = answers.reshape(vectors.shape[:-1]) == class_of_view
    groups = [hits[..., group_of_view == group] for group in range(3)]
    return np.stack([group.mean(axis=-1) for group in groups], axis=-1)


def distance(ours, theirs):
    """Return the sum of squared differences over the sampling variance of two samples."""
    share = np.clip((ours + theirs) / 2, 0.5 / VIEWS, 1 - 0.5 / VIEWS)
    return np.sum((ours - theirs) ** 2 / (2 * share * (1 - share) / VIEWS))


# Chi-square of so many cells at 1e-3, as though they were independent. They are not: the
# averages are prefixes of the same frames. The level is thus nominal.
BOUND = {cells: stats.chi2.isf(1e-3, cells) for cells in (TRAINING.size, TESTING.size)}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("annealing", [True, False])
def test_it_reproduces_table_2_within_its_sampling_noise(vectors, annealing, seed):
    expected, averaged = vectors
    network = GainAnnealedNetwork(annealing=annealing, random_state=seed).fit(
        expected, class_of_view
    )
    assert network.converged_
    assert distance(right(network, expected), TRAINING) < BOUND[TRAINING.size]
    assert distance(right(network, averaged), TESTING) < BOUND[TESTING.size]
