"""The likelihood classifier against dense Gaussians, closed forms and its own probabilities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg, stats
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from ncti.classify import GaussianTemplates, lower_band
from ncti.classify.likelihood import WIDEST
from ncti.ladar import RangeExtent, banded_frame_moments, sample_frames

LEVEL = 1e-3
BINS, LAGS = 24, 5
LABELS = np.array(["horne", "duncan", "horne", "texas"])


def templates(seed: int = 0, count: int = 4):
    """Means (template, bin), floors (bin,) and banded covariances (template, lag, bin)."""
    rng = np.random.default_rng(seed)
    floor = 5.0 + rng.random(BINS)
    means = floor + 3 * rng.random((count, BINS))
    factors = np.zeros((count, BINS, BINS))
    for lag in range(LAGS):
        n = np.arange(BINS - lag)
        factors[:, n + lag, n] = rng.uniform(0.2, 1.0, (count, len(n))) / (1 + 2 * lag)
    dense = factors @ factors.transpose(0, 2, 1)
    return means, floor, dense


def dense_covariance(signal, dense, *, mean_variance, frames, gain_sigma, floor_sigma, nugget):
    """Of an average with every unknown integrated out, as one matrix."""
    ones = np.ones(len(signal))
    return (
        (dense + nugget * mean_variance * np.eye(len(signal))) / frames
        + gain_sigma**2 * np.outer(signal, signal)
        + floor_sigma**2 * mean_variance * np.outer(ones, ones)
    )


@pytest.mark.parametrize("frames", [1, 4, 32])
@pytest.mark.parametrize("floor_sigma", [0.0, 0.7])
@pytest.mark.parametrize("gain_sigma", [0.0, 0.05, 3.0])
@pytest.mark.parametrize("nugget", [0.0, 0.1])
def test_log_likelihood_is_that_of_a_dense_gaussian(gain_sigma, floor_sigma, nugget, frames):
    """Two triangular solves with condition numbers below 1e5: 1e-10 of some hundred nats."""
    means, floor, dense = templates()
    X = means.mean(axis=0) + np.random.default_rng(1).standard_normal((6, BINS))
    parameters = {"gain_sigma": gain_sigma, "floor_sigma": floor_sigma, "nugget": nugget}
    classifier = GaussianTemplates(**parameters)
    classifier.fit(means, lower_band(dense)[:, :LAGS], LABELS, floor)
    logs = classifier.log_likelihood(X, frames)
    v = np.mean(np.diagonal(dense, axis1=1, axis2=2))
    for t, mean in enumerate(means):
        whole = dense_covariance(
            mean - floor, dense[t], mean_variance=v, frames=frames, **parameters
        )
        by_hand = stats.multivariate_normal(mean, whole).logpdf(X)
        np.testing.assert_allclose(logs[:, t], by_hand, rtol=1e-10)


def test_each_average_has_its_own_frames():
    means, floor, dense = templates()
    X = means[[0, 1, 2]] + 0.1
    classifier = GaussianTemplates().fit(means, lower_band(dense), LABELS, floor)
    together = classifier.log_likelihood(X, [4, 8, 32])
    alone = [classifier.log_likelihood(X[[i]], n)[0] for i, n in enumerate((4, 8, 32))]
    np.testing.assert_allclose(together, alone, rtol=1e-13)


@pytest.mark.parametrize("floor_sigma", [0.0, 0.7])
def test_gains_that_share_the_whitening_are_those_of_classifiers_of_their_own(floor_sigma):
    """Rounding alone, of differences of some hundred nats with condition numbers below 1e5."""
    means, floor, dense = templates()
    X = means.mean(axis=0) + np.random.default_rng(1).standard_normal((6, BINS))
    frames = [1, 4, 8, 1, 32, 4]
    sigmas = np.array([[0.0, 0.05, 1.0], [3.0, 1e3, WIDEST]])
    given = means, lower_band(dense)[:, :LAGS], LABELS, floor
    shared = GaussianTemplates(floor_sigma=floor_sigma).fit(*given)
    logs = shared.log_likelihood(X, frames, gain_sigma=sigmas)
    assert logs.shape == (*sigmas.shape, *X.shape[:1], len(means))
    for place in np.ndindex(sigmas.shape):
        own = GaussianTemplates(gain_sigma=sigmas[place], floor_sigma=floor_sigma).fit(*given)
        np.testing.assert_allclose(logs[place], own.log_likelihood(X, frames), rtol=1e-10)
    # The classifier's own is left as it is.
    np.testing.assert_array_equal(shared.log_likelihood(X, frames), logs[0, 2])


def test_an_average_of_frames_is_one_frame_of_less_noise():
    means, floor, dense = templates()
    X = means[::-1] + 0.1
    # A shift of the floor is no noise of the frames: its unit is set apart.
    known = GaussianTemplates(floor_sigma=0.0)
    eight = clone(known).fit(means, lower_band(dense), LABELS, floor)
    one = clone(known).fit(means, lower_band(dense) / 8, LABELS, floor)
    np.testing.assert_allclose(eight.log_likelihood(X, 8), one.log_likelihood(X, 1), rtol=1e-12)


def test_the_order_of_bins_does_not_matter():
    means, floor, dense = templates()
    X = means[::-1] + 0.1
    turn = np.random.default_rng(2).permutation(BINS)
    plain = GaussianTemplates(floor_sigma=0.5).fit(means, lower_band(dense), LABELS, floor)
    turned = GaussianTemplates(floor_sigma=0.5).fit(
        means[:, turn], lower_band(dense[:, turn][:, :, turn]), LABELS, floor[turn]
    )
    np.testing.assert_allclose(
        plain.log_likelihood(X, 4), turned.log_likelihood(X[:, turn], 4), rtol=1e-11
    )


def test_a_band_of_fewer_lags_is_the_whole_matrix():
    means, floor, dense = templates()
    band = lower_band(dense)
    assert not band[:, LAGS:].any()
    for t, lag, n in [(0, 0, 3), (1, 2, 7), (3, 4, BINS - 5)]:
        assert band[t, lag, n] == dense[t, n + lag, n]
    X = means[::-1] + 0.1
    few, all_lags = (
        GaussianTemplates().fit(means, lags, LABELS, floor) for lags in (band[:, :LAGS], band)
    )
    np.testing.assert_allclose(few.log_likelihood(X, 4), all_lags.log_likelihood(X, 4), rtol=1e-13)


@pytest.mark.parametrize("floor", ["number", "bins", "templates", "both"])
def test_a_floor_has_any_shape_that_fits(floor):
    means, _, dense = templates()
    whole = np.full_like(means, 2.0)
    whole[1:] += 0.5 if floor in ("templates", "both") else 0.0
    whole[:, 1:] += 0.25 if floor in ("bins", "both") else 0.0
    given = {"number": 2.0, "bins": whole[0], "templates": whole[:, :1], "both": whole}[floor]
    X = means[::-1] + 0.1
    logs = [
        GaussianTemplates().fit(means, lower_band(dense), LABELS, f).log_likelihood(X, 4)
        for f in (given, whole)
    ]
    np.testing.assert_array_equal(*logs)


# ------------------------------------------------------------------ unknown gain and floor


def logs_at(X, **parameters):
    means, floor, dense = templates()
    classifier = GaussianTemplates(**parameters)
    return classifier.fit(means, lower_band(dense), LABELS, floor).log_likelihood(X, 4)


@pytest.mark.parametrize("name", ["gain_sigma", "floor_sigma"])
def test_a_prior_that_closes_leaves_the_known_value(name):
    """The difference falls as the square of the prior's width: slope 2 within 1 %."""
    X = templates()[0][::-1] + 0.1
    other = {"gain_sigma": 0.0, "floor_sigma": 0.0}
    differences = [
        np.abs(logs_at(X, **other | {name: sigma}) - logs_at(X, **other)) for sigma in (1e-3, 1e-4)
    ]
    slope = np.log10(differences[0] / differences[1])
    np.testing.assert_allclose(slope, 2.0, rtol=0.01)


