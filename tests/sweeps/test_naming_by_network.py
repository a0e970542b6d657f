"""The multilayered network in one cell, on profiles made up: its settings, its seeds."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from made_profiles import (
    ASPECTS,
    BINS,
    FLOOR,
    FRAMES,
    GROUP,
    REPLICATES,
    SEED,
    SHIPS,
    VIEWS,
    directions,
    made,
    name_by,
    of_tests,
)
from test_classifier_configuration import configured

from ncti.classify import GainAnnealedNetwork
from sweeps import graph, naming
from sweeps.classifier_schema import ClassifierConfig, NetworkConfig
from sweeps.naming import name_by_network
from sweeps.seeds import cell_rng


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
