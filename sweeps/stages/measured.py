"""Identification of simulated flights' profiles by classifiers trained on synthetic ones.

Article, 'Conclusions': measured profiles of ships that synthetic ones were learned of.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stream, in_memory, plain
from sweeps.stages import acn, classifier
from sweeps.stages.acn import Network, TrainingSet
from sweeps.stages.classifier import NONE, Arrays, Classifier, ClassifierGroup, Profiles, Views
from sweeps.stages.correlation import EXPECTED, Correlation, match_views
from sweeps.stages.flights import flown
from sweeps.stages.irar import FLIGHT, FLIGHTS, Irar
from sweeps.stages.mnn import Training, mnn, mnn_training
from sweeps.stages.scores import tabulate_scores
from sweeps.stages.signatures import KINDS, signature_kinds
from sweeps.stages.views import IRAR, RANGE, Grid, Sweep, looks, refuse, require

if TYPE_CHECKING:
    import xarray as xr

Namer = Callable[[Profiles, Views], Arrays]
"""Function of (kind, ship, aspect, bin) profiles and the (ship, aspect) mask of existing views that
returns `predicted` and `correct`, (kind, ship, aspect)."""

ANSWERS = ClassifierGroup.of(
    "measured",
    looks(IRAR),
    (
        *("pulse_width", "depression", "classifier", "vigilance"),
        *(name for name in FLIGHT if name != "depression"),
    ),
    names=FLIGHTS.names,
    answer=("kind", "ship", "aspect"),
)


@dataclass(frozen=True)
class AcnSettings:
    """What training and test of the Adaptive Clustering Network depend on."""

    presentation: tuple[int, int]
    vigilance: float
    learning_rate: float
    max_passes: int
    learn_in_test: bool
    label_rule: str
    score_rule: str


acn_settings = plain(
    uses=(Grid, Network), reads={"presentation": "profile_order"}, name="acn_settings"
)(AcnSettings)


def train_acn(given: AcnSettings, profiles: Profiles, valid: Views, views: Views) -> Namer:
    """Train the Adaptive Clustering Network."""
    training_set = TrainingSet.of(profiles, valid, classifier.profile_vectors)
    how = given.vigilance, given.learning_rate, given.max_passes, given.label_rule
    formed = acn.form_categories(training_set, views, given.presentation, *how)

    def name(tests: Profiles, valid: Views) -> Arrays:
        rules = given.score_rule, given.learn_in_test
        answers = acn.answer_tests(training_set, formed, tests, valid, *rules)
        return {key: answers[key] for key in ("predicted", "correct")}

    return name


def store_templates(profiles: Profiles, valid: Views, views: Views) -> Namer:
    """Store the training profiles for correlation."""
    training_set = classifier.profile_vectors(profiles)[None]

    def name(tests: Profiles, valid_tests: Views) -> Arrays:
        answers = [
            match_views(training_set, of_kind, valid_tests, views & valid, (False,))
            for of_kind in classifier.profile_vectors(tests)
        ]
        return {key: np.concatenate([one[key] for one in answers]) for key in answers[0]}

    return name


TRAINED = ("acn", "mnn", "correlation")
"""Classifiers of measured profiles: those that need no moments, which are unknown for them."""

Lesson = tuple[str, AcnSettings | Training | None]


@plain(uses=(Classifier,))
def lesson(name: str, acn_settings: AcnSettings, mnn_settings: Training) -> Lesson:
    """Return the classifier and its own settings, so that others do not repeat its training."""
    own: dict[str, AcnSettings | Training] = {"acn": acn_settings, "mnn": mnn_settings}
    return name, own.get(name)


@in_memory(
    gather=classifier.GATHERED,
    stream=Stream((Grid.pulse_width, Irar.depression), "mnn"),
    keep=4,
    uses=(Grid,),
)
def namer(
    lesson: Lesson,
    learned_signature: Profiles,
    valid: Views,
    training_views: Views,
    aspect: tuple[float, ...],
    rng: np.random.Generator,
) -> Namer:
    """Return a classifier trained on synthetic profiles, for all flights."""
    name, given = lesson
    of_training = learned_signature, valid, training_views
    if isinstance(given, AcnSettings):
        return train_acn(given, *of_training)
    if isinstance(given, Training):
        trained = mnn_training(*of_training, aspect, given, rng)
        return lambda tests, valid: mnn(trained, tests, valid, aspect, given.inputs)
    if name == "correlation":
        return store_templates(*of_training)
    nothing = ("predicted", "correct")
    return lambda tests, valid: dict.fromkeys(nothing, np.full(tests.shape[:-1], NONE))


@ANSWERS.answers(
    Output("ship_correct", ANSWERS.answer, "i1", label="1 where the ship is right"),
    right=": the ship, of the multilayered network its aspect bin, too",
    uses=(Grid,),
)
def measured(namer: Namer, signature: Profiles, valid: Views) -> Arrays:
    """Return the ships predicted for signatures of every kind.

    -1 where a view is not there, or not measured. A signature that shows nothing names no ship,
    which counts as wrong.
    """
    seen = np.moveaxis(signature, 2, 0)
    absent = np.asarray(np.isnan(seen).any(axis=-1))
    found = namer(np.where(absent[..., None], seen[KINDS.index("learned")], seen), valid)
    predicted, correct = (np.where(absent, NONE, found[name]) for name in ("predicted", "correct"))
    true = np.arange(len(valid))[:, None]
    return {
        "predicted": predicted,
        "correct": correct,
        "ship_correct": np.where(correct == NONE, NONE, predicted == true),
        "cell": classifier.state(correct, valid),
    }


measured_kinds = ANSWERS.coordinates(*signature_kinds.outputs)(signature_kinds.function)


def check(choices: Choices) -> Choices:
    """Refuse classifiers that cannot identify measured profiles; drop them if others can."""
    if not looks(IRAR)(choices):
        return choices
    names = tuple(name for name in choices[Classifier.name] if name in TRAINED)
    if not names:
        allowed = f"one of {', '.join(TRAINED)} where sensor is irar"
        refuse(Classifier.name, ", ".join(choices[Classifier.name]), allowed)
    require(choices, Correlation.training, EXPECTED, "where sensor is irar")
    require(choices, Classifier.left_out, False, "where sensor is irar")
    if set(choices.one(Sweep.sensor)) == {IRAR}:
        return choices.having(Classifier.name, names)
    return choices


def tabulate_measured(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the scores of ships that are in training and flown past."""
    known, past = classifier.known_ships(classified, choices), flown(choices)
    known = known.sel(ship=[ship for ship in known.ship.values.tolist() if ship in past])
    return tabulate_scores(known, classifier.aspects_of(choices), classifier.PROFILES)


TABLES = ANSWERS.tables(tabulate_measured, labels={"channel": RANGE}, scored="own rule")
