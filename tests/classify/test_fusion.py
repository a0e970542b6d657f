"""Scores of several sensors as one: calibration, and what two sensors know together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import optimize, special, stats

from ncti.classify import fit_sharpness, fuse, label_posterior
from ncti.classify.calibration import fit_sharpness_and_doubt

LABELS = np.repeat([0, 1, 2, 3], 5)  # four ships, five aspects


def looks(rng, samples, *, sigma, size=6, templates=None):
    """True templates, and exact log densities of noisy looks at them."""
    templates = rng.normal(size=(20, size)) if templates is None else templates
    which = rng.integers(0, 20, samples)
    seen = templates[which] + sigma * rng.normal(size=(samples, templates.shape[1]))
    distance = ((seen[:, None] - templates) ** 2).sum(axis=2)
    return which, -distance / (2 * sigma**2), templates


@given(
    arrays(float, (3, 20), elements=st.floats(-1e6, 1e6)),
    st.floats(0, 1e6),
)
def test_probabilities_are_probabilities(scores, sharpness):
    classes, posterior = label_posterior(sharpness * scores, LABELS)
    np.testing.assert_array_equal(classes, [0, 1, 2, 3])
    assert ((posterior >= 0) & (posterior <= 1)).all()
    np.testing.assert_allclose(posterior.sum(axis=1), 1.0)


def test_posterior_is_bayes_rule():
    rng = np.random.default_rng(0)
    scores = rng.normal(size=(7, 20))
    _, posterior = label_posterior(2.0 * scores, LABELS)
    density = np.exp(2.0 * scores).reshape(7, 4, 5).mean(axis=2)
    np.testing.assert_allclose(posterior, density / density.sum(axis=1, keepdims=True))


def test_a_label_with_more_templates_is_no_likelier():
    _, posterior = label_posterior(np.zeros((1, 5)), np.array(["a", "a", "a", "a", "b"]))
    np.testing.assert_allclose(posterior, [[0.5, 0.5]])


@pytest.mark.parametrize("sharpness", [0.0, 0.3, 2.0])
def test_templates_left_out_are_as_if_never_there(sharpness):
    """By one rule for all samples, and by one for each; a label left with none is impossible."""
    rng = np.random.default_rng(6)
    # Those left out are the best by far, beyond what an exponential holds.
    scores = 3 * rng.normal(size=(9, 20))
    hidden = rng.random((9, 20)) < 0.5
    hidden[:, :5], hidden[4, 5:10] = hidden[0, :5], True
    scores[hidden] += 2000
    answers = label_posterior(sharpness * scores, LABELS, exclude=hidden)[1]
    for row, (score, gone, answer) in enumerate(zip(scores, hidden, answers, strict=True)):
        few = score[None, ~gone]
        classes, alone = label_posterior(sharpness * few, LABELS[~gone])
        wanted = np.zeros(4)
        wanted[classes] = alone[0]
        # Sums of 20 terms in another order, over rounding of differences of some 10.
        np.testing.assert_allclose(answer, wanted, rtol=1e-13)
        same = label_posterior(sharpness * scores[[row]], LABELS, exclude=gone)[1]
        np.testing.assert_allclose(same[0], answer, rtol=1e-13)
    assert answers[4, 1] == 0


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1.0, 50.0, 1e9])
def test_exact_densities_are_found_to_be_exact(scale):
    """Scores that are log densities over a scale have that scale as their sharpness.

    The maximum-likelihood estimate scatters by 1 / sqrt(n I): some 3 % for 4,000 looks here,
    found by repeating; 10 % is beyond three of them.
    """
    rng = np.random.default_rng(1)
    which, logs, _ = looks(rng, 4000, sigma=1.5)
    found = fit_sharpness(logs / scale, LABELS, LABELS[which])
    assert found == pytest.approx(scale, rel=0.1)
    # Nothing but the unit of the scores changes, so all are one number: to the search's tolerance.
    alone = fit_sharpness(logs, LABELS, LABELS[which])
    assert found == pytest.approx(scale * alone, rel=1e-4)


def apart(rng, samples, distance):
    """Exact log densities of looks at two templates so many standard deviations apart."""
    truth = np.arange(samples) % 2
    seen = truth * distance + rng.normal(size=samples)
    return -((seen[:, None] - [0.0, distance]) ** 2) / 2, truth


@pytest.mark.parametrize("distance", [4.0, 6.0, 8.0, 20.0])
def test_what_is_always_right_is_no_certainty(distance):
    """124 looks, mostly all right: the fit is what the targets (n + 1)/(n + 2) ask for.

    Of two labels, whose log ratios are x, for the true one: the derivative of the mean surprise,
    x (1/(1 + exp(-s x)) - (n + 1)/(n + 2)), is zero on average. Where no answer is in doubt, s x
    is about log(n + 1) for the mean x of distance^2 / 2; it is above that only by the scatter of
    x, whose relative standard deviation is 2 / distance.
    """
    rng = np.random.default_rng(7)
    for _ in range(40):
        logs, truth = apart(rng, 124, distance)
        found = fit_sharpness(logs, [0, 1], truth)
        ratio = (logs[:, 1] - logs[:, 0]) * np.where(truth == 1, 1, -1)

        def slope(sharpness, ratio=ratio):
            return np.mean(ratio * (special.expit(sharpness * ratio) - 125 / 126))

        # The search stops at 1e-5 of the logarithm.
        wanted = optimize.brentq(slope, 1e-6, 100)
        assert found == pytest.approx(wanted, rel=1e-4)
        if distance >= 6:
            alike = np.log(125) / (distance**2 / 2)
            assert alike * (1 - 6 / distance / np.sqrt(124)) < found < alike * (1 + 2 / distance)


def test_a_sensor_that_is_always_right_does_not_drown_another():
    """Looks that are all right tell that the next is by 125 to 1: so much does their score count.

    It says label 1, the log densities of another sensor say label 0 by 2.5 log(126): they win.
    """
    rng = np.random.default_rng(8)
    logs, truth = apart(rng, 124, 8.0)
    sharpness = fit_sharpness(100 * logs, [0, 1], truth)
    sure = np.array([[0.0, -2.5 * np.log(126)]])
    wrong = np.array([[-3200.0, 0.0]])  # 100 times 8^2 / 2
    both = label_posterior(fuse(sure, wrong, sharpness=(1.0, sharpness)), [0, 1])[1]
    assert both[0, 0] > 0.99


def smoothed_surprise(scores, labels, truth, sharpness):
    """Mean over samples of -sum over labels of wanted times log probability, by definition."""
    classes, posterior = label_posterior(sharpness * scores, labels)
    miss = 1 / (len(truth) + 2)
    wanted = np.full(posterior.shape, miss / (len(classes) - 1))
    wanted[np.arange(len(truth)), np.searchsorted(classes, truth)] = 1 - miss
    return -np.mean(np.sum(wanted * np.log(posterior), axis=1))


def several_labels():
    """Three labels of unlike numbers of templates, 40 samples of which most are right."""
    rng = np.random.default_rng(9)
    labels, truth = np.array([0, 0, 0, 0, 1, 2, 2]), rng.integers(0, 3, 40)
    return rng.normal(size=(40, 7)) + 2.5 * (truth[:, None] == labels), labels, truth


def one_far_template():
    """What tells labels apart is a millionth of the spread of scores."""
    scores, labels, truth = several_labels()
    far = np.full((40, 1), -1e7)
    return np.hstack([scores, far]), np.append(labels, 2), truth


def a_hill_before_the_valley():
    """The mean of the true label's templates is below the other's, the best of them just above."""
    return np.tile([0.0, -1.0, -0.002], (10, 1)), np.array([0, 0, 1]), np.zeros(10, int)


@pytest.mark.parametrize("made", [several_labels, one_far_template, a_hill_before_the_valley])
def test_no_other_sharpness_makes_more_of_the_true_labels(made):
    """Within what rounding of a mean tells: of nine decades about it in steps of 1 %."""
    scores, labels, truth = made()
    found = fit_sharpness(scores, labels, truth)
    assert found > 0.1
    tried = found * np.concatenate([[1.0], np.geomspace(1e-6, 1e3, 2080)])
    with np.errstate(divide="ignore"):  # where a label's probability is 0
        surprises = [smoothed_surprise(scores, labels, truth, sharpness) for sharpness in tried]
    assert surprises[0] <= min(surprises[1:]) + 1e-12


def test_one_label_needs_no_sharpness():
    assert fit_sharpness(np.random.default_rng(0).normal(size=(5, 3)), [4, 4, 4], [4] * 5) == 0.0


def test_scores_without_sense_count_for_little():
    """Pure noise on 2,000 looks: twice the gain in log-likelihood is chi-square, one degree.

    To the second order the posterior is off 1/4 by sharpness times differences in score, and the
    gain is n/2 times the mean of its variance over it: held to the quantile of 1e-4.
    """
    rng = np.random.default_rng(2)
    which, logs, _ = looks(rng, 2000, sigma=1.5)
    noise = rng.normal(size=logs.shape)
    sharpness = fit_sharpness(noise, LABELS, LABELS[which])
    _, posterior = label_posterior(sharpness * noise, LABELS)
    information = 2000 * np.mean(np.sum((posterior - 0.25) ** 2 / 0.25, axis=1))
    assert information < stats.chi2.isf(1e-4, 1)
    assert fit_sharpness(np.zeros((5, 20)), LABELS, LABELS[:5]) == 0.0


def test_calibrated_probabilities_come_true():
    """Scores in wrong units, calibrated on other looks: frequencies by tenths of probability.

    8,000 answers; chi-square over the tenths at a level of 1e-3, probabilities as they are.
    """
    rng = np.random.default_rng(3)
    which, logs, templates = looks(rng, 4000, sigma=1.5)
    sharpness = fit_sharpness(logs / 40, LABELS, LABELS[which])
    which, logs, _ = looks(rng, 8000, sigma=1.5, templates=templates)
    _, posterior = label_posterior(sharpness * logs / 40, LABELS)
    named, certain = posterior.argmax(axis=1), posterior.max(axis=1)
    right = named == LABELS[which]
    tenth = np.digitize(certain, np.arange(0.3, 1.0, 0.1))
    terms = []
    for k in np.unique(tenth):
        p, n, hits = certain[tenth == k].mean(), (tenth == k).sum(), right[tenth == k].sum()
        variance = (certain[tenth == k] * (1 - certain[tenth == k])).sum()
        if n >= 50 and variance > 5:
            terms.append((hits - n * p) ** 2 / variance)
    assert len(terms) >= 5
    assert sum(terms) < stats.chi2.isf(1e-3, len(terms))


def test_two_sensors_together_are_the_sensor_with_both_views():
    """Independent halves of one look: the sum of their scores is its own score."""
    rng = np.random.default_rng(4)
    templates = rng.normal(size=(20, 8))
    seen = templates[rng.integers(0, 20, 50)] + rng.normal(size=(50, 8))
    halves = [
        -((seen[:, None, part] - templates[:, part]) ** 2).sum(axis=2) / 2
        for part in (slice(0, 3), slice(3, 8))
    ]
    whole = halves[0] + halves[1]
    both = fuse(*halves, sharpness=(1.0, 1.0))
    np.testing.assert_allclose(np.diff(both, axis=1), np.diff(whole, axis=1), atol=1e-9)


def loses(ours, theirs, level):
    """Whether fewer of the same answers are right than of others, by McNemar's exact test.

    Of answers that only one of them has right, half would be ours.
    """
    won, lost = (ours & ~theirs).sum(), (theirs & ~ours).sum()
    return won + lost > 0 and stats.binomtest(int(won), int(won + lost), 0.5, "less").pvalue < level


def test_sensors_of_unlike_worth_lose_nothing_together():
    """A good and a useless one, calibrated: no fewer right than the good one, at 1e-3.

    The same test finds the loss where the useless one counts for half of what the good one does.
    """
    rng = np.random.default_rng(5)
    which, logs, _ = looks(rng, 4000, sigma=1.0)
    useless = 100 * rng.normal(size=logs.shape)
    half, rest = slice(0, 2000), slice(2000, None)
    truth = LABELS[which]
    fitted = tuple(fit_sharpness(s[half], LABELS, truth[half]) for s in (logs, useless))

    def right(*sharpness):
        scores = fuse(logs[rest], useless[rest], sharpness=sharpness)
        return label_posterior(scores, LABELS)[1].argmax(axis=1) == truth[rest]

    alone = right(1.0, 0.0)
    assert not loses(right(*fitted), alone, 1e-3)
    assert loses(right(1.0, 0.5 * logs.std() / useless.std()), alone, 1e-3)


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"^scores has shape"):
        label_posterior(np.zeros((2, 3)), [0, 1])
    with pytest.raises(ValueError, match=r"^exclude has shape \(3,\), but must be \(2, 4\) or"):
        label_posterior(np.zeros((2, 4)), [0, 1, 2, 3], exclude=[True, False, False])
    for everything in (True, [[False, True], [True, True]]):
        with pytest.raises(ValueError, match=r"^exclude leaves out all templates"):
            label_posterior(np.zeros((2, 2)), [0, 1], exclude=everything)
    with pytest.raises(ValueError, match=r"^truth has"):
        fit_sharpness(np.zeros((2, 3)), [0, 1, 2], [0, 7])
    with pytest.raises(ValueError, match=r"^scores have shapes"):
        fuse(np.zeros((2, 3)), np.zeros((2, 4)), sharpness=(1.0, 1.0))
    with pytest.raises(ValueError, match=r"^scores"):
        label_posterior(np.full((1, 2), np.nan), [0, 1])
    for sharpness in (np.nan, -1.0, np.inf):
        with pytest.raises(ValueError, match=r"^sharpness is"):
            fuse(np.zeros((2, 2)), np.zeros((2, 2)), sharpness=(1.0, sharpness))
    for sharpness in (1.0, (1.0, 1.0), ()):
        with pytest.raises(ValueError, match=r"^scores have shapes"):
            fuse(np.zeros((2, 2)), sharpness=sharpness)
    with pytest.raises(ValueError, match=r"^scores have shapes"):
        fuse(np.zeros(2), np.zeros(2), sharpness=(1.0, 1.0))
    for truth in ([0], [0, 0, 0], 0, [[0, 0]]):
        with pytest.raises(ValueError, match=r"^truth has shape"):
            fit_sharpness(np.zeros((2, 2)), [0, 1], truth)
    for fit in (fit_sharpness, fit_sharpness_and_doubt):
        with pytest.raises(ValueError, match=r"^truth has shape \(0,\)"):
            fit(np.zeros((0, 2)), [0, 1], [])
    with pytest.raises(ValueError, match=r"^scores has shape"):
        fit_sharpness(np.zeros(2), [0, 1], [0])
