"""Profile and silhouette together in one cell, on made-up views, against sums by hand."""

import numpy as np
import pytest
from made_profiles import BINS, FLOOR, bands, dense
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from ncti.classify import GaussianTemplates
from sweeps.fusion import CHANNELS, _calibrate, _similarity, name_by_both, place_of
from sweeps.naming import Profiles

SHIPS, ASPECTS = 3, (0.0, 45.0)
VIEWS = SHIPS * len(ASPECTS)
FRAMES = (4, 16)
PHASES, WAYS, LOOKS, REPLICATES = 3, 2, 2, 2
FEATURES = 12
GAINS = (0.0, 0.7)
NUGGET = 0.02
SHIP = np.repeat(np.arange(SHIPS), len(ASPECTS))


def made(learned=None):
    """Profiles on floors of their own, whose noise leaves many in doubt."""
    rng = np.random.default_rng(0)
    expected = FLOOR * np.linspace(1, 3, VIEWS)[:, None] * np.ones(BINS)
    expected[:, 5:-5] += rng.exponential(size=(VIEWS, BINS - 10))
    deviation = 6.0 / np.sqrt(np.array(FRAMES))[:, None, None]
    averaged = expected + deviation * rng.standard_normal((REPLICATES, len(FRAMES), VIEWS, BINS))
    return Profiles(
        expected.astype(np.float32),
        averaged.astype(np.float32),
        np.ones((SHIPS, len(ASPECTS)), dtype=bool),
        np.array(ASPECTS),
        FRAMES,
        learned,
    )


def maps():
    """Templates whose phases differ, and silhouettes of two resolutions and numbers of frames."""
    rng = np.random.default_rng(1)
    templates = rng.random((1, VIEWS, FEATURES)) + 0.4 * rng.random((PHASES, VIEWS, FEATURES))
    noise = np.array([[0.9, 0.5], [0.7, 0.3]])[..., None, None]
    seen = templates[:, None, None] + noise * rng.standard_normal(
        (PHASES, WAYS, LOOKS, VIEWS, FEATURES)
    )
    seen[1, 0, 1, 2] = 0  # an empty one
    return templates.astype(np.float32), seen.astype(np.float32)


def cosine(a, b):
    a, b = a.astype(np.float64), b.astype(np.float64)
    return a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-30)


def density_by_hand(profiles, covariance, gain_sigma):
    """(replicate, frame_count, view, template) logarithms of a Gaussian's density."""
    variance = covariance[:, 0].mean(dtype=np.float64)
    shift = GaussianTemplates().floor_sigma ** 2 * variance * np.ones((BINS, BINS))
    samples = profiles.averaged.astype(np.float64)
    logs = np.empty((REPLICATES, len(FRAMES), VIEWS, VIEWS))
    for n, view in np.ndindex(len(FRAMES), VIEWS):
        mean = profiles.expected[view].astype(np.float64)
        signal = gain_sigma * (mean - mean[0])  # its own edge is its floor
        frame = (dense(covariance[view]) + NUGGET * variance * np.eye(BINS)) / FRAMES[n]
        gaussian = multivariate_normal(mean, frame + np.outer(signal, signal) + shift)
        logs[:, n, :, view] = gaussian.logpdf(samples[:, n])
    return logs


def similarity_by_hand(templates, seen):
    best = np.empty((*seen.shape[:-1], VIEWS))
    for place in np.ndindex(best.shape):
        others = [phase for phase in range(PHASES) if phase != place[0]]
        best[place] = max(cosine(seen[place[:4]], templates[p, place[4]]) for p in others)
    return best


def posterior_by_hand(scores, taught):
    """(ship,) probabilities of one row of scores: the mean density of a ship's templates."""
    of_ship = np.full(SHIPS, -np.inf)
    for s in np.unique(SHIP[taught]):
        own = scores[taught & (s == SHIP)]
        of_ship[s] = logsumexp(own) - np.log(len(own))
    return np.exp(of_ship - logsumexp(of_ship))


def sharpness_by_hand(similarity, taught, phase):
    """At which the ships of the other phases' silhouettes are as probable as they should be."""
    rows = [
        (similarity[p, view], SHIP[view])
        for p in range(PHASES)
        if p != phase
        for view in np.flatnonzero(taught)
    ]
    known = np.unique(SHIP[taught])
    miss = 1 / (len(rows) + 2)

    def surprise(log_sharpness):
        total = 0.0
        for scores, ship in rows:
            posterior = posterior_by_hand(np.exp(log_sharpness) * scores, taught)
            for s in known:
                wanted = 1 - miss if s == ship else miss / (len(known) - 1)
                total -= wanted * np.log(posterior[s])
        return total

    return np.exp(minimize_scalar(surprise, bounds=(-3, 7), method="bounded").x)