@pytest.mark.parametrize("name", ["gain_sigma", "floor_sigma"])
def test_a_prior_that_opens_costs_its_logarithm_and_no_more(name):
    X = templates()[0][::-1] + 0.1
    narrow, wide, widest = (logs_at(X, **{name: sigma}) for sigma in (1e3, 1e4, WIDEST))
    # What is left goes as the prior's precision, 1e-6, times the misfit of some hundred nats.
    np.testing.assert_allclose(narrow - wide, np.log(10), rtol=0, atol=1e-3)
    np.testing.assert_allclose(wide - widest, np.log(100), rtol=0, atol=1e-5)


def test_what_is_unknown_does_not_tell_templates_apart():
    """With wide priors a changed floor leaves all odds, a changed gain those of its template."""
    means, floor, dense = templates()
    classifier = GaussianTemplates(gain_sigma=1e4, floor_sigma=1e4)
    classifier.fit(means, lower_band(dense), LABELS, floor)
    X = means[[0, 1]] + np.random.default_rng(3).standard_normal((2, BINS)) / 2
    plain, raised = classifier.log_likelihood(X, 4), classifier.log_likelihood(X + 0.7, 4)
    np.testing.assert_allclose(raised, plain, rtol=0, atol=1e-4)
    brighter = X + 0.7 * (means[[0, 1]] - floor)
    gained = classifier.log_likelihood(brighter, 4)
    own = np.arange(2)
    np.testing.assert_allclose(gained[own, own], plain[own, own], rtol=0, atol=1e-4)


