"""Aspects between templates: tangents and residuals by closed forms, and what is calibrated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from ncti.classify import GaussianTemplates, label_posterior
from ncti.classify.bands import mean_correlation, residual_band
from ncti.classify.between import cells, every_other
from ncti.classify.calibration import fit_doubt, fit_sharpness_and_doubt, likely_doubt
from ncti.classify.fusion import doubted

WHITE = np.array([1.0])
BINS = 40


def parabola(aspect, curvature=0.02):
    """Profiles that are a parabola in aspect in every bin."""
    bins = np.linspace(0.5, 1.5, BINS)
    x = np.asarray(aspect)[:, None] - 40
    return bins * (3 + 0.1 * x + curvature * x**2 / 2)


@pytest.mark.parametrize("aspect", [[10, 20, 30, 40], [0.0, 7.0, 11.0, 30.0, 31.0]])
def test_a_parabola_has_its_own_tangent_and_half_its_second_difference(aspect):
    """Exact for polynomials of the second degree, but for the slope at open ends."""
    aspect = np.array(aspect, dtype=float)
    found = cells(parabola(aspect), np.zeros(len(aspect)), aspect, WHITE)
    bins = np.linspace(0.5, 1.5, BINS)
    before, behind = np.diff(aspect)[:-1], np.diff(aspect)[1:]
    moment = (before**3 + behind**3) / (12 * (before + behind))
    slope = 0.1 + 0.02 * (aspect[1:-1] - 40)
    np.testing.assert_allclose(found.tangent[1:-1], np.outer(np.sqrt(moment) * slope, bins))
    step = np.concatenate([[before[0]], (before + behind) / 2, [behind[-1]]])
    np.testing.assert_allclose(found.residual, np.outer(0.02 * step**2 / 2, bins), rtol=1e-9)


def test_the_moment_is_that_of_an_aspect_uniform_within_its_cell():
    """10^5 draws: a variance of a uniform number errs by 0.9/sqrt(n) of itself."""
    before, behind = 3.0, 8.0
    aspect = np.array([-before, 0.0, behind]) + 50
    means = np.outer(aspect, np.ones(BINS))
    tangent = cells(means, np.zeros(3), aspect, WHITE).tangent[1, 0]
    drawn = np.random.default_rng(0).uniform(-before / 2, behind / 2, 10**5)
    assert tangent**2 == pytest.approx(np.mean(drawn**2), rel=5 * 0.9 / np.sqrt(10**5))


def test_a_range_of_aspects_may_close():
    """Templates all around: turned by a step, what lies between turns with them."""
    aspect = np.arange(0, 360, 30.0)
    means = np.random.default_rng(1).random((12, BINS))
    found = cells(means, np.zeros(12), aspect, WHITE)
    turned = cells(np.roll(means, 1, axis=0), np.zeros(12), aspect, WHITE)
    np.testing.assert_allclose(np.roll(found.tangent, 1, axis=0), turned.tangent)
    np.testing.assert_allclose(np.roll(found.residual, 1, axis=0), turned.residual)
    opened = cells(means[:-1], np.zeros(11), aspect[:-1], WHITE)
    assert not np.allclose(opened.tangent[0], found.tangent[0])


def test_no_ship_is_wider_than_another_and_the_order_does_not_matter():
    aspect = np.tile(np.arange(0, 60, 6.0), 2)
    labels = np.repeat([0, 1], 10)
    means = np.concatenate([parabola(aspect[:10]), parabola(aspect[:10], 0.2)])
    found = cells(means, labels, aspect, np.array([1.0, 0.5]))
    np.testing.assert_allclose(found.residual[:10], found.residual[10:])
    turn = np.random.default_rng(2).permutation(20)
    other = cells(means[turn], labels[turn], aspect[turn], np.array([1.0, 0.5]))
    np.testing.assert_allclose(other.residual, found.residual[turn])
    np.testing.assert_allclose(other.tangent, found.tangent[turn])


def test_few_templates():
    """Of one nothing is known; of two the difference, half of which is the residual."""
    alone = cells(np.ones((2, BINS)), [0, 1], [0.0, 0.0], WHITE)
    assert not alone.tangent.any() and not alone.residual.any()
    means = np.stack([np.zeros(BINS), np.full(BINS, 4.0)])
    pair = cells(means, [0, 0], [10.0, 20.0], WHITE)
    np.testing.assert_allclose(pair.tangent, 4 / np.sqrt(12))
    np.testing.assert_allclose(pair.residual, 2.0)
    with pytest.raises(ValueError, match=r"^aspect has 10 twice for"):
        cells(means, [0, 0], [10.0, 10.0], WHITE)


def test_the_band_of_a_residual_is_positive_semidefinite():
    rng = np.random.default_rng(3)
    factor = np.tril(np.triu(rng.normal(size=(BINS, BINS)), -6))
    dense = factor @ factor.T
    band = np.stack([np.append(np.diag(dense, -lag), np.zeros(lag)) for lag in range(7)])
    along = mean_correlation(band[None])
    made = residual_band(rng.exponential(size=BINS), along)
    whole = sum(
        np.diag(made[lag, : BINS - lag], -lag) + np.diag(made[lag, : BINS - lag], lag)
        for lag in range(1, 7)
    ) + np.diag(made[0])
    assert np.linalg.eigvalsh(whole).min() > -1e-10 * made.max()


def test_what_is_left_out_lies_between_two_that_remain():
    labels = np.array([0] * 7 + [1] * 4)
    aspect = np.array([6.0, 0, 3, 9, 12, 18, 15, 0, 3, 6, 9])
    out, beside = every_other(labels, aspect)
    assert sorted(aspect[out]) == [3, 9, 15]  # of the second there are too few
    np.testing.assert_array_equal(beside.sum(axis=1), 2)
    for row, at in zip(beside, aspect[out], strict=True):
        np.testing.assert_array_equal(np.sort(aspect[~out][row]), [at - 3, at + 3])


# What is calibrated


def smooth_ships(aspect, ships=3, scale=6.0, seed=4):
    """Random ships whose profiles change over some degrees: (ship, aspect, bin)."""
    rng = np.random.default_rng(seed)
    knots = np.arange(-60, 151, 3.0)
    weights = np.exp(-0.5 * ((np.asarray(aspect)[:, None] - knots) / scale) ** 2)
    drawn = rng.normal(size=(ships + 1, len(knots), BINS))
    alike = drawn[0] + 0.3 * drawn[1:]
    return 10 + 3 * np.einsum("ak,skn->san", weights, alike)


def taught(spacing, error, noise=0.5):
    aspect = np.arange(0, 90.1, spacing)
    means = smooth_ships(aspect)
    count = means.shape[0] * len(aspect)
    band = np.full((count, 1, BINS), noise**2)
    given = means.reshape(count, BINS), band, np.repeat([0, 1, 2], len(aspect))
    classifier = GaussianTemplates(gain_sigma=0.0, floor_sigma=0.0, template_error=error)
    at = np.tile(aspect, 3)
    return classifier.fit(*given, 0.0, aspect=at, rng=np.random.default_rng(5))


def fresh(count=120, frames=16, noise=0.5):
    rng = np.random.default_rng(6)
    aspect = rng.uniform(0, 90, count)
    means = smooth_ships(aspect)
    return means + noise / np.sqrt(frames) * rng.normal(size=means.shape)


def test_probabilities_at_fresh_aspects_are_not_too_sure():
    """Surprise at the true label: smaller than with exact templates, and no more than claimed.

    Of 360 answers the share that is wrong is below the mean claim plus 3 standard errors.
    """
    seen = fresh().reshape(-1, BINS)
    true = np.repeat([0, 1, 2], 120)
    found = {}
    for error in (0.0, None):
        posterior = taught(12.0, error).posterior(seen, 16)
        wrong = np.mean(posterior.argmax(axis=1) != true)
        claimed = 1 - posterior.max(axis=1)
        spread = 3 * np.sqrt(np.mean(claimed * (1 - claimed)) / len(true)) + 3 / len(true)
        surprise = -np.log(np.maximum(posterior[np.arange(360), true], 1e-300)).mean()
        found[error] = wrong - claimed.mean() - spread, surprise
    assert found[0.0][0] > 0 > found[None][0]
    assert found[None][1] < 0.2 * found[0.0][1]


def test_distances_of_left_out_aspects_are_no_larger_than_chi_square():
    """Gain and floor known: the mean of 360 is below that of chi-square by 40 degrees."""
    distance = taught(6.0, None).compare(fresh().reshape(-1, BINS), 16)[1].min(axis=1)
    assert distance.mean() < stats.chi2.mean(BINS) * 1.1
    exact = taught(6.0, 0.0).compare(fresh().reshape(-1, BINS), 16)[1].min(axis=1)
    assert exact.mean() > 2 * distance.mean()


def test_no_error_makes_templates_exact_to_the_last_bit():
    seen = fresh(10).reshape(-1, BINS)
    exact = taught(6.0, 0.0)
    plain = GaussianTemplates(gain_sigma=0.0, floor_sigma=0.0)
    plain.fit(exact.mean_, np.full((len(exact.mean_), 1, BINS), 0.25), exact.labels_, 0.0)
    for frames in (4, 16):
        np.testing.assert_array_equal(
            exact.log_likelihood(seen, frames), plain.log_likelihood(seen, frames)
        )


def test_without_some_is_a_classifier_that_never_had_them():
    """But for the mean variance and correlation, which are those of all: here they are equal."""
    whole = taught(3.0, 0.3)
    out = np.tile(np.arange(31) % 2 == 1, 3)
    seen = fresh(10).reshape(-1, BINS)
    np.testing.assert_allclose(
        whole.without(out).log_likelihood(seen, 16), taught(6.0, 0.3).log_likelihood(seen, 16)
    )
    with pytest.raises(ValueError, match=r"^left_out has shape"):
        whole.without(np.ones(93, dtype=bool))


def test_an_average_of_its_own_number_of_frames():
    """Samples of several numbers of frames together are as each alone."""
    classifier, seen = taught(6.0, 0.3), fresh(1).reshape(-1, BINS)
    together = classifier.log_likelihood(seen, [4, 16, 4])
    alone = [classifier.log_likelihood(seen[[i]], n)[0] for i, n in enumerate((4, 16, 4))]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_templates_that_are_too_few_say_so():
    means, band = smooth_ships([0.0, 10.0])[0], np.ones((2, 1, BINS))
    classifier = GaussianTemplates(template_error=None)
    with pytest.raises(ValueError, match=r"^aspect is None"):
        classifier.fit(means, band, [0, 0], 0.0)
    with pytest.raises(ValueError, match=r"^rng is None"):
        classifier.fit(means, band, [0, 0], 0.0, aspect=[0.0, 10.0])
    rng = np.random.default_rng(0)
    fitted = classifier.fit(means, band, [0, 0], 0.0, aspect=[0, 10], rng=rng)
    assert fitted.template_error_ == 1.0
    assert not fit_doubt(classifier, 16, rng).any()


# What one sensor may outweigh of another


def test_doubt_grows_with_the_spacing_and_is_none_of_exact_templates():
    doubts = [
        fit_doubt(taught(spacing, error), 16, np.random.default_rng(7))
        for spacing, error in ((3.0, None), (12.0, None), (12.0, 0.0))
    ]
    assert 0 < doubts[0].mean() < doubts[1].mean() < 0.25
    assert doubts[0].min() > 0 and doubts[1].max() < 0.25
    assert not doubts[2].any()


class Confused:
    """Templates of two labels every 3 degrees, which are alike from 60 degrees on."""

    template_error_, gain_sigma = 1.0, 0.0
    classes_ = np.arange(2)

    def __init__(self, kept=None):
        kept = np.ones(62, dtype=bool) if kept is None else kept
        self.aspect_ = np.tile(np.arange(0.0, 91.0, 3.0), 2)[kept]
        self.labels_ = np.repeat([0, 1], 31)[kept]
        self.mean_ = (self.labels_ * np.where(self.aspect_ < 60, 1, -1))[:, None].astype(float)
        self.cholesky_ = np.full((len(self.mean_), 1, 1), 1e-6)

    def without(self, left_out):
        return Confused(~left_out)

    def log_likelihood(self, samples, frame_count, *, gain_sigma):
        """Sure of label 0, or of label 1 where the sample is 1: from 60 degrees on always of 0."""
        return np.where((samples > 0.5) == (self.labels_ == 1), 0.0, -50.0)[None]


def test_doubt_is_where_answers_are_wrong():
    """Half the answers abeam are wrong, however sure: nearly the largest doubt."""
    found = fit_doubt(Confused(), 16, np.random.default_rng(0), gain_sigma=0.0)
    at = Confused().aspect_
    assert found[at >= 75].min() > 5 * found[at <= 30].max()
    assert 0.1 < found[at == 90].mean() < 1 - 0.001 ** (1 / 12)
    # Templates of one aspect have one doubt, whatever their label.
    np.testing.assert_array_equal(found[:31], found[31:])


@pytest.mark.parametrize("added", [0.25, 1.0])
def test_the_likely_doubt_is_that_of_a_search_of_all(added):
    """By the sum itself, on a grid of 1 in 1,000 of doubts, for several weights."""
    rng = np.random.default_rng(10)
    sure = rng.beta(5, 1, 80)
    weight = rng.random((3, 80))
    tried = np.geomspace(1e-6, 1, 14_000)

    def likelihood(p):
        return np.log((1 - tried) * p + tried / 4)

    wanted = [
        tried[
            np.argmax(
                sum(w * likelihood(p) for w, p in zip(row, sure, strict=True))
                + added * (likelihood(1.0) + likelihood(0.0))
            )
        ]
        for row in weight
    ]
    np.testing.assert_allclose(likely_doubt(sure, 4, weight, added=added), wanted, rtol=2e-3)


def test_doubt_bounds_what_a_sensor_outweighs_and_names_no_other_label():
    """With labels equally many: (1 - e) p + e / labels, by definition."""
    scores = np.random.default_rng(8).normal(scale=30, size=(50, 6))
    labels = np.array([0, 0, 1, 1, 2, 2])
    plain = label_posterior(scores, labels)[1]
    softened = label_posterior(doubted(scores, labels, doubt=0.06), labels)[1]
    np.testing.assert_allclose(softened, 0.94 * plain + 0.06 / 3, rtol=1e-9)
    uneven = np.array([0, 0, 0, 1, 1, 2])
    plain = label_posterior(scores, uneven)[1]
    softened = label_posterior(doubted(scores, uneven, doubt=0.06), uneven)[1]
    np.testing.assert_allclose(softened, 0.94 * plain + 0.06 / 3, rtol=1e-9)


def test_doubts_of_each_template():
    """log((1 - e) p + e) with p relative to its mean over labels; a doubt of 1 leaves nothing."""
    scores = np.random.default_rng(8).normal(size=(5, 4))
    doubts = np.array([0.0, 0.2, 1.0, 1.0])
    relative = np.exp(scores) / np.exp(scores).mean(axis=1, keepdims=True)
    found = doubted(scores, [0, 0, 1, 1], doubt=doubts)
    np.testing.assert_allclose(found, np.log((1 - doubts) * relative + doubts), rtol=1e-9)
    for wrong, said in (([0.1, 0.2], "has shape"), (1.1, "is 1.1"), (-0.1, "is -0.1")):
        with pytest.raises(ValueError, match=rf"^doubt {said}"):
            doubted(scores, [0, 0, 1, 1], doubt=wrong)


# Sharpness and doubt of scores together


def mistaken(samples, share, seed, distance=3.0):
    """Log densities of looks at four templates, of which a share is of any other template."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(4, size=samples)
    shown = np.where(rng.random(samples) < share, rng.integers(4, size=samples), truth)
    seen = distance * np.eye(4)[shown] + rng.normal(size=(samples, 4))
    return -((seen[:, None] - distance * np.eye(4)) ** 2).sum(axis=2) / 2, truth


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("share", [0.05, 0.3])
def test_sharpness_and_doubt_are_found_together(scale, share):
    """The doubt is the share of mistakes, of 4,000 looks: within four standard errors.

    The sharpness scatters by some 5 % (found by repeating).
    """
    logs, truth = mistaken(4000, share, seed=11)
    sharpness, doubt = fit_sharpness_and_doubt(logs / scale, np.arange(4), truth)
    assert abs(doubt - share) < 4 * np.sqrt(share * (1 - share) / 4000)
    assert sharpness == pytest.approx(scale, rel=0.2)


