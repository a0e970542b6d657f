"""Profiles of many views, their noise and likelihoods agree with the library's exact ones."""

import math

import numpy as np
import pytest
import trimesh

from ncti.classify import GaussianTemplates
from ncti.ladar import expected_profile, frame_moments, noise_floor, range_extent
from ncti.ladar.pulse import Pulse
from studies.operate.profiles import (
    LOADING,
    RAYLEIGH,
    ProfileMatch,
    Radar,
    correlations,
    frame_noise,
    signatures,
)
from studies.operate.survey import draw_views, seen_views

PULSE = {"pulse_width": 30e-9, "bin_width": 1.0}
BINS, FOOTPRINT = 120, 7.5


def block():
    hull = trimesh.creation.box((60, 9, 8)).apply_translation((0, 0, 4))
    mast = trimesh.creation.box((4, 4, 20)).apply_translation((10, 0, 12))
    return trimesh.util.concatenate([hull, mast])


VIEWS = draw_views(block(), [0.0, 35.0, 80.0], spacing=0.5)
PLACES = [(0.1, 0.2), (0.7, 0.4), (0.5, 0.9)]


def extents():
    geometry = {"slant_range": 100e3, "ifov": FOOTPRINT / 100e3, "window": float(BINS)}
    return [
        range_extent(view, shift=place, **geometry)
        for view, place in zip(VIEWS, PLACES, strict=True)
    ]


def made(cnr):
    arguments = [VIEWS[-1], *VIEWS], [PLACES[-1], *PLACES]
    views = seen_views(*arguments, footprint=FOOTPRINT, window=BINS)
    options = {"pulse_width": [30e-9], "bin_width": 1.0, "bins": BINS, "learned": 1}
    arrays = signatures(views, cnr=[cnr], **options)
    assert np.array_equal(arrays["power"][0, 0, 0], arrays["power"][0, 0, -1])
    return arrays["excess"][0, 0, 1:], arrays["power"][0, 0, 1:], arrays["ifovs"][0, 0]


@pytest.mark.parametrize("cnr", [0.0, 3.0, 10**3.2])
def test_signatures_are_expected_profiles_less_the_floor(cnr):
    excess, _, ifovs = made(cnr)
    for profile, extent, count in zip(excess, extents(), ifovs, strict=True):
        exact = expected_profile(extent, pulse_width=30e-9, cnr=cnr) - count * noise_floor()
        # Fractions and excess in single precision: 2^-24 of the largest of some 10 terms.
        assert np.allclose(profile, exact, rtol=0, atol=1e-6 * max(exact.max(), 1.0))


def test_noise_has_the_variance_of_frames_and_nearly_their_covariance():
    cnr, free, draws = 10**2.9, 300, 4000
    _, power, ifovs = made(cnr)
    normals = np.random.default_rng(3).standard_normal((draws, 2, BINS))
    for row, count, extent in zip(power, ifovs, extents(), strict=True):
        views = np.broadcast_to(row, (draws, BINS)), np.full(draws, free + count)
        noise = frame_noise(*views, normals, Radar(cnr=cnr, **PULSE))
        _, exact = frame_moments(extent, pulse_width=30e-9, cnr=cnr, target_free_ifovs=free)
        # The closed form of its covariance has the exact diagonal, and off it correlations of
        # target and noise instead of one for each IFOV.
        target, noise_alone = correlations(Pulse(30e-9, 1.0), BINS)
        amplitude = np.sqrt(RAYLEIGH * cnr * row.astype(float))
        still = RAYLEIGH * math.sqrt(math.pi / 8)
        closed = np.outer(amplitude, amplitude) * target + still * (free + count) * noise_alone
        assert np.allclose(np.diag(closed), np.diag(exact), rtol=1e-5)
        scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
        # IFOVs that see a short stretch of the ship are more correlated.
        assert np.abs((closed - exact) / scale).max() < 0.25
        # The sample covariance has a standard error of at most sqrt(2 / draws) of the variances;
        # 6 of them for some 10^4 elements.
        sample = np.cov(noise.T)
        assert np.abs((sample - closed) / scale).max() < 6 * math.sqrt(2 / draws)


@pytest.mark.parametrize(("gain_sigma", "floor_sigma"), [(0.0, 0.0), (1.0, 0.0), (0.5, 2.0)])
def test_likelihood_matches_gaussian_templates_of_one_covariance(gain_sigma, floor_sigma):
    rng, free, frames = np.random.default_rng(4), 50.0, 16
    templates = 5 * rng.random((3, BINS))
    tests = templates[[0, 1, 2, 0]] * np.array([[1.0], [0.7], [1.3], [0.0]])
    normals = rng.standard_normal((4, 2, BINS))
    still, ifovs, radar = np.zeros((4, BINS)), np.full(4, free), Radar(cnr=1.0, **PULSE)
    seen = templates[:, None], tests, still, still[0], ifovs, normals, radar
    match = ProfileMatch(*seen, floor_sigma=floor_sigma)
    evidence = match.evidence(frames, gain_sigma=gain_sigma)
    covariance = RAYLEIGH * math.sqrt(math.pi / 8) * free * correlations(Pulse(30e-9, 1.0), BINS)[1]
    band = [np.pad(np.diag(covariance, -lag), (0, lag)) for lag in range(BINS)]
    exact = GaussianTemplates(
        gain_sigma=gain_sigma, floor_sigma=floor_sigma, diagonal_loading=LOADING
    ).fit(templates, np.stack([band] * 3), [0, 1, 2], floor=0.0)
    noise = frame_noise(still, ifovs, normals, radar)
    expected = exact.log_likelihood(tests + noise / math.sqrt(frames), frames)
    difference = (evidence - evidence[:, :1]) - (expected - expected[:, :1])
    # Products in single precision: 2^-24 times the largest energies, some 10^4.
    assert np.abs(difference).max() < 1e-6 * np.abs(expected - expected[:, :1]).max() + 0.05
