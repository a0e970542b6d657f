"""The source's multilayered network with gain annealing, trained on expected range profiles."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.evaluate import aspect_bins
from ncti.features import profile_vector
from sweeps.engine.settings import Settings, count, number, switch, word
from sweeps.engine.stage import Output, Stage, Table, stage
from sweeps.stages.classifier import NONE, STATE, Classifier, learned, names_by, state
from sweeps.stages.ladar import Ladar
from sweeps.stages.scores import tabulate_answers
from sweeps.stages.views import RANGE, Grid

if TYPE_CHECKING:
    from ncti.classify.gain_annealed import GainAnnealedNetwork

Arrays = dict[str, NDArray[Any]]

NAME = "mnn"
GROUP = "classification/mnn"
VIEW = ("ship", "aspect")
RAW, FLOOR_REMOVED, STANDARDISED = "raw", "floor_removed", "standardised"
DIMS = (
    *("pulse_width", "range", "target_free_ifovs"),
    *("epochs", "grow_every", "mnn_learning_rate", "tolerance", "inputs", "annealing"),
    *("replicate", "frame_count"),
)


class Mnn(Settings, key="classifier.mnn"):
    """The multilayered network."""

    epochs = count(
        1000, 1, 10**6, label="presentations of the training profiles at most", noted=True
    )
    grow_every = count(
        10,
        1,
        10**6,
        label="presentations before another hidden node",
        help="and the next level of gain",
        noted=True,
    )
    learning_rate = number(
        0.015,
        1e-6,
        1000,
        label="learning rate of the multilayered network",
        dimension="mnn_learning_rate",
        noted=True,
    )
    tolerance = number(
        0.35,
        1e-6,
        0.999,
        label="root mean square error at which training stops",
        help="the source's scores need a short training, and this one gives them",
        noted=True,
    )
    inputs = word(
        STANDARDISED,
        (RAW, FLOOR_REMOVED, STANDARDISED),
        label="what the multilayered network sees of a profile",
        help="standardised: floor removed, centred and scaled",
        noted=True,
    )
    annealing = switch(
        True,
        label="1 where gains are annealed",
        help="from half to whole while the network grows",
        noted=True,
    )
    max_hidden = count(25, 1, 1000, label="hidden nodes at most")


@stage(
    Output(
        "training_correct",
        VIEW,
        "i1",
        label="1 where ship and aspect bin of the expected profile are right",
    ),
    Output("presentations", dtype="i4", fill=0, label="epochs trained"),
    Output("hidden", dtype="i2", fill=0, label="hidden nodes"),
    Output("loss", label="mean square error of the outputs at the end"),
    Output("classes", ("class",), "i8", stored=False),
    Output("hidden_weights", ("node", "feature"), "f8", stored=False),
    Output("output_weights", ("class", "node"), "f8", stored=False),
    Output("hidden_offsets", ("node",), "f8", stored=False),
    Output("output_offsets", ("class",), "f8", stored=False),
    Output("hidden_gains", ("node",), "f8", stored=False),
    Output("output_gains", ("class",), "f8", stored=False),
    Output("centre", ("feature",), "f8", stored=False),
    Output("scale", ("feature",), "f8", stored=False),
    uses=(Grid, Classifier, Mnn),
    gather=(Grid.ship, Grid.aspect),
    group=GROUP,
    dims=DIMS,
    when=names_by(NAME, RANGE),
    noise="mnn",
    # The same first weights in every setting: what differs between settings is their own doing.
    stream=(Grid.pulse_width, Grid.range, Ladar.target_free_ifovs),
    status="-",
)
def mnn_training(
    expected: NDArray[np.float32],
    there: NDArray[np.bool_],
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
    epochs: int,
    grow_every: int,
    learning_rate: float,
    tolerance: float,
    inputs: str,
    annealing: bool,
    max_hidden: int,
    rng: np.random.Generator,
) -> Arrays:
    """Return a network trained on expected profiles, with an output for every ship and aspect bin.

    Notes
    -----
    Article, 'Modified Neural Network'. An answer is right when ship and bin are.
    """
    # Imported where it is used: scikit-learn takes a second.
    from sklearn.exceptions import ConvergenceWarning

    from ncti.classify.gain_annealed import GainAnnealedNetwork

    network = GainAnnealedNetwork(
        epochs=epochs,
        grow_every=grow_every,
        learning_rate=learning_rate,
        annealing=annealing,
        max_hidden=max_hidden,
        tolerance=tolerance,
        scaling="common" if inputs == STANDARDISED else "none",
        random_state=int(rng.integers(2**32)),
    )
    truth = classes_of(there.shape, aspect)
    taught = learned(ship, aspect, unknown, training_aspect) & there
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # `loss` tells
        network.fit(seen(expected[taught], inputs), truth[taught])
    answers = np.full(there.shape, NONE)
    answers[there] = network.predict(seen(expected[there], inputs))
    return {
        "training_correct": np.where(taught, answers == truth, NONE),
        "presentations": np.array(network.n_iter_),
        "hidden": np.array(network.n_hidden_),
        "loss": np.array(network.loss_curve_[-1]),
    } | to_arrays(network)


@stage(
    Output("predicted", VIEW, "i2", label="ship named, as an index into the ship axis"),
    Output("correct", VIEW, "i1", label="1 where the answer is right"),
    Output("predicted_bin", VIEW, "i2", label="number of the aspect bin named"),
    Output("ship_correct", VIEW, "i1", label="1 where the ship is right, whatever the aspect bin"),
    Output(
        "cell",
        VIEW,
        "i1",
        label=f"state of a cell of {NAME}",
        failed=0,
        group=f"status_{NAME}",
        attrs=STATE,
    ),
    uses=(Grid, Mnn),
    along=(Grid.frame_count,),
    gather=(Grid.ship, Grid.aspect),
    group=GROUP,
    dims=DIMS,
    when=names_by(NAME, RANGE),
    status="-",
)
def mnn(
    mnn_training: Arrays,
    averaged: NDArray[np.float32],
    there: NDArray[np.bool_],
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    frame_count: tuple[int, ...],
    inputs: str,
) -> Arrays:
    """Return what averaged profiles are named, one number of frames at a time."""
    network = from_arrays(mnn_training)
    truth = classes_of(there.shape, aspect)
    named = np.full((len(frame_count), *there.shape), NONE)
    for answers, profiles in zip(named, averaged, strict=True):
        answers[there] = network.predict(seen(profiles[there], inputs))
    bins = len(aspect_bins(aspect)[0])
    right = np.where(there, named == truth, NONE)
    return {
        "predicted": np.where(there, named // bins, NONE),
        "correct": right,
        "predicted_bin": np.where(there, named % bins, NONE),
        "ship_correct": np.where(there, named // bins == truth // bins, NONE),
        "cell": state(right, there),
    }


def classes_of(shape: tuple[int, ...], aspects: tuple[float, ...]) -> NDArray[np.intp]:
    """Return the (ship, aspect) classes of views: a number for every ship and aspect bin."""
    labels, group = aspect_bins(aspects)
    ship, aspect = np.indices(shape)
    classes: NDArray[np.intp] = ship * len(labels) + group[aspect]
    return classes


def seen(profiles: NDArray[np.float32], inputs: str) -> NDArray[np.floating]:
    """Return what the network sees of (view, bin) profiles."""
    return profiles if inputs == RAW else profile_vector(profiles)


def to_arrays(network: GainAnnealedNetwork) -> Arrays:
    """Return all that a fitted network needs to answer."""
    pairs = {"weights": network.weights_, "offsets": network.offsets_, "gains": network.gains_}
    return {
        "classes": network.classes_,
        "centre": network.centre_,
        "scale": network.scale_,
        **{f"hidden_{name}": pair[0] for name, pair in pairs.items()},
        **{f"output_{name}": pair[1] for name, pair in pairs.items()},
    }


def from_arrays(arrays: Arrays) -> GainAnnealedNetwork:
    """Return the fitted network that `to_arrays` was given, but for how it was trained."""
    from ncti.classify.gain_annealed import GainAnnealedNetwork

    network = GainAnnealedNetwork()
    network.classes_, network.n_features_in_ = arrays["classes"], arrays["centre"].size
    network.centre_, network.scale_ = arrays["centre"], arrays["scale"]
    network.weights_, network.offsets_, network.gains_ = (
        [arrays[f"hidden_{name}"], arrays[f"output_{name}"]]
        for name in ("weights", "offsets", "gains")
    )
    return network


SETTINGS: tuple[type[Settings], ...] = (Mnn,)
STAGES: tuple[Stage, ...] = (mnn_training, mnn)
TABLES: tuple[Table, ...] = (
    Table(f"tables/{NAME}", (GROUP,), tabulate_answers, names_by(NAME, RANGE)),
)