# ------------------------------------------------------------------ probabilities and answers


@pytest.mark.parametrize("frames", [1, 4])
def test_two_classes_of_equal_covariance_are_confused_as_the_closed_form_says(frames):
    """20,000 draws, z at 1e-3: the error rate is Q(d/2), d the Mahalanobis distance."""
    rng, count = np.random.default_rng(11), 20_000
    means, _, dense = templates(count=2)
    means[1] = means[0] + 0.25 * (means[1] - means[0])
    same = dense[[0, 0]]
    distance = np.sqrt(frames * (means[1] - means[0]) @ linalg.solve(same[0], means[1] - means[0]))
    error = stats.norm.sf(distance / 2)
    assert 0.01 < error < 0.45
    X = rng.multivariate_normal(means[0], same[0] / frames, count)
    classifier = GaussianTemplates(gain_sigma=0.0, floor_sigma=0.0, nugget=0.0)
    wrong = classifier.fit(means, lower_band(same), ["a", "b"], 0.0).predict(X, frames) == "b"
    z = (wrong.sum() - count * error) / np.sqrt(count * error * (1 - error))
    assert abs(z) < stats.norm.isf(LEVEL / 2)


def misfit_of_probabilities(probability, happened, bins=10):
    """p-value of chi-square over bins of probability: hits against the sum of probabilities.

    Given the probabilities, hits in a bin have that mean and the variance sum of p (1 - p).
    """
    order = np.argsort(probability)
    variance = np.cumsum((probability * (1 - probability))[order])
    # Bins of equal variance, so that none holds certainties alone.
    place = np.minimum((bins * variance / variance[-1]).astype(int), bins - 1)
    excess = np.bincount(place, weights=(happened - probability)[order])
    return stats.chi2.sf((excess**2).sum() / (variance[-1] / bins), bins)


