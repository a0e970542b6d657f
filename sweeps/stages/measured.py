"""Identification of simulated flights' profiles by classifiers trained on synthetic ones.

Article, 'Conclusions': measured profiles of ships that synthetic ones were learned of.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, in_memory, plain, stage
from sweeps.stages import categories, classifier
from sweeps.stages.categories import Lessons, Network
from sweeps.stages.classifier import NONE, Arrays, Classifier, Naming, Profiles, Views
from sweeps.stages.correlation import EXPECTED, Correlation, match_views
from sweeps.stages.flights import flown
from sweeps.stages.irar import FLIGHT, Irar
from sweeps.stages.mnn import mnn, mnn_training
from sweeps.stages.scores import data_set, scored_profiles
from sweeps.stages.signatures import KINDS, NAMES, signature_kinds
from sweeps.stages.views import IRAR, Grid, Sweep, looks

if TYPE_CHECKING:
    import xarray as xr

Namer = Callable[[Profiles, Views], Arrays]
"""Function of (kind, ship, aspect, bin) profiles and the (ship, aspect) mask of existing views that
returns `predicted` and `correct`, (kind, ship, aspect)."""

NAMING = Naming(
    "measured", looks(IRAR), of="profiles of simulated flights", dims=("kind", "ship", "aspect")
)


def acn_namer(
    profiles: Profiles,
    there: Views,
    training_views: Views,
    *,
    presentation: tuple[int, int],
    learn_in_test: bool,
    label_rule: str,
    score_rule: str,
    **settings: Any,
) -> Namer:
    """Train the Adaptive Clustering Network."""
    lessons = Lessons.of(profiles, there, classifier.profile_vectors)
    formed = categories.form_categories(lessons, training_views, presentation, **settings)
    names = {key: one[None] for key, one in categories.name_categories(formed, label_rule).items()}

    def name(tests: Profiles, there: Views) -> Arrays:
        rules = (score_rule,), learn_in_test
        found = categories.answer_tests(lessons, formed, names, tests, there, *rules)
        return {key: found[key][:, 0, 0] for key in ("predicted", "correct")}

    return name


def mnn_namer(
    profiles: Profiles,
    there: Views,
    training_views: Views,
    aspect: tuple[float, ...],
    rng: np.random.Generator,
    **settings: Any,
) -> Namer:
    """Train the multilayered network."""
    trained = mnn_training(profiles, there, training_views, aspect, tuple(settings.items()), rng)
    return lambda tests, there: mnn(trained, tests, there, aspect, settings["inputs"])


def correlation_namer(profiles: Profiles, there: Views, training_views: Views) -> Namer:
    """Store the training profiles for correlation."""
    lessons = classifier.profile_vectors(profiles)[None]

    def name(tests: Profiles, now_there: Views) -> Arrays:
        found = [
            match_views(lessons, of_kind, now_there, training_views & there, (False,))
            for of_kind in classifier.profile_vectors(tests)
        ]
        return {key: np.concatenate([one[key] for one in found]) for key in found[0]}

    return name


TRAINERS: dict[str, Callable[..., Namer]] = {
    "acn": acn_namer,
    "mnn": mnn_namer,
    "correlation": correlation_namer,
}
"""Classifiers of measured profiles: those that need no moments, which are unknown for them."""

Lesson = tuple[str, tuple[tuple[str, Any], ...]]


@plain(uses=(Grid, Classifier, Network))
def lesson(
    name: str,
    vigilance: float,
    learning_rate: float,
    max_passes: int,
    profile_order: tuple[int, int],
    learn_in_test: bool,
    label_rule: str,
    score_rule: str,
    mnn_settings: tuple[tuple[str, Any], ...],
) -> Lesson:
    """Return the classifier and its own settings, so that others do not repeat its training."""
    given = locals()
    of_network = tuple(
        (one.name, given[one.name])
        for one in (Grid.vigilance, *Network.declared)
        if one is not Network.orders
    )
    of_network = (("presentation", profile_order), *of_network)
    return name, {"acn": of_network, "mnn": mnn_settings}.get(name, ())


@in_memory(
    gather=classifier.GATHERED,
    noise="mnn",
    stream=(Grid.pulse_width, Irar.depression),
    keep=4,
    uses=(Grid,),
)
def namer(
    lesson: Lesson,
    learned_signature: Profiles,
    there: Views,
    training_views: Views,
    aspect: tuple[float, ...],
    rng: np.random.Generator,
) -> Namer:
    """Return a classifier trained on synthetic profiles, for all flights."""
    name, settings = lesson
    if name not in TRAINERS:
        nothing = ("predicted", "correct")
        return lambda tests, there: dict.fromkeys(nothing, np.full(tests.shape[:-1], NONE))
    more = {"aspect": aspect, "rng": rng} if name == "mnn" else {}
    return TRAINERS[name](learned_signature, there, training_views, **dict(settings), **more)


@NAMING.answers(
    Output("ship_correct", NAMING.dims, "i1", label="1 where the ship is right"),
    right=": the ship, of the multilayered network its aspect bin, too",
    uses=(Grid,),
    dims=(
        *("pulse_width", "depression", "classifier", "vigilance"),
        *(name for name in FLIGHT if name != "depression"),
    ),
    names=NAMES,
)
def measured(namer: Namer, signature: Profiles, there: Views) -> Arrays:
    """Return the ships predicted for signatures of every kind.

    -1 where a view is not there, or not measured. A signature that shows nothing names no ship,
    which counts as wrong.
    """
    seen = np.moveaxis(signature, 2, 0)
    absent = np.asarray(np.isnan(seen).any(axis=-1))
    found = namer(np.where(absent[..., None], seen[KINDS.index("learned")], seen), there)
    predicted, correct = (np.where(absent, NONE, found[name]) for name in ("predicted", "correct"))
    true = np.arange(len(there))[:, None]
    return {
        "predicted": predicted,
        "correct": correct,
        "ship_correct": np.where(correct == NONE, NONE, predicted == true),
        "cell": classifier.state(correct, there),
    }


kinds_named, kinds_of_states = (
    stage(*signature_kinds.outputs, group=group, when=looks(IRAR), coordinates=True, name=name)(
        signature_kinds.function
    )
    for group, name in (
        ("classification/measured", "kinds_named"),
        ("status_measured", "kinds_of_states"),
    )
)


def check(choices: Choices) -> Choices:
    """Refuse classifiers that cannot identify measured profiles; drop them if others can."""
    if not looks(IRAR)(choices):
        return choices
    names = tuple(name for name in choices[Classifier.name] if name in TRAINERS)
    if not names:
        raise ConfigurationError(
            f"classifier.name is {', '.join(choices[Classifier.name])}, but must have one of "
            f"{', '.join(TRAINERS)} where sensor is irar"
        )
    for setting, allowed in ((Correlation.training, EXPECTED), (Classifier.left_out, False)):
        for value in choices[setting]:
            if value != allowed:
                raise ConfigurationError(
                    f"{setting.key} is {str(value).lower()}, but must be {str(allowed).lower()} "
                    "where sensor is irar"
                )
    if set(choices.one(Sweep.sensor)) == {IRAR}:
        return choices.having(Classifier.name, names)
    return choices


def tabulate_measured(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the scores of ships that are in training and flown past."""
    known, past = classifier.known_ships(classified, choices), flown(choices)
    known = known.sel(ship=[ship for ship in known.ship.values.tolist() if ship in past])
    return data_set(scored_profiles(known, classifier.aspects_of(choices)), known.aspect)


STAGES: tuple[Stage, ...] = (lesson, namer, measured, kinds_named, kinds_of_states)
TABLES = NAMING.tables(tabulate_measured)
