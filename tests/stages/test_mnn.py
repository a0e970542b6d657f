"""The stages of the multilayered network have the settings and answers of the library's."""

import numpy as np
import pytest
from range_channel import ASPECTS, BINS, FRAMES, GROUP, SHIPS, directions, learned, made

from ncti.classify import GainAnnealedNetwork
from ncti.classify.blocks import row_blocks
from sweeps.engine.resolve.streams import cell_rng
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
    network_settings, training_views = (
        mnn.mnn_settings(**DEFAULTS | settings),
        learned(unknown, training_aspect),
    )
    rng = cell_rng(seed, stage="mnn")
    return mnn.mnn_training(
        cell.expected, cell.valid, training_views, ASPECTS, network_settings, rng
    )


def answered(cell, network, frames=FRAMES, inputs="standardised", replicate=0):
    indices = [FRAMES.index(count) for count in frames]
    averaged = cell.averaged[replicate, indices]
    return mnn.mnn(network, averaged, cell.valid, ASPECTS, inputs)


def plain(cell, inputs):
    """Return vectors of training and tests, computed from their definition."""
    if inputs == "raw":
        return cell.expected, cell.averaged[0]
    vectors = (directions(profiles) for profiles in (cell.expected, cell.averaged[0]))
    return tuple(vector / vector.max(axis=-1, keepdims=True) for vector in vectors)


NAMES = ("epochs", "learning_rate", "inputs", "annealing")
SETTINGS = (
    (20, 0.01, "raw", True),
    (30, 0.05, "floor_removed", False),
    (20, 0.05, "standardised", True),
)


@pytest.mark.parametrize("setting", SETTINGS)
def test_every_setting_matches_the_library(setting):
    cell = made(noise=1.0)
    options = dict(zip(NAMES, setting, strict=True)) | {"grow_every": 5, "tolerance": 0.5}
    arrays = trained(cell, **options, max_hidden=4)
    inputs = options.pop("inputs")
    training, tests = plain(cell, inputs)
    network = GainAnnealedNetwork(
        **options,
        max_hidden=4,
        scaling="common" if inputs == "standardised" else "none",
        random_state=int(cell_rng(0, stage="mnn").integers(2**32)),
    )
    with pytest.warns(match="increase epochs"):
        network.fit(training.reshape(-1, BINS), TRUTH.ravel())
    assert arrays["presentations"] == options["epochs"]
    assert arrays["hidden"] == min(4, (options["epochs"] - 1) // 5 + 1)
    assert arrays["loss"] == pytest.approx(network.loss_curve_[-1], rel=1e-6)
    known = network.predict(training.reshape(-1, BINS)).reshape(TRUTH.shape)
    np.testing.assert_array_equal(arrays["training_correct"], known == TRUTH)
    answers = answered(cell, arrays, inputs=inputs)
    predicted = network.predict(tests.reshape(-1, BINS)).reshape(len(FRAMES), *TRUTH.shape)
    np.testing.assert_array_equal(answers["predicted"], predicted // 3)
    np.testing.assert_array_equal(answers["predicted_bin"], predicted % 3)
    np.testing.assert_array_equal(answers["correct"], predicted == TRUTH)


def test_blockwise_answers_equal_those_of_all_views_at_once():
    cell = made(noise=5.0).without([0], [3])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mnn, "row_blocks", lambda count: row_blocks(count, 4))
        network = trained(cell)
        parts = answered(cell, network)
    expected = trained(cell)
    for name, values in expected.items():
        np.testing.assert_array_equal(network[name], values, err_msg=name)
    for name, values in answered(cell, expected).items():
        np.testing.assert_array_equal(parts[name], values, err_msg=name)
