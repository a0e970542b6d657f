"""The multilayered network on profiles made up: its settings, its seeds, its arrays."""

import warnings
from itertools import product

import numpy as np
import pytest
from range_channel import ASPECTS, BINS, FRAMES, GROUP, SHIPS, directions, learned, made

from ncti.classify import GainAnnealedNetwork
from sweeps.engine.seeds import cell_rng
from sweeps.stages import mnn

DEFAULTS = {
    "epochs": 40,
    "grow_every": 10,
    "learning_rate": 0.015,
    "tolerance": 0.35,
    "inputs": "standardised",
    "annealing": True,
    "max_hidden": 25,
}
TRUTH = np.arange(SHIPS)[:, None] * 3 + GROUP


def trained(cell, unknown=None, training_aspect=None, seed=0, **settings):
    given, training_views = (
        mnn.mnn_settings(**DEFAULTS | settings),
        learned(unknown, training_aspect),
    )
    rng = cell_rng(seed, stage="mnn")
    return mnn.mnn_training(cell.expected, cell.there, training_views, ASPECTS, given, rng)


def answered(cell, network, frames=FRAMES, inputs="standardised", replicate=0):
    places = [FRAMES.index(count) for count in frames]
    averaged = cell.averaged[replicate, places]
    return mnn.mnn(network, averaged, cell.there, ASPECTS, inputs)


def test_it_knows_ship_and_aspect_bin():
    """Trained until it knows every view, then shown views of other ships and other bins."""
    cell = made()
    network = trained(cell, epochs=2000, learning_rate=0.02, tolerance=0.1)
    assert network["training_correct"].all()
    assert network["loss"] <= 0.1**2
    ship = np.broadcast_to(np.arange(SHIPS)[:, None], TRUTH.shape)
    for ships, bins in ((0, 0), (0, 2), (1, 0)):
        shown = np.roll(cell.expected, (ships, bins), axis=(0, 1))
        found = answered(
            cell.changed(averaged=np.broadcast_to(shown, cell.averaged.shape)), network
        )
        seen_ship = np.roll(ship, ships, axis=0)
        seen_bin = np.broadcast_to(np.roll(GROUP, bins), ship.shape)
        for f in range(len(FRAMES)):
            np.testing.assert_array_equal(found["predicted"][f], seen_ship)
            np.testing.assert_array_equal(found["predicted_bin"][f], seen_bin)
            np.testing.assert_array_equal(found["ship_correct"][f], seen_ship == ship)
            right = (seen_ship == ship) & (seen_bin == GROUP)
            np.testing.assert_array_equal(found["correct"][f], right)


def plain(cell, inputs):
    """Vectors of training and tests, from their definition."""
    if inputs == "raw":
        return cell.expected, cell.averaged[0]
    found = (directions(one) for one in (cell.expected, cell.averaged[0]))
    return tuple(one / one.max(axis=-1, keepdims=True) for one in found)


AXES = {
    "epochs": (20, 30),
    "learning_rate": (0.01, 0.05),
    "inputs": ("raw", "floor_removed", "standardised"),
    "annealing": (True, False),
}


@pytest.mark.parametrize("setting", list(product(*AXES.values())))
def test_every_setting_is_the_librarys(setting):
    cell = made(noise=1.0)
    given = dict(zip(AXES, setting, strict=True)) | {"grow_every": 5, "tolerance": 0.5}
    found = trained(cell, **given, max_hidden=4)
    inputs = given.pop("inputs")
    training, tests = plain(cell, inputs)
    network = GainAnnealedNetwork(
        **given,
        max_hidden=4,
        scaling="common" if inputs == "standardised" else "none",
        random_state=int(cell_rng(0, stage="mnn").integers(2**32)),
    )
    with pytest.warns(match="increase epochs"):
        network.fit(training.reshape(-1, BINS), TRUTH.ravel())
    assert found["presentations"] == given["epochs"]
    assert found["hidden"] == min(4, (given["epochs"] - 1) // 5 + 1)
    assert found["loss"] == pytest.approx(network.loss_curve_[-1], rel=1e-6)
    known = network.predict(training.reshape(-1, BINS)).reshape(TRUTH.shape)
    np.testing.assert_array_equal(found["training_correct"], known == TRUTH)
    answers = answered(cell, found, inputs=inputs)
    named = network.predict(tests.reshape(-1, BINS)).reshape(len(FRAMES), *TRUTH.shape)
    np.testing.assert_array_equal(answers["predicted"], named // 3)
    np.testing.assert_array_equal(answers["predicted_bin"], named % 3)
    np.testing.assert_array_equal(answers["correct"], named == TRUTH)


def test_a_network_answers_the_same_from_its_arrays():
    cell = made(noise=1.0)
    network = GainAnnealedNetwork(epochs=30, random_state=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        network.fit(cell.expected.reshape(-1, BINS), TRUTH.ravel())
    again = mnn.from_arrays(mnn.to_arrays(network))
    tests = cell.averaged.reshape(-1, BINS)
    np.testing.assert_array_equal(again.outputs(tests), network.outputs(tests))


def test_a_number_of_frames_does_not_depend_on_others():
    cell = made(noise=3.0)
    network = trained(cell)
    whole = answered(cell, network)
    for f, count in enumerate(FRAMES):
        for name, values in answered(cell, network, (count,)).items():
            np.testing.assert_array_equal(values[0], whole[name][f], err_msg=name)
    assert 0 < whole["correct"].mean() < 1


def test_the_seed_decides_what_a_network_becomes():
    cell = made(noise=1.0)
    first, again, other = (trained(cell, epochs=10, seed=seed) for seed in (1, 1, 2))
    for name, values in first.items():
        np.testing.assert_array_equal(again[name], values, err_msg=name)
    assert other["loss"] != first["loss"]


def test_all_settings_of_a_cell_start_from_the_same_weights():
    """The stream goes by the cell alone, by the names that it always had."""
    assert [one.name for one in mnn.mnn_training.stream] == [
        *("pulse_width", "range", "target_free_ifovs")
    ]
    assert mnn.mnn_training.noise == "mnn"


def test_views_that_are_not_learned_are_named_alone():
    """What they would teach may be anything."""
    cell = made()
    training_views = {"unknown": ("c",), "training_aspect": (0.0, 30.0, 59.9, 60.0, 90.0)}
    before = trained(cell, epochs=300, **training_views)
    expected = cell.expected.copy()
    expected[2], expected[:, 1] = expected[2][:, ::-1], expected[:, 1, ::-1]
    after = trained(cell.changed(expected=expected), epochs=300, **training_views)
    for name, values in before.items():
        np.testing.assert_array_equal(after[name], values, err_msg=name)
    np.testing.assert_array_equal(before["training_correct"] >= 0, learned(**training_views))
    answers = answered(cell, before)
    assert set(np.unique(answers["predicted"])) == {0, 1}
    assert answers["correct"].min() == 0 and (answers["cell"] == 1).all()


@pytest.mark.parametrize("lost", [(slice(2, None), slice(None)), (1, 4)])
def test_views_that_are_not_there_are_filled(lost):
    """The others keep their ships: at this noise all of them are known."""
    cell = made(noise=0.1).without(*lost)
    network = trained(cell, epochs=2000, tolerance=0.1)
    found = answered(cell, network)
    for name in ("predicted", "predicted_bin", "correct", "ship_correct"):
        assert (found[name][:, ~cell.there] == -1).all()
    assert (found["cell"][:, ~cell.there] == 0).all()
    assert (network["training_correct"][~cell.there] == -1).all()
    assert (found["correct"][:, cell.there] == 1).all()