def test_samples_of_no_weight_have_no_say():
    logs, truth = mistaken(400, 0.2, seed=12)
    weight = np.arange(400) < 200
    both = fit_sharpness_and_doubt(logs, np.arange(4), truth, weight=weight)
    alone = fit_sharpness_and_doubt(logs[:200], np.arange(4), truth[:200])
    np.testing.assert_allclose(both, alone, rtol=1e-3)


def test_noise_outweighs_next_to_nothing_and_a_good_sensor_is_believed():
    """Of 40 sets of pure noise: twice the log-likelihood gained is chi-square, two degrees.

    Held to the quantile of 1e-3 over 40, with the mean gain of an answer that it allows.
    """
    rng = np.random.default_rng(9)
    truth = np.tile([0, 1, 2], 40)
    for _ in range(40):
        noise = rng.normal(size=(120, 3))
        sharpness, doubt = fit_sharpness_and_doubt(noise, [0, 1, 2], truth)
        calm = doubted(sharpness * noise, [0, 1, 2], doubt=doubt)
        posterior = label_posterior(calm, [0, 1, 2])[1]
        gain = np.log(3 * posterior[np.arange(120), truth]).sum()
        assert gain < stats.chi2.isf(1e-3 / 40, 2) / 2
    good = 2.0 * (truth[:, None] == np.arange(3)) + rng.normal(size=(120, 3))
    sharpness, doubt = fit_sharpness_and_doubt(good, [0, 1, 2], truth)
    assert 0.5 * 2.0 < sharpness < 2.0 * 1.5 and doubt < 0.1
    assert fit_sharpness_and_doubt(np.zeros((3, 3)), [0, 1, 2], [0, 1, 2]) == (0.0, 0.0)
    assert fit_sharpness_and_doubt(good, [1, 1, 1], np.ones(120)) == (0.0, 0.0)


def test_what_cannot_be_calibrated_is_refused():
    for truth in ([0], [0, 7], [[0, 1]]):
        with pytest.raises(ValueError, match=r"^truth has shape"):
            fit_sharpness_and_doubt(np.eye(2), [0, 1], truth)
    with pytest.raises(ValueError, match=r"^weight is -1"):
        fit_sharpness_and_doubt(np.eye(2), [0, 1], [0, 1], weight=[1, -1])
