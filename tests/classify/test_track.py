"""The aspect prior from a track equals integrals of the normal density."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import norm

from ncti.classify import GaussianTemplates, aspect_prior, label_posterior

AT = np.cumsum(np.tile([1.0, 2.0], 30))
SHIP = np.full(AT.size, "duncan")


@given(tracked=st.floats(-20, 110), sigma=st.floats(0.05, 200))
def test_prior_is_the_normal_mass_of_each_cell(tracked, sigma):
    prior = aspect_prior(AT, SHIP, [tracked], sigma=sigma)[0]
    edges = np.concatenate([[AT[0] - 1.0], (AT[1:] + AT[:-1]) / 2, [AT[-1] + 1.0]])
    mass = sum(np.diff(norm.cdf(edges + turn, tracked, sigma)) for turn in (-360, 0, 360))
    np.testing.assert_allclose(np.exp(prior), mass, atol=1e-12)
    assert np.isfinite(prior).all()


@given(tracked=st.floats(-360, 720))
def test_zero_sigma_prior_selects_the_nearest_template(tracked):
    """This holds on a full circle, for aspects counted in either direction."""
    aspects = np.arange(0.0, 360.0, 3.0)
    prior = aspect_prior(aspects, np.full(aspects.size, "texas"), [tracked], sigma=0.0)[0]
    distance = np.abs((aspects - tracked + 180) % 360 - 180)
    if (
        np.partition(distance, 1)[:2].tolist() == sorted(distance)[:2]
        and np.ptp(np.sort(distance)[:2]) > 0.1
    ):
        assert prior.argmax() == distance.argmin()
        assert np.exp(prior).round(6).sum() == 1


@given(shift=st.floats(-360, 360), sigma=st.floats(0.1, 90))
def test_prior_is_rotation_invariant(shift, sigma):
    aspects = np.arange(0.0, 360.0, 72.0)
    turned = aspect_prior((aspects + shift) % 360, np.zeros(5), [(15.0 + shift) % 360], sigma=sigma)
    before = aspect_prior(aspects, np.zeros(5), [15.0], sigma=sigma)
    np.testing.assert_allclose(np.exp(turned), np.exp(before), atol=1e-9)


def test_posterior_with_priors_and_exclusions_matches_formula():
    """Each sample has its own exclusions; excluded scores are best and would overflow exp."""
    rng = np.random.default_rng(3)
    scores, prior = rng.normal(0, 3, (2, 6, 9))
    labels = np.array([0, 0, 0, 1, 1, 1, 1, 2, 2])
    exclude = rng.random((6, 9)) < 0.3
    exclude[:, -2:] = True  # all of a label
    exclude[:, 0], exclude[4, 3:7] = False, True
    scores[exclude] += 2000
    _, posterior = label_posterior(scores, labels, exclude=exclude, log_prior=prior)
    weight = np.where(exclude, -np.inf, prior)
    of_label = np.full((6, 3), -np.inf)
    for label in (0, 1):
        of_this = labels == label
        there = ~exclude[:, of_this].all(axis=1)
        joint = logsumexp((scores + weight)[there][:, of_this], axis=1)
        of_label[there, label] = joint - logsumexp(weight[there][:, of_this], axis=1)
    expected = np.exp(of_label - logsumexp(of_label, axis=1, keepdims=True))
    np.testing.assert_allclose(posterior, expected, rtol=1e-12)
    for row, hidden in enumerate(exclude):  # one rule for all samples
        one = {"exclude": hidden, "log_prior": prior[row]}
        _, alone = label_posterior(scores[[row]], labels, **one)
        np.testing.assert_allclose(alone[0], expected[row], rtol=1e-12)


def test_track_prior_resolves_ambiguous_profiles():
    """Two ships with profiles exchanged between two aspects are separable only by the track."""
    means = np.array(
        [[0.0, 1, 0, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, 1, 0, 0], [0, 1, 0, 0, 0, 0]]
    )
    aspects, names = np.array([10.0, 40.0, 10.0, 40.0]), ["a", "a", "b", "b"]
    templates = GaussianTemplates().fit(means, np.full((4, 1, 6), 0.01), names, floor=0.0)
    blind = templates.posterior(means[:1], 1)
    np.testing.assert_allclose(blind, 0.5, atol=1e-9)
    prior = aspect_prior(aspects, names, [12.0], sigma=5.0)
    assert templates.posterior(means[:1], 1, log_prior=prior)[0, 0] > 0.95
    assert templates.predict(means[:1], 1, log_prior=prior) == ["a"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("sigma", -1.0), ("sigma", np.nan), ("aspect", [0.0, 0.0]), ("aspect", [0.0])),
        *(("tracked", 3.0), ("tracked", [np.inf])),
    ],
)
def test_invalid_arguments_are_refused(name, value):
    good = {"aspect": [0.0, 10.0], "labels": ["a", "a"], "tracked": [3.0], "sigma": 1.0}
    with pytest.raises(ValueError, match=f"^{name}"):
        aspect_prior(**(good | {name: value}))
