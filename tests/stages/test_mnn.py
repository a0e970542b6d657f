"""The multilayered network on profiles made up: its settings, its seeds, its answers."""

from itertools import product

import numpy as np
import pytest
from range_channel import ASPECTS, BINS, FRAMES, GROUP, SHIPS, directions, learned, made

from ncti.classify import GainAnnealedNetwork
from ncti.classify.blocks import row_blocks
from sweeps.engine.resolve.keys import cell_rng
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
    return mnn.mnn_training(cell.expected, cell.valid, training_views, ASPECTS, given, rng)


def answered(cell, network, frames=FRAMES, inputs="standardised", replicate=0):
    places = [FRAMES.index(count) for count in frames]
    averaged = cell.averaged[replicate, places]
    return mnn.mnn(network, averaged, cell.valid, ASPECTS, inputs)


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


@pytest.mark.parametrize("inputs", AXES["inputs"])
def test_answers_in_blocks_are_those_of_all_views(inputs):
    cell = made(noise=5.0).without([0], [3])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mnn, "row_blocks", lambda count: row_blocks(count, 4))
        network = trained(cell, inputs=inputs)
        parts = answered(cell, network, inputs=inputs)
    whole = trained(cell, inputs=inputs)
    for name, values in whole.items():
        np.testing.assert_array_equal(network[name], values, err_msg=name)
    for name, values in answered(cell, whole, inputs=inputs).items():
        np.testing.assert_array_equal(parts[name], values, err_msg=name)