@pytest.mark.parametrize("unknown", [None, 1])
def test_by_hand(unknown):
    """Every gain, resolution, number of frames and draw; a ship that is learned, or is not."""
    learned = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    if unknown is not None:
        learned[unknown] = False
    taught = learned.ravel()
    profiles, (templates, seen) = made(learned), maps()
    covariance = bands(profiles, variance=36.0)
    answers = name_by_both(profiles, covariance, templates, seen, gain_sigma=GAINS, nugget=NUGGET)
    draws = max(REPLICATES, PHASES)
    shape = (len(CHANNELS), len(GAINS), WAYS, LOOKS, draws, len(FRAMES))
    assert answers["sharpness"].shape == shape
    assert answers["predicted"].shape == (*shape, SHIPS, len(ASPECTS))
    similarity = similarity_by_hand(templates, seen)
    logs = np.stack([density_by_hand(profiles, covariance, gain) for gain in GAINS])
    doubtful = []
    for k, m, d in np.ndindex(WAYS, LOOKS, draws):
        sharp = sharpness_by_hand(similarity[:, k, m], taught, d % PHASES)
        # The searches stop at 1e-5 of the logarithm, where the surprise is flat.
        found = answers["sharpness"][1, :, k, m, d]
        np.testing.assert_allclose(found, sharp, rtol=2e-4)
        np.testing.assert_array_equal(answers["sharpness"][0, :, k, m, d], 1)
        assert np.isnan(answers["sharpness"][2, :, k, m, d]).all()
        for g, n, view in np.ndindex(len(GAINS), len(FRAMES), VIEWS):
            profile = logs[g, d % REPLICATES, n, view]
            silhouette = sharp * similarity[d % PHASES, k, m, view]
            for c, scores in enumerate((profile, silhouette, profile + silhouette)):
                wanted = posterior_by_hand(scores, taught)
                place = (c, g, k, m, d, n, *divmod(view, len(ASPECTS)))
                # Of a sharpness that is off by 2e-4, times scores that differ by some 20.
                assert answers["probability"][place] == pytest.approx(wanted[SHIP[view]], abs=4e-3)
                if np.diff(np.sort(wanted))[-1] > 1e-2:
                    assert answers["predicted"][place] == wanted.argmax()
                right = answers["predicted"][place] == SHIP[view]
                assert answers["correct"][place] == right
                doubtful.append(0.05 < wanted.max() < 0.95)
    assert np.mean(doubtful) > 0.2


def test_profiles_alone_are_named_by_their_likelihood():
    """Whatever silhouettes there are: sharpness has no say."""
    profiles, (templates, seen) = made(), maps()
    covariance = bands(profiles, variance=36.0)
    answers = name_by_both(profiles, covariance, templates, seen, gain_sigma=GAINS, nugget=NUGGET)
    for g, gain in enumerate(GAINS):
        likelihood = GaussianTemplates(gain_sigma=gain, nugget=NUGGET)
        likelihood.fit(profiles.expected, covariance, SHIP, floor=profiles.expected[:, :1])
        for n, frames in enumerate(FRAMES):
            for d in range(max(REPLICATES, PHASES)):
                named = likelihood.predict(profiles.averaged[d % REPLICATES, n], frames)
                found = answers["predicted"][0, g, :, :, d, n].reshape(WAYS, LOOKS, VIEWS)
                np.testing.assert_array_equal(found, np.broadcast_to(named, found.shape))


def test_similarity_is_the_best_cosine_over_other_phases():
    templates, seen = maps()
    found = _similarity(seen, templates)
    # float32 products of a dozen numbers
    np.testing.assert_allclose(found, similarity_by_hand(templates, seen), atol=1e-6)
    # A silhouette's own phase has no say, any other has.
    for phase in range(PHASES):
        other = templates.copy()
        other[phase] = other[phase, :, ::-1]
        changed = np.any(_similarity(seen, other) != found, axis=(1, 2, 3, 4))
        np.testing.assert_array_equal(changed, np.arange(PHASES) != phase)


def test_a_phase_is_not_calibrated_on_itself():
    """A phase whose scores are all wrong does not lower its own weight, but that of the others."""
    ship = np.repeat([0, 1], 10)
    good = np.where(ship[:, None] == ship, 1.0, 0.0)
    scores = np.stack([-good, good, good])
    weights = _calibrate(scores, ship)
    assert weights[0] > 10 * weights[1]
    assert weights[1] == pytest.approx(weights[2])


def test_a_cell_goes_with_the_silhouettes_of_its_range():
    ranges, infrared_ranges = (100.0, 25.0), (25.0, 50.0, 100.0)
    for place, wanted in ((0, 2), (1, 0)):
        cell = {"pulse_width": 2, "range": place, "target_free_ifovs": 1}
        assert place_of(ranges, infrared_ranges, cell) == {
            "range": wanted,
            **{"coverage_rule": 0, "segmentation": 0, "inner_radius": 0, "interpolation": 0},
        }
