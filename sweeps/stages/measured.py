"""Range profiles of the proposed sensor, and their identification.

Profiles are of synthetic ships, by the stages of the laser radar at the range to which measured
images are converted, and of ships in simulated flights. Classifiers learn the synthetic profiles
(the article, 'Conclusions').
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import NothingSeenError
from ncti.evaluate import tabulate_scores
from ncti.irar import ShipPixels, measured_extent
from ncti.ladar import expected_profile, no_return
from sweeps.engine.declare.settings import Choices
from sweeps.engine.declare.stage import UNSTORED, Output, Stream, coordinate, derived, in_memory
from sweeps.stages import acn, classifier, ladar, views
from sweeps.stages.acn import Network, TrainingSet
from sweeps.stages.arguments import Keywords, keywords, restore, settings_by_last_word
from sweeps.stages.classifier import NO_ANSWER, Classifier, ClassifierGroup, Mask
from sweeps.stages.correlation import EXPECTED, Correlation, match_views
from sweeps.stages.flights import flown_ships
from sweeps.stages.irar import FLIGHT, FLIGHTS, Irar, flight_of
from sweeps.stages.ladar import Ladar
from sweeps.stages.mnn import mnn, mnn_training
from sweeps.stages.refusals import refuse, require
from sweeps.stages.views import IRAR, Arrays, Grid, Profiles, uses_sensor

if TYPE_CHECKING:
    import xarray as xr

KINDS = ("learned", "test", "measured")

flight_images = views.image_stages("flight_image", range=Irar.profile_range, below=Irar.depression)
flight_cnr = replace(ladar.cnr_at_range, name="flight_cnr", reads={"range": Irar.profile_range})
FLIGHT_SIGNAL = ladar.RECEIVED | {"cnr": "flight_cnr"}
flight_extents = ladar.extent_stages("flight", image="flight_image", slant_range=Irar.profile_range)
learned_signature = replace(
    ladar.expected,
    name="learned_signature",
    reads=FLIGHT_SIGNAL | {"extent": "flight_ifovs"},
    group=UNSTORED,
)
DRAWN = (Grid.ship, Grid.aspect, Irar.depression, Grid.pulse_width, Grid.replicate)
test_signature = replace(
    ladar.averaged,
    name="test_signature",
    reads=FLIGHT_SIGNAL | {"ifovs": "flight_ifovs", "frame_count": Irar.profile_frames},
    along=(Irar.profile_frames,),
    stream=Stream(DRAWN, "flight_signature"),
    group=UNSTORED,
)


@FLIGHTS.stage(
    Output("signature", ("kind", "down_range"), label="range profile, noise floor included"),
    uses=(Grid, Irar, Ladar),
    reads={"ladar_ifov": Ladar.ifov, **FLIGHT_SIGNAL},
)
def signature(
    corrected: Arrays,
    learned_signature: Profiles,
    test_signature: Profiles,
    course: Keywords | None,
    receivers: Keywords,
    *,
    aspect: float,
    pulse_width: float,
    profile_range: float,
    ladar_ifov: float,
    bin_width: float,
    window: float,
    **signal: Any,
) -> Profiles:
    """Return (kind, bin) training, test and measured profiles.

    Measured profiles are NaN for a ship that is not flown past.
    """
    measured = np.full_like(learned_signature, np.nan)
    if course is not None:
        pixels = {f.name: corrected[f"pixel_{f.name}"] for f in fields(ShipPixels)}
        try:
            extent = measured_extent(
                restore(ShipPixels, pixels),
                flight_of(aspect, dict(course + receivers)),
                slant_range=profile_range,
                ifov=ladar_ifov,
                bin_width=bin_width,
                window=window,
            )
        except NothingSeenError:
            extent = no_return(window, bin_width)
        measured[:] = expected_profile(extent, pulse_width=pulse_width, **signal)
    return np.stack([learned_signature, test_signature, measured])


@FLIGHTS.stage(
    coordinate("kind", ("kind",), "U8", "kind of profile; measured: in a simulated flight"),
)
def signature_kinds() -> NDArray[np.str_]:
    """Return the kinds of signatures."""
    return np.array(KINDS)


# Identification

Classify = Callable[[Profiles, Mask], Arrays]
"""Function of (kind, ship, aspect, bin) profiles and the (ship, aspect) mask of existing views that
returns `predicted` and `correct`, (kind, ship, aspect)."""

ANSWERS = ClassifierGroup.of_classifier(
    "measured",
    uses_sensor(IRAR),
    (
        *("pulse_width", "depression", "classifier", "vigilance"),
        *(name for name in FLIGHT if name != "depression"),
    ),
    names=FLIGHTS.names,
    answer=("kind", "ship", "aspect"),
)


LEARNING = ("presentation", "vigilance", "learning_rate", "max_passes", "label_rule")
acn_settings = derived(
    reads=settings_by_last_word(Network)
    | {"presentation": "profile_order", "vigilance": Grid.vigilance},
    name="acn_settings",
)(keywords)

TRAINED = ("acn", "mnn", "correlation")
"""Classifiers of measured profiles: those that need no moments, which are unknown for them."""


@derived(uses=(Classifier,))
def training_method(
    name: str, acn_settings: Keywords, mnn_settings: Keywords
) -> tuple[str, Keywords]:
    """Return the classifier and its own settings, so that other settings do not retrain it."""
    return name, {"acn": acn_settings, "mnn": mnn_settings}.get(name, ())


@in_memory(
    gather=classifier.GATHERED,
    stream=Stream((Grid.pulse_width, Irar.depression), "mnn"),
    keep=4,
    uses=(Grid,),
)
def trained_classifier(
    training_method: tuple[str, Keywords],
    learned_signature: Profiles,
    valid: Mask,
    training_views: Mask,
    aspect: tuple[float, ...],
    rng: np.random.Generator,
) -> Classify:
    """Return a classifier trained on synthetic profiles, for all flights."""
    name, method_settings = training_method
    settings = dict(method_settings)
    if name == "acn":
        to_vectors = classifier.profile_vectors
        training_set = TrainingSet.of_views(learned_signature, valid, training_views, to_vectors)
        learning = {key: settings[key] for key in LEARNING}
        rules = {key: settings[key] for key in ("score_rule", "learn_in_test", "learning_rate")}
        formed = acn.form_categories(training_set, training_views, **learning)
        return lambda tests, valid: acn.answer_tests(training_set, formed, tests, valid, **rules)
    if name == "mnn":
        trained = mnn_training(
            learned_signature, valid, training_views, aspect, method_settings, rng
        )
        return lambda tests, valid: mnn(trained, tests, valid, aspect, settings["inputs"])
    if name not in TRAINED:
        nothing = ("predicted", "correct")
        return lambda tests, valid: dict.fromkeys(nothing, np.full(tests.shape[:-1], NO_ANSWER))
    templates = classifier.profile_vectors(learned_signature)[None]

    def correlate(tests: Profiles, valid: Mask) -> Arrays:
        known = training_views & valid
        answers = [
            match_views(templates, of_kind, valid, known, left_out=False)
            for of_kind in classifier.profile_vectors(tests)
        ]
        return {key: np.array([answer[key] for answer in answers]) for key in answers[0]}

    return correlate


@ANSWERS.answers(
    Output("ship_correct", ANSWERS.answer, "i1", label="1 where the ship is right"),
    right=": the ship, of the multilayered network its aspect bin, too",
    uses=(Grid,),
)
def measured(trained_classifier: Classify, signature: Profiles, valid: Mask) -> Arrays:
    """Return the ships predicted for signatures of every kind.

    Answers are -1 where a view is missing or not measured. A signature without any return names no
    ship and counts as wrong.
    """
    profiles = np.moveaxis(signature, 2, 0)
    absent = np.asarray(np.isnan(profiles).any(axis=-1))
    answers = trained_classifier(
        np.where(absent[..., None], profiles[KINDS.index("learned")], profiles), valid
    )
    predicted, correct = (
        np.where(absent, NO_ANSWER, answers[name]) for name in ("predicted", "correct")
    )
    true = np.arange(len(valid))[:, None]
    return {
        "predicted": predicted,
        "correct": correct,
        "ship_correct": np.where(correct == NO_ANSWER, NO_ANSWER, predicted == true),
        "cell": classifier.answer_state(correct, valid),
    }


measured_kinds = ANSWERS.coordinates(*signature_kinds.outputs)(signature_kinds.function)


def check(choices: Choices) -> Choices | None:
    """Refuse classifiers that cannot identify measured profiles; drop them if others can."""
    if not uses_sensor(IRAR)(choices):
        return None
    names = tuple(name for name in choices[Classifier.name] if name in TRAINED)
    if not names:
        allowed = f"one of {', '.join(TRAINED)} where sensor is irar"
        refuse(Classifier.name, ", ".join(choices[Classifier.name]), allowed)
    require(choices, Correlation.training, EXPECTED, "where sensor is irar")
    require(choices, Classifier.left_out, False, "where sensor is irar")
    only_flights = set(choices.value(views.Sweep.sensor)) == {IRAR}
    return choices.replace(Classifier.name, names) if only_flights else None


def tabulate_measured(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the scores of ships that are in training and flown past."""
    known, past = classifier.known_ships(classified, choices), flown_ships(choices)
    known = known.sel(ship=[ship for ship in known.ship.values.tolist() if ship in past])
    return tabulate_scores(known, classifier.aspect_masks(choices), classifier.PROFILE_NOUN)


STAGES = (
    flight_images,
    flight_cnr,
    flight_extents,
    learned_signature,
    test_signature,
    signature,
    signature_kinds,
    acn_settings,
    training_method,
    trained_classifier,
    measured,
    measured_kinds,
)
TABLES = ANSWERS.tables(tabulate_measured, labels={"channel": views.RANGE}, scored="own rule")
