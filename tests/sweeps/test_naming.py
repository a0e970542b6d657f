"""Classifiers of range profiles in one cell, on profiles made up here, against answers by hand."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal
from test_classifier_configuration import configured

from ncti.classify import GainAnnealedNetwork, GaussianTemplates
from sweeps import graph, naming
from sweeps.classifier_schema import ClassifierConfig, NetworkConfig
from sweeps.naming import Profiles, name_by_correlation, name_by_likelihood, name_by_network
from sweeps.seeds import cell_rng

SHIPS = 3
# Both sides of every edge between aspect groups, and their numbers.
ASPECTS = (0.0, 29.9, 30.0, 59.9, 60.0, 90.0)
GROUP = np.array([0, 0, 1, 1, 2, 2])
FRAMES = (4, 16)
REPLICATES = 3
BINS = 60
EDGE = 5  # bins at either end, 8 % of them, that no ship reaches
FLOOR = 5.0
VIEWS = SHIPS * len(ASPECTS)
SEED = 100

# Of one frame, with noise in two neighbouring bins and a variance that differs between views.
BAND = np.array([1.0, 0.4, 0.1])


def made(noise=0.3, seed=0):
    """Profiles of distinct views on a floor, and averages with white noise."""
    rng = np.random.default_rng(seed)
    expected = np.full((VIEWS, BINS), FLOOR)
    expected[:, EDGE:-EDGE] += rng.exponential(size=(VIEWS, BINS - 2 * EDGE))
    deviation = noise / np.sqrt(np.array(FRAMES))[:, None, None]
    averaged = expected + deviation * rng.standard_normal((REPLICATES, len(FRAMES), VIEWS, BINS))
    there = np.ones((SHIPS, len(ASPECTS)), dtype=bool)
    return Profiles(
        expected.astype(np.float32), averaged.astype(np.float32), there, np.array(ASPECTS), FRAMES
    )


def bands(profiles, variance=0.1):
    """(view, lag, bin): a covariance of one frame for every view."""
    scale = variance * (1 + 0.01 * np.arange(len(profiles.expected)))
    whole = scale[:, None, None] * np.broadcast_to(BAND[:, None], (len(BAND), BINS))
    whole = whole.copy()
    for lag in range(1, len(BAND)):
        whole[:, lag, BINS - lag :] = 0
    return whole.astype(np.float32)


def name_by(classifier, profiles, **settings):
    """Answers of a classifier by its name."""
    if classifier == "mnn":
        network = NetworkConfig(**{"epochs": 40, **settings})
        config = ClassifierConfig(mnn=network)
        return name_by_network(profiles, classifier=config, random_state=SEED)
    config = ClassifierConfig(**settings)
    if classifier == "correlation":
        return name_by_correlation(profiles, classifier=config)
    return name_by_likelihood(profiles, bands(profiles), classifier=config)


CLASSIFIERS = ("mnn", "correlation", "likelihood")
# What a variable holds where a view is not there.
FILLS = {"similarity": np.nan, "probability": np.nan}
OF_A_SETTING = {"presentations", "hidden", "loss"}


def directions(profiles):
    """Profile vectors of unit length, from their definition."""
    values = np.asarray(profiles, dtype=np.float64)
    ends = np.concatenate([values[..., :EDGE], values[..., -EDGE:]], axis=-1)
    above = values - ends.mean(axis=-1, keepdims=True)
    return above / np.linalg.norm(above, axis=-1, keepdims=True)


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


def kept(profiles, there):
    """Some views of profiles, the others not there."""
    chosen = there[profiles.there]
    return replace(
        profiles,
        expected=profiles.expected[chosen],
        averaged=profiles.averaged[:, :, chosen],
        there=there,
    )


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


def dense(band):
    """The covariance that a band of lags stands for."""
    whole = np.diag(band[0].astype(np.float64))
    for lag in range(1, len(band)):
        beside = np.diag(band[lag, : BINS - lag].astype(np.float64), lag)
        whole += beside + beside.T
    return whole


@pytest.mark.parametrize("gain_sigma", [0.0, 0.7])
def test_likelihood_by_hand(gain_sigma):
    """Densities of a Gaussian with gain and floor as two more directions of its covariance."""
    profiles = made(noise=5.0)
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
        signal = gain_sigma * (mean - FLOOR)
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


def test_network_knows_ship_and_aspect_group():
    """Trained until it knows every view, then shown views of other ships and other groups."""
    profiles = made()
    views = np.arange(VIEWS).reshape(SHIPS, len(ASPECTS))
    other_group = np.roll(views, 2, axis=1)
    other_ship = np.roll(views, 1, axis=0)
    shown = np.stack([views.ravel(), other_group.ravel(), other_ship.ravel()])
    averaged = profiles.expected[shown][:, None].repeat(len(FRAMES), axis=1)
    answers = name_by(
        "mnn",
        replace(profiles, averaged=averaged),
        epochs=2000,
        learning_rate=0.02,
        tolerance=0.1,
    )
    settings = (0,) * 6
    assert answers["training_correct"][settings].all()
    assert answers["loss"][settings] <= 0.1**2
    ship = np.broadcast_to(np.arange(SHIPS)[:, None], views.shape)
    group = np.broadcast_to(GROUP, views.shape)
    for r, (shown_ship, shown_group) in enumerate(
        [(ship, group), (ship, np.roll(group, 2, axis=1)), (np.roll(ship, 1, axis=0), group)]
    ):
        for n in range(len(FRAMES)):
            seen = {name: answers[name][(*settings, r, n)] for name in answers if of_tests(name)}
            np.testing.assert_array_equal(seen["predicted"], shown_ship)
            np.testing.assert_array_equal(seen["predicted_bin"], shown_group)
            np.testing.assert_array_equal(seen["ship_correct"], shown_ship == ship)
            np.testing.assert_array_equal(
                seen["correct"], (shown_ship == ship) & (shown_group == group)
            )


def of_tests(name):
    """Whether a variable is of the tests, not of the training."""
    return name not in OF_A_SETTING and not name.startswith("training_")


def test_every_setting_of_the_network_is_the_librarys():
    profiles = made(noise=1.0)
    axes = {
        "epochs": [20, 30],
        "grow_every": [5],
        "learning_rate": [0.01, 0.05],
        "tolerance": [0.5],
        "inputs": ["raw", "floor_removed", "standardised"],
        "annealing": [True, False],
    }
    answers = name_by("mnn", profiles, **axes, max_hidden=4)
    shape = tuple(map(len, axes.values()))
    truth = np.arange(SHIPS)[:, None] * 3 + GROUP
    scale = directions(profiles.expected)
    vectors = scale / scale.max(axis=-1, keepdims=True)
    scale = directions(profiles.averaged)
    seen = scale / scale.max(axis=-1, keepdims=True)
    for place, setting in zip(np.ndindex(shape), product(*axes.values()), strict=True):
        given = dict(zip(axes, setting, strict=True))
        inputs = given.pop("inputs")
        network = GainAnnealedNetwork(
            **given,
            max_hidden=4,
            scaling="common" if inputs == "standardised" else "none",
            random_state=SEED,
        )
        with pytest.warns(match="raise epochs"):
            network.fit(profiles.expected if inputs == "raw" else vectors, truth.ravel())
        assert answers["presentations"][place] == given["epochs"]
        assert answers["hidden"][place] == min(4, (given["epochs"] - 1) // 5 + 1)
        assert answers["loss"][place] == pytest.approx(network.loss_curve_[-1], rel=1e-6)
        tests = profiles.averaged if inputs == "raw" else seen
        named = network.predict(tests.reshape(-1, BINS)).reshape(
            REPLICATES, len(FRAMES), *truth.shape
        )
        np.testing.assert_array_equal(answers["predicted"][place], named // 3)
        np.testing.assert_array_equal(answers["predicted_bin"][place], named % 3)
        np.testing.assert_array_equal(answers["correct"][place], named == truth)
        learned = network.predict(profiles.expected if inputs == "raw" else vectors)
        np.testing.assert_array_equal(
            answers["training_correct"][place], learned.reshape(truth.shape) == truth
        )
    assert 0 < answers["correct"].mean() < 1


def test_the_seed_decides_what_a_network_becomes():
    profiles = made(noise=1.0)
    config = ClassifierConfig(mnn=NetworkConfig(epochs=10))
    first, again, other = (
        name_by_network(profiles, classifier=config, random_state=seed) for seed in (1, 1, 2)
    )
    for name, values in first.items():
        np.testing.assert_array_equal(again[name], values)
    assert np.all(other["loss"] != first["loss"])


def test_a_setting_does_not_depend_on_the_others():
    """Each of several settings is what it is alone, from the same first weights."""
    profiles = made(noise=1.0)
    several = {"epochs": [5, 12], "inputs": ["raw", "standardised"], "annealing": [True, False]}
    whole = name_by("mnn", profiles, **several)
    for place in np.ndindex(2, 2, 2):
        values = (kept[k] for kept, k in zip(several.values(), place, strict=True))
        alone = name_by("mnn", profiles, **dict(zip(several, values, strict=True)))
        epochs, inputs, annealing = place
        for name, answers in alone.items():
            of_it = whole[name][epochs, 0, 0, 0, inputs, annealing]
            np.testing.assert_array_equal(answers[(0,) * 6], of_it)


def named_cells(monkeypatch, *overrides):
    """Answers of every cell of a sweep by the multilayered network, by the cell's values.

    A cell's profiles are made up from its values, so that they do not depend on the grid.
    """
    config = configured("classifier.name=mnn", "grid.ship=[duncan,horne]", *overrides)
    found = {}

    def cell_profiles(_, place):
        (cell,) = (cell for cell in graph.cells(config) if cell.place == place)
        rng = cell_rng(0, stage="made up", **cell.values)
        expected = FLOOR + rng.exponential(size=(2, 2, BINS))
        return expected, expected + 0.5 * rng.standard_normal((1, 1, 2, 2, BINS))

    monkeypatch.setattr(graph.store, "read_profiles", cell_profiles)
    monkeypatch.setattr(graph.store, "views_done", lambda *_: np.ones((2, 2), dtype=bool))
    for cell in graph.cells(config):
        key = tuple(cell.values[name] for name in ("pulse_width", "range", "target_free_ifovs"))
        monkeypatch.setattr(
            graph.store, "write_cell", lambda *given, key=key: found.update({key: given[-1]})
        )
        graph._name_profiles(cell, config.classifier, None, config)
    return found


SEVERAL = (
    *("grid.pulse_width=[10,30]", "grid.range=[50,100]", "ladar.target_free_ifovs=[0,4000]"),
    *("grid.aspect=[0,90]", "grid.frame_count=4"),
    *("classifier.mnn.epochs=[5,12]", "classifier.mnn.annealing=[true,false]"),
)


def test_a_part_of_the_grid_has_the_answers_of_the_whole(monkeypatch):
    """Weights are keyed by what a cell is, not by its place nor by which axes have one value."""
    whole = named_cells(monkeypatch, *SEVERAL)
    assert len(whole) == 8
    part = named_cells(
        monkeypatch,
        *("grid.pulse_width=30", "grid.range=[100,50]", "ladar.target_free_ifovs=4000"),
        *SEVERAL[3:5],
        *("classifier.mnn.epochs=12", "classifier.mnn.annealing=[false,true]"),
    )
    assert set(part) == {(30, 100, 4000), (30, 50, 4000)}
    for key, answers in part.items():
        assert answers["loss"].size == 2
        for name, values in answers.items():
            # epochs first, annealing last of the six axes of the settings
            same = whole[key][name][1:, :, :, :, :, ::-1]
            np.testing.assert_array_equal(values, same)


def seeds_of(monkeypatch, *overrides):
    """Seed that each cell of a sweep gives its networks."""
    given = []

    def network(profiles, *, classifier, random_state):
        given.append(random_state)

    monkeypatch.setattr(graph, "name_by_network", network)
    named_cells(monkeypatch, *overrides)
    monkeypatch.undo()
    return given


def test_every_cell_has_a_seed_of_its_own(monkeypatch):
    """It depends on the cell's values and the sweep's seed alone."""
    given = seeds_of(monkeypatch, *SEVERAL)
    assert given == seeds_of(monkeypatch, *SEVERAL)
    given += seeds_of(monkeypatch, *SEVERAL, "seed=1")
    # Of 16 numbers below 2^32, some two are equal with a probability of 3e-8.
    assert len(set(given)) == len(given) == 16


def test_as_many_settings_as_axes_hold(monkeypatch):
    """Networks that learn nothing, for their number alone: each gets the same first weights."""
    seeds = []

    class Idle:
        n_iter_, n_hidden_, loss_curve_ = 1, 1, (0.0,)

        def __init__(self, *, random_state, **_):
            seeds.append(random_state)

        def fit(self, X, y):
            return self

        def predict(self, X):
            return np.zeros(len(X), dtype=np.intp)

    monkeypatch.setattr(naming, "GainAnnealedNetwork", Idle)
    answers = name_by("mnn", made(), epochs={"start": 1, "stop": 10_001, "step": 1})
    assert answers["loss"].shape == (10_001, 1, 1, 1, 1, 1)
    assert seeds == [SEED] * 10_001


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
