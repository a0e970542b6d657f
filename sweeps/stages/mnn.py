"""The article's multilayered network with gain annealing, trained on expected range profiles."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.classify.blocks import row_blocks
from ncti.evaluate import aspect_bins
from ncti.features import profile_vector
from sweeps.engine.declare.settings import Settings, count, number, switch, word
from sweeps.engine.declare.stage import Output, Stream, derived, inner
from sweeps.stages import classifier
from sweeps.stages.arguments import Keywords, keywords, settings_by_last_word
from sweeps.stages.classifier import GATHERED, NO_ANSWER, Mask
from sweeps.stages.ladar import Ladar
from sweeps.stages.views import Arrays, Grid, Profiles

if TYPE_CHECKING:
    from ncti.classify.gain_annealed import GainAnnealedNetwork

IMPORTS = ("ncti.classify.gain_annealed",)
NAME = "mnn"
ANSWERS = classifier.of_profiles(
    NAME, "epochs", "grow_every", "mnn_learning_rate", "tolerance", "inputs", "annealing"
)
RAW, FLOOR_REMOVED, STANDARDISED = "raw", "floor_removed", "standardised"


# Arrays of a fitted network: its attributes, the layers' attributes, and their dimensions.
VECTORS = {"classes_": "class", "centre_": "feature", "scale_": "feature"}
LAYERS = {
    "weights_": (("node", "feature"), ("class", "node")),
    "offsets_": (("node",), ("class",)),
    "gains_": (("node",), ("class",)),
}


class Mnn(Settings, key="classifier.mnn", role="coordinate"):
    """The multilayered network."""

    epochs = count(1000, 1, 10**6, label="largest number of presentations of the training profiles")
    grow_every = count(
        10, 1, 10**6, label="presentations before a hidden node is added and the gain raised"
    )
    learning_rate = number(
        0.015,
        1e-6,
        1000,
        label="learning rate of the multilayered network",
        dimension="mnn_learning_rate",
    )
    tolerance = number(
        0.35,
        low=1e-6,
        high=0.999,
        label="root mean square error at which training stops",
        help="fitted to the training row of the article's Table 2, which needs a short training",
    )
    inputs = word(
        STANDARDISED,
        (RAW, FLOOR_REMOVED, STANDARDISED),
        label="input of the multilayered network",
        help="standardised: floor removed, centred and scaled",
    )
    annealing = switch(
        True, label="annealing of the gains", help="from half to whole while the network grows"
    )
    max_hidden = count(25, 1, 1000, label="largest number of hidden nodes", role="")


mnn_settings = derived(reads=settings_by_last_word(Mnn), name="mnn_settings")(keywords)


@ANSWERS.stage(
    Output(
        "training_correct",
        classifier.VIEW,
        "i1",
        "1 where ship and aspect bin of the expected profile are right",
    ),
    Output("presentations", dtype="i4", label="epochs trained"),
    Output("hidden", dtype="i2", label="hidden nodes"),
    Output("loss", label="mean square error of the outputs at the end"),
    *(inner(name, (dim,), "i8" if name == "classes_" else "f8") for name, dim in VECTORS.items()),
    *(
        inner(f"{name}{layer}", dims, "f8")
        for name, layer_dims in LAYERS.items()
        for layer, dims in enumerate(layer_dims)
    ),
    uses=(Grid,),
    gather=GATHERED,
    reads=classifier.read_in_blocks("expected"),
    # The same initial weights in every setting, so that only the settings differ.
    stream=Stream((Grid.pulse_width, Grid.range, Ladar.target_free_ifovs), NAME),
)
def mnn_training(
    expected: Profiles,
    valid: Mask,
    training_views: Mask,
    aspect: tuple[float, ...],
    mnn_settings: Keywords,
    rng: np.random.Generator,
) -> Arrays:
    """Return a network trained on expected profiles, with an output for every ship and aspect bin.

    Notes
    -----
    Article, 'Modified Neural Network'. An answer is right when ship and bin are.
    """
    from sklearn.exceptions import ConvergenceWarning

    from ncti.classify.gain_annealed import GainAnnealedNetwork

    settings = dict(mnn_settings)
    inputs, random_state = settings.pop("inputs"), int(rng.integers(2**32))
    scaling = "common" if inputs == STANDARDISED else "none"
    network = GainAnnealedNetwork(**settings, scaling=scaling, random_state=random_state)
    truth = view_classes(valid.shape, aspect)
    known = training_views & valid
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # `loss` shows it
        network.fit(network_inputs(expected[known], inputs), truth[known])
    classes = np.full(valid.shape, NO_ANSWER)
    classes[valid] = predict_classes(
        network, expected.reshape(1, -1, expected.shape[-1]), valid, inputs
    )
    return {
        "training_correct": np.where(known, classes == truth, NO_ANSWER),
        "presentations": np.array(network.n_iter_),
        "hidden": np.array(network.n_hidden_),
        "loss": np.array(network.loss_curve_[-1]),
    } | to_arrays(network)


@ANSWERS.answers(
    Output("predicted_bin", classifier.VIEW, "i2", label="number of the predicted aspect bin"),
    Output("ship_correct", classifier.VIEW, "i1", "1 where the ship is right, for any aspect bin"),
    uses=(Grid, Mnn),
    reads=classifier.read_in_blocks("averaged"),
    along=(Grid.frame_count,),
)
def mnn(
    mnn_training: Arrays, averaged: Profiles, valid: Mask, aspect: tuple[float, ...], inputs: str
) -> Arrays:
    """Return the ships predicted for averaged profiles, one number of frames at a time."""
    network = from_arrays(mnn_training)
    classes = np.full(averaged.shape[:-1], NO_ANSWER)
    flat = averaged.reshape(len(classes), -1, averaged.shape[-1])
    for f, frame_classes in enumerate(classes):
        frame_classes[valid] = predict_classes(network, flat, valid, inputs, f)
    bins = len(aspect_bins(aspect)[0])
    answers = classifier.mark_answers(classes // bins, valid)
    right = np.where(valid, classes == view_classes(valid.shape, aspect), NO_ANSWER)
    return answers | {
        "correct": right,
        "predicted_bin": np.where(valid, classes % bins, NO_ANSWER),
        "ship_correct": answers["correct"],
        "cell": classifier.answer_state(right, valid),
    }


def view_classes(shape: tuple[int, ...], aspects: tuple[float, ...]) -> NDArray[np.intp]:
    """Return the (ship, aspect) classes of views: a number for every ship and aspect bin."""
    labels, group = aspect_bins(aspects)
    ship, aspect = np.indices(shape)
    classes: NDArray[np.intp] = ship * len(labels) + group[aspect]
    return classes


def predict_classes(
    network: GainAnnealedNetwork, profiles: Profiles, valid: Mask, inputs: str, number: int = 0
) -> NDArray[np.intp]:
    """Return the classes of existing views from (number, view, bin) profiles at index `number`.

    Profiles are read and classified in blocks.
    """
    views = np.flatnonzero(valid)
    classes = np.empty(len(views), dtype=np.intp)
    for rows in row_blocks(len(views)):
        classes[rows] = network.predict(network_inputs(profiles[number, views[rows]], inputs))
    return classes


def network_inputs(profiles: Profiles, inputs: str) -> NDArray[np.floating]:
    """Return the network's inputs from (view, bin) profiles."""
    return profiles if inputs == RAW else profile_vector(profiles)


def to_arrays(network: GainAnnealedNetwork) -> Arrays:
    """Return the arrays of a fitted network, since a cache holds no pickles."""
    layers = {f"{name}{k}": getattr(network, name)[k] for name in LAYERS for k in range(2)}
    return {name: getattr(network, name) for name in VECTORS} | layers


def from_arrays(arrays: Arrays) -> GainAnnealedNetwork:
    """Return a fitted network from the arrays of `to_arrays`, without its training history."""
    from ncti.classify.gain_annealed import GainAnnealedNetwork

    network = GainAnnealedNetwork()
    network.n_features_in_ = arrays["centre_"].size
    for name in VECTORS:
        setattr(network, name, arrays[name])
    for name in LAYERS:
        setattr(network, name, [arrays[f"{name}{k}"] for k in range(2)])
    return network


STAGES = (
    mnn_settings,
    mnn_training,
    mnn,
)
TABLES = ANSWERS.tables(scored="ship and aspects")
