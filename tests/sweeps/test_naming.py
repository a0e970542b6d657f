"""Classifiers of range profiles in one cell, on profiles made up, against answers by hand."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from made_profiles import (
    ASPECTS,
    BINS,
    FLOOR,
    FRAMES,
    OF_A_SETTING,
    REPLICATES,
    SHIPS,
    VIEWS,
    bands,
    dense,
    directions,
    kept,
    made,
    name_by,
    of_tests,
)
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from ncti.classify import CorrelationNeighbour, GaussianTemplates
from sweeps.classifier_schema import ClassifierConfig
from sweeps.naming import Profiles, name_by_likelihood

CLASSIFIERS = ("mnn", "correlation", "likelihood")


# What a variable holds where a view is not there.
FILLS = {"similarity": np.nan, "probability": np.nan}


@pytest.mark.parametrize(
    ("training", "left_out"), list(product(("expected", "noisy"), (False, True)))
)
def test_correlation_by_hand(training, left_out):
    profiles = made(noise=5.0)
    answers = name_by(
        "correlation", profiles, training=["expected", "noisy"], left_out=[False, True]
    )
    i, j = ("expected", "noisy").index(training), int(left_out)
    tests, expected = directions(profiles.averaged), directions(profiles.expected)
    for r, n, view in np.ndindex(REPLICATES, len(FRAMES), VIEWS):
        best, name = -2.0, -1
        sources = (
            [expected]
            if training == "expected"
            else [tests[k, n] for k in range(REPLICATES) if k != r]
        )
        for learned, other in product(sources, range(VIEWS)):
            if left_out and other % len(ASPECTS) == view % len(ASPECTS):
                continue
            cosine = learned[other] @ tests[r, n, view]
            if cosine > best:
                best, name = cosine, other // len(ASPECTS)
        place = (i, j, r, n, *divmod(view, len(ASPECTS)))
        assert answers["predicted"][place] == name
        assert answers["correct"][place] == (name == place[-2])
        # A unit in the last place of float32, below 1.
        assert answers["similarity"][place] == pytest.approx(best, abs=2**-24)
    # Neither all right nor all wrong: a wrong rule would show.
    assert 0 < answers["correct"][i, j].mean() < 1


def test_correlation_learns_noise_of_other_replicates_alone():
    profiles = made(noise=3.0)
    before = name_by("correlation", profiles, training="noisy")
    assert before["similarity"].max() < 0.99
    assert before["correct"].min() == 0
    # The tested replicate in place of another: every view finds itself.
    averaged = profiles.averaged.copy()
    averaged[1] = averaged[0]
    after = name_by("correlation", replace(profiles, averaged=averaged), training="noisy")
    np.testing.assert_allclose(after["similarity"][:, :, :2], 1, atol=2**-23)
    assert after["correct"][:, :, :2].all()
    # All of the tested replicate but one view, and all of the other number of frames, changed.
    for view in (0, 7, VIEWS - 1):
        averaged = profiles.averaged.copy()
        others = np.arange(VIEWS) != view
        averaged[0, :, others] = averaged[0, :, others][:, :, ::-1]
        averaged[:, 1] = averaged[:, 1, :, ::-1]
        after = name_by("correlation", replace(profiles, averaged=averaged), training="noisy")
        place = (0, 0, 0, 0, *divmod(view, len(ASPECTS)))
        for name in before:
            assert after[name][place] == before[name][place]
        # They are learned where another replicate is tested.
        assert np.any(after["similarity"][:, :, 1, 0] != before["similarity"][:, :, 1, 0])


@pytest.mark.parametrize("classifier", ["expected", "noisy", "likelihood"])
def test_nothing_is_learned_of_an_aspect_that_is_left_out(classifier):
    """Profiles of all ships at it may be anything; without leaving out, they matter."""
    name, settings = "likelihood", {"left_out": [False, True]}
    if classifier != "likelihood":
        name, settings = "correlation", settings | {"training": classifier}
    profiles = made(noise=0.6)
    measure = {"correlation": "similarity", "likelihood": "probability"}[name]
    before = name_by(name, profiles, **settings)
    for column in range(len(ASPECTS)):
        there = profiles.aspect == column
        expected, averaged = profiles.expected.copy(), profiles.averaged.copy()
        if classifier == "noisy":
            averaged[1:, :, there] = averaged[1:, :, there][..., ::-1]
        else:
            expected[there] = expected[there][:, ::-1]
        after = name_by(name, replace(profiles, expected=expected, averaged=averaged), **settings)
        for kind in before:
            tested = before[kind][:, :, 0, ..., column], after[kind][:, :, 0, ..., column]
            np.testing.assert_array_equal(*(values[:, 1] for values in tested))
            if kind == measure:
                assert np.any(tested[0][:, 0] != tested[1][:, 0], axis=(0, 1, 2)).all()
    # Left out, the others answer, and are less alike.
    assert np.mean(before[measure][:, 0]) > np.mean(before[measure][:, 1]) + 0.1
    if name == "correlation":
        assert np.all(before[measure][:, 0] >= before[measure][:, 1])


@pytest.mark.parametrize("classifier", ["correlation", "likelihood"])
def test_one_aspect_cannot_be_left_out(classifier):
    profiles = made()
    only = np.zeros_like(profiles.there)
    only[:, 2] = True
    for alone in (kept(profiles, only), replace(profiles, learned=only)):
        for left_out in (True, [False, True]):
            with pytest.raises(ValueError, match=r"^classifier\.left_out has True, but must be "):
                name_by(classifier, alone, left_out=left_out)
        assert name_by(classifier, alone, left_out=False)["correct"][..., only].all()


@pytest.mark.parametrize("classifier", ["expected", "noisy", "likelihood", "mnn"])
def test_views_that_are_not_learned_are_named_alone(classifier):
    """What they would teach may be anything; what they are tested with has an answer."""
    name, settings = classifier, {"left_out": [False, True]}
    if classifier == "mnn":
        settings = {"epochs": 300}
    elif classifier != "likelihood":
        name, settings = "correlation", settings | {"training": classifier}
    learned = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    learned[2] = learned[:, 1] = False
    profiles = replace(made(), learned=learned)
    before = name_by(name, profiles, **settings)
    expected, averaged = profiles.expected.copy(), profiles.averaged.copy()
    untaught = ~learned.ravel()
    expected[untaught] = expected[untaught][:, ::-1]
    if classifier == "noisy":  # as learned where replicate 0 is tested
        averaged[1:, :, untaught] = averaged[1:, :, untaught][..., ::-1]
    after = name_by(name, replace(profiles, expected=expected, averaged=averaged), **settings)
    for kind, values in before.items():
        if kind in OF_A_SETTING or not of_tests(kind):
            np.testing.assert_array_equal(after[kind], values)
            continue
        first = values, after[kind]
        if classifier == "noisy":
            first = tuple(found[:, :, :1] for found in first)
        np.testing.assert_array_equal(*first)
        assert np.all(values >= 0)
    # A ship that nobody taught is named as another; a learned one is known at learned aspects.
    assert np.all(np.isin(before["predicted"], (0, 1)))
    assert not before["correct"][..., 2, :].any()
    right = before["ship_correct" if name == "mnn" else "correct"]
    assert (right if name == "mnn" else right[:, :1])[..., learned].all()
    if name == "mnn":
        assert np.all(before["training_correct"][..., ~learned] == -1)
        assert np.all(before["training_correct"][..., learned] >= 0)
    if name == "likelihood":
        assert np.all(before["probability"][..., 2, :] == 0)


@pytest.mark.parametrize("training", ["expected", "noisy"])
def test_of_equal_profiles_the_first_ship_answers(training):
    """Ship 2 looks like ship 0 to all bits; products round as their places in a matrix have it."""
    profiles = made(noise=3.0)
    expected, averaged = profiles.expected.copy(), profiles.averaged.copy()
    third = 2 * len(ASPECTS)
    expected[third:], averaged[:, :, third:] = (
        expected[: len(ASPECTS)],
        averaged[:, :, : len(ASPECTS)],
    )
    twins = replace(profiles, expected=expected, averaged=averaged)
    answers = name_by("correlation", twins, training=training)
    assert set(np.unique(answers["predicted"])) == {0, 1}


def test_expected_profiles_are_taken_once(monkeypatch):
    """However many replicates and numbers of frames are named by them."""
    fitted = []
    monkeypatch.setattr(CorrelationNeighbour, "fit", count_calls(CorrelationNeighbour.fit, fitted))
    name_by("correlation", made(), left_out=[False, True])
    assert len(fitted) == 1
    name_by("correlation", made(), training="noisy")
    assert len(fitted) == 1 + REPLICATES * len(FRAMES)


def count_calls(function, calls):
    def counted(*arguments):
        calls.append(None)
        return function(*arguments)

    return counted


def test_a_flat_profile_names_no_ship_by_correlation():
    profiles = made()
    averaged = profiles.averaged.copy()
    averaged[0, 0, 4] = 7.0
    answers = name_by("correlation", replace(profiles, averaged=averaged))
    place = (0, 0, 0, 0, 0, 4)
    found = [answers[name][place] for name in ("predicted", "correct", "similarity")]
    assert found == [-1, 0, 0]
    others = np.ones_like(answers["correct"], dtype=bool)
    others[place] = False
    assert answers["correct"][others].all()


def test_a_flat_profile_that_was_learned_answers_for_none():
    """Its cosine of 0 is more than those of profiles that are opposite."""
    expected = np.full((2, BINS), FLOOR, dtype=np.float32)
    expected[1, 20:30] += 1
    test = np.full(BINS, FLOOR, dtype=np.float32)
    test[40], test[20:30] = FLOOR + 1, FLOOR - 0.5
    averaged = np.broadcast_to(test, (1, 1, 2, BINS))
    profiles = Profiles(expected, averaged, np.ones((2, 1), dtype=bool), np.zeros(1), (4,))
    answers = name_by("correlation", profiles)
    assert answers["predicted"].ravel().tolist() == [1, 1]
    # (-0.5 * 10) / (sqrt(10) sqrt(1 + 10 / 4))
    np.testing.assert_allclose(answers["similarity"], -5 / np.sqrt(35), rtol=1e-6)


@pytest.mark.parametrize("gain_sigma", [0.0, 0.7])
def test_likelihood_by_hand(gain_sigma):
    """Densities of a Gaussian with gain and floor as two more directions of its covariance.

    Each view has a floor of its own, which no gain changes.
    """
    profiles = made(noise=5.0)
    floors = np.linspace(0, 5, VIEWS, dtype=np.float32)[:, None]
    profiles = replace(
        profiles, expected=profiles.expected + floors, averaged=profiles.averaged + floors
    )
    nugget = 0.02
    covariance = bands(profiles, variance=25.0)
    answers = name_by_likelihood(
        profiles,
        covariance,
        classifier=ClassifierConfig(gain_sigma=[0.0, 0.7], left_out=[False, True], nugget=nugget),
    )
    variance = covariance[:, 0].mean(dtype=np.float64)
    shift = GaussianTemplates().floor_sigma ** 2 * variance * np.ones((BINS, BINS))
    samples = profiles.averaged.astype(np.float64)
    logs = np.empty((REPLICATES, len(FRAMES), VIEWS, VIEWS))
    for n, view in np.ndindex(len(FRAMES), VIEWS):
        mean = profiles.expected[view].astype(np.float64)
        signal = gain_sigma * (mean - mean[0])
        frame = (dense(covariance[view]) + nugget * variance * np.eye(BINS)) / FRAMES[n]
        density = multivariate_normal(mean, frame + np.outer(signal, signal) + shift)
        logs[:, n, :, view] = density.logpdf(samples[:, n])
    ship, aspect = np.divmod(np.arange(VIEWS), len(ASPECTS))
    for j, left_out in enumerate((False, True)):
        answering = ~((aspect[:, None] == aspect) & left_out)
        of_ship = np.stack(
            [
                logsumexp(logs, axis=-1, b=answering & (ship == s))
                - np.log((answering & (ship == s)).sum(axis=-1))
                for s in range(SHIPS)
            ],
            axis=-1,
        )
        posterior = np.exp(of_ship - logsumexp(of_ship, axis=-1, keepdims=True))
        found = answers["probability"][int(gain_sigma > 0), j].reshape(*logs.shape[:3])
        # Logarithms of some 100 err by 1e-13 of it times the condition of the covariances, 1e4.
        np.testing.assert_allclose(found, posterior[..., np.arange(VIEWS), ship], atol=1e-6)
        named = answers["predicted"][int(gain_sigma > 0), j].reshape(*logs.shape[:3])
        np.testing.assert_array_equal(named, posterior.argmax(axis=-1))
        assert np.mean((found > 0.05) & (found < 0.95)) > 0.2  # many of them are in doubt
    right = answers["correct"] == 1
    np.testing.assert_array_equal(right, answers["predicted"] == np.arange(SHIPS)[:, None])
    # Whoever has more than half is named.
    assert right[answers["probability"] > 0.5].all()
    assert not right[answers["probability"] < 1 / SHIPS].any()


# Which views are lost: a ship, an aspect beside another of its group.
LOST = {"ship": (slice(2, None), slice(None)), "aspect": (slice(None), slice(3, 4))}


@pytest.mark.parametrize("classifier", CLASSIFIERS)
@pytest.mark.parametrize("lost", LOST)
def test_views_that_are_not_there_are_filled_and_change_nothing_else(classifier, lost):
    """The answers are those of a grid that never had them."""
    profiles = made(noise=1.0)
    there = np.ones_like(profiles.there)
    there[LOST[lost]] = False
    partial = kept(profiles, there)
    rows, columns = there.any(axis=1), there.any(axis=0)
    smaller = replace(
        partial, there=there[np.ix_(rows, columns)], aspects=profiles.aspects[columns]
    )
    answers, wanted = (name_by(classifier, given) for given in (partial, smaller))
    assert set(answers) == set(wanted)
    for name, values in answers.items():
        if name in OF_A_SETTING:
            np.testing.assert_array_equal(values, wanted[name])
            continue
        assert values.shape[-2:] == there.shape
        fill = FILLS.get(name, -1)
        np.testing.assert_array_equal(values[..., ~there], np.full_like(values[..., ~there], fill))
        kept_ones = values[..., rows, :][..., columns]
        np.testing.assert_array_equal(kept_ones, wanted[name])
        assert np.all(kept_ones >= 0)


@pytest.mark.parametrize("classifier", CLASSIFIERS)
def test_a_single_view_that_is_not_there(classifier):
    profiles = made(noise=0.1)
    there = np.ones_like(profiles.there)
    there[1, 4] = False
    settings = {"epochs": 2000, "tolerance": 0.1} if classifier == "mnn" else {}
    answers = name_by(classifier, kept(profiles, there), **settings)
    assert np.all(answers["correct"][..., ~there] == -1)
    assert np.all(answers["predicted"][..., ~there] == -1)
    ship = np.broadcast_to(np.arange(SHIPS)[:, None], there.shape)
    # Views that are there keep their ships: at this noise all of them are known.
    named = answers["predicted"][..., there]
    np.testing.assert_array_equal(named, np.broadcast_to(ship[there], named.shape))
    assert np.all(answers["correct"][..., there] == 1)


def test_views_go_by_ship_then_aspect():
    profiles = made()
    assert profiles.ship.tolist() == [s for s in range(SHIPS) for _ in ASPECTS]
    assert profiles.aspect.tolist() == [*range(len(ASPECTS))] * SHIPS
    there = np.array([[True, False, True], [False, True, False]])
    some = replace(profiles, there=there)
    assert some.ship.tolist() == [0, 0, 1]
    assert some.aspect.tolist() == [0, 2, 1]
    spread = some.spread(np.array([[1, 2, 3], [4, 5, 6]]), -1, np.int16)
    assert spread.tolist() == [[[1, -1, 2], [-1, 3, -1]], [[4, -1, 5], [-1, 6, -1]]]
    assert spread.dtype == np.int16


@pytest.mark.parametrize("classifier", CLASSIFIERS)
def test_profiles_are_left_as_they_are(classifier):
    profiles = made()
    for array in (profiles.expected, profiles.averaged, profiles.there, profiles.aspects):
        array.setflags(write=False)
    answers = name_by(classifier, profiles)
    assert all(np.isfinite(values).all() for values in answers.values())