@pytest.mark.parametrize("frames", [1, 8])
def test_probabilities_are_the_frequencies_of_the_model(frames):
    """20,000 draws of label, template, gain, floor and noise; chi-square over ten bins at 1e-3.

    Two of the templates share a label, so that the priors of labels and templates both count.
    """
    rng, count = np.random.default_rng(12), 20_000
    means, floor, dense = templates(seed=4)
    means = means.mean(axis=0) + 0.1 * (means - means.mean(axis=0))
    dense = dense.mean(axis=0) + 0.1 * (dense - dense.mean(axis=0))
    parameters = {"gain_sigma": 0.2, "floor_sigma": 0.3, "nugget": 0.05}
    classifier = GaussianTemplates(**parameters)
    classifier.fit(means, lower_band(dense), LABELS, floor)
    label = rng.choice(classifier.classes_, count)
    template = np.array([rng.choice(np.flatnonzero(name == LABELS)) for name in label])
    v = np.mean(np.diagonal(dense, axis1=1, axis2=2))
    X = np.empty((count, BINS))
    for t, mean in enumerate(means):
        whole = dense_covariance(
            mean - floor, dense[t], mean_variance=v, frames=frames, **parameters
        )
        drawn = template == t
        X[drawn] = rng.multivariate_normal(mean, whole, drawn.sum())
    posterior = classifier.posterior(X, frames)
    np.testing.assert_allclose(posterior.sum(axis=1), 1.0, rtol=1e-12)
    for k, name in enumerate(classifier.classes_):
        assert misfit_of_probabilities(posterior[:, k], label == name) > LEVEL / 3
    # The test has the power to tell: odds sharpened by a tenth are found out.
    sharper = posterior**1.2
    sharper /= sharper.sum(axis=1, keepdims=True)
    assert misfit_of_probabilities(sharper[:, 0], label == classifier.classes_[0]) < LEVEL


def said_and_right(ifovs: int, target_free_ifovs: int, frames: int):
    """Mean probability of the answer, share of right ones, p-value of the misfit; 12,000 frames.

    Six views alike of three labels, each of `ifovs` IFOVs at 20 dB, drawn with their speckle.
    """
    rng, draws = np.random.default_rng(1), 2000
    common = rng.random((ifovs, 24))
    extents = []
    for _ in range(6):
        fraction = np.zeros((ifovs, 64))
        fraction[:, 20:44] = common + 0.6 * rng.random((ifovs, 24))
        fraction /= fraction.sum(axis=1, keepdims=True)
        cell = np.zeros((ifovs, 2), int)
        extents.append(RangeExtent(fraction, np.arange(64) - 31.5, 1.0, cell, 150e-6, 1e5))
    parameters = {"pulse_width": 30e-9, "cnr": 100.0, "target_free_ifovs": target_free_ifovs}
    moments = [banded_frame_moments(extent, **parameters) for extent in extents]
    mean, band = zip(*moments, strict=True)
    label = np.repeat([0, 1, 2], 2)
    classifier = GaussianTemplates(gain_sigma=0.0, floor_sigma=0.0)
    classifier.fit(np.array(mean), np.array(band), label, 0.0)
    X = np.concatenate(
        [
            sample_frames(extent, frame_count=draws * frames, rng=rng, **parameters)
            .reshape(draws, frames, -1)
            .mean(axis=1)
            for extent in extents
        ]
    )
    posterior = classifier.posterior(X, frames)
    truth = np.repeat(label, draws)
    misfit = min(misfit_of_probabilities(posterior[:, k], truth == k) for k in range(3))
    return posterior.max(axis=1).mean(), np.mean(posterior.argmax(axis=1) == truth), misfit


@pytest.mark.parametrize(
    ("ifovs", "target_free_ifovs", "frames"), [(8, 0, 4), (8, 0, 16), (2, 200, 4), (2, 200, 16)]
)
def test_probabilities_are_the_frequencies_of_sampled_frames(ifovs, target_free_ifovs, frames):
    """Speckle and noise as drawn, not as the model has them; chi-square at 1e-3."""
    *_, misfit = said_and_right(ifovs, target_free_ifovs, frames)
    assert misfit > LEVEL / 3


def test_a_sum_of_two_magnitudes_is_not_gaussian_enough():
    """Where the model ends: two IFOVs in one frame, skewed by 0.45, leave it too sure."""
    said, right, misfit = said_and_right(2, 0, 1)
    assert misfit < LEVEL / 3
    assert said > right
    said, right, misfit = said_and_right(2, 0, 16)
    assert misfit > LEVEL / 3


def test_templates_left_out_are_as_if_never_given():
    means, floor, dense = templates()
    X = means + 0.3
    # Nugget and floor have their units from all templates given.
    known = GaussianTemplates(floor_sigma=0.0, nugget=0.0)
    classifier = clone(known).fit(means, lower_band(dense), LABELS, floor)
    fewer = clone(known).fit(means[1:], lower_band(dense[1:]), LABELS[1:], floor)
    np.testing.assert_allclose(
        classifier.without([True, False, False, False]).posterior(X, 4),
        fewer.posterior(X, 4),
        rtol=1e-10,
        atol=1e-300,
    )
    for left_out, name in ((1, "duncan"), (3, "texas")):  # which have one template each
        rest = classifier.without(np.arange(4) == left_out)
        assert name not in rest.classes_
        assert rest.posterior(X, 4).shape == (4, 2)
        np.testing.assert_array_equal(
            rest.predict(X, 4), rest.classes_[rest.posterior(X, 4).argmax(axis=1)]
        )
        assert name not in rest.predict(X, 4)
    assert "horne" in classifier.without([True, False, False, False]).classes_


def test_the_template_itself_answers():
    means, floor, dense = templates()
    classifier = GaussianTemplates().fit(means, lower_band(dense), LABELS, floor)
    np.testing.assert_array_equal(classifier.predict(means, 1000), LABELS)
    np.testing.assert_array_equal(classifier.predict(means[:1], 1000), LABELS[:1])


# ------------------------------------------------------------------ refusals


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"mean": np.zeros(BINS)}, r"mean has shape \(24,\), but must be \(template, bin\)"),
        ({"mean": np.full((4, BINS), np.nan)}, "mean is nan"),
        ({"covariance": np.zeros((4, BINS))}, r"covariance has shape \(4, 24\)"),
        ({"covariance": np.zeros((4, BINS + 1, BINS))}, "1 to 24 lags"),
        ({"covariance": np.zeros((4, 1, BINS))}, r"nugget is 0\.001.*covariance\[0\]"),
        ({"labels": ["a"]}, r"labels has shape \(1,\), but must be \(4,\)"),
        ({"floor": np.zeros(3)}, r"floor has shape \(3,\)"),
        ({"floor": np.inf}, "floor is inf"),
    ],
)
def test_bad_templates_are_named(changed, message):
    means, floor, dense = templates()
    good = {"mean": means, "covariance": lower_band(dense), "labels": LABELS, "floor": floor}
    with pytest.raises(ValueError, match=message):
        GaussianTemplates().fit(**good | changed)


@pytest.mark.parametrize("name", ["gain_sigma", "floor_sigma", "nugget"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf, 1e200, "wide"])
def test_bad_parameters_are_named(name, value):
    means, floor, dense = templates()
    with pytest.raises(ValueError, match=name):
        GaussianTemplates(**{name: value}).fit(means, lower_band(dense), LABELS, floor)


def test_bad_averages_are_named():
    means, floor, dense = templates()
    classifier = GaussianTemplates().fit(means, lower_band(dense), LABELS, floor)
    with pytest.raises(ValueError, match=r"X has shape \(4, 23\), but must be \(sample, 24\)"):
        classifier.predict(means[:, 1:], 4)
    with pytest.raises(ValueError, match=r"X has shape \(0, 24\)"):
        classifier.predict(means[:0], 4)
    with pytest.raises(ValueError, match=r"X reaches .*e\+200"):
        classifier.predict(means * 1e200, 4)
    with pytest.raises(NotFittedError):
        GaussianTemplates().predict(means, 4)
    with pytest.raises(ValueError, match="X is nan"):
        classifier.predict(means * np.nan, 4)
    with pytest.raises(ValueError, match="frame_count is 0"):
        classifier.predict(means, 0)
    with pytest.raises(ValueError, match=r"^gain_sigma is -1.*at least 0 and at most 1e\+06"):
        classifier.log_likelihood(means, 4, gain_sigma=[0, -1])
    with pytest.raises(ValueError, match=r"frame_count has shape \(2,\)"):
        classifier.predict(means, [1, 2])
    with pytest.raises(ValueError, match=r"covariance has shape \(4, 3\)"):
        lower_band(np.zeros((4, 3)))
