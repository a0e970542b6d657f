"""Naming measured profiles by classifiers that learned synthetic ones.

Article, 'Conclusions': measured profiles of ships that synthetic ones were learned of.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify.vigilance_sweep import Similarities
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, Table, in_memory, plain, stage
from sweeps.stages.acn import Lessons, Network, acn, acn_names, acn_training
from sweeps.stages.classifier import NONE, STATE, Classifier, learned, profile_vectors, state
from sweeps.stages.correlation import EXPECTED, Correlation, match_views
from sweeps.stages.flight_checks import flown
from sweeps.stages.irar import FLIGHT, Irar
from sweeps.stages.mnn import Mnn, mnn, mnn_training
from sweeps.stages.scores import PROFILES, Scored, data_set, known_ships, scored
from sweeps.stages.signatures import KINDS, NAMES, signature_kinds
from sweeps.stages.views import IRAR, Grid, Sweep, looks

if TYPE_CHECKING:
    import xarray as xr

Arrays = dict[str, NDArray[Any]]
Profiles = NDArray[np.float32]
Views = NDArray[np.bool_]
Namer = Callable[[Profiles, Views], Arrays]
"""(kind, ship, aspect, bin) profiles, (ship, aspect) views that are there -> `predicted` and
`correct`, (kind, ship, aspect)."""

VIEWS = ("ship", "aspect", "unknown", "training_aspect")
GROUP, STATES = "classification/measured", "status_measured"


def train_acn(
    profiles: Profiles,
    there: Views,
    rng: np.random.Generator,
    grid: Mapping[str, Any],
    *,
    learn_in_test: bool,
    label_rule: str,
    score_rule: str,
    **settings: Any,
) -> Namer:
    """Train the Adaptive Clustering Network."""
    vectors = profile_vectors(profiles)
    lessons = Lessons(vectors, Similarities.of(vectors), there)
    formed = acn_training(profile_lessons=lessons, **settings, **grid)
    names = acn_names(acn_training=formed, label_rule=label_rule)["names"]

    def name(tests: Profiles, there: Views) -> Arrays:
        found = acn(
            profile_lessons=lessons,
            acn_training={key: array[None] for key, array in formed.items()},
            acn_names={"names": names[None, None]},
            averaged=tests,
            there=there,
            ship=grid["ship"],
            aspect=grid["aspect"],
            frame_count=KINDS,
            label_rule=(label_rule,),
            score_rule=(score_rule,),
            learn_in_test=learn_in_test,
            **settings | {"vigilance": (settings["vigilance"],)},
        )
        return {key: found[key][0, :, 0, 0] for key in ("predicted", "correct")}

    return name


def train_mnn(
    profiles: Profiles,
    there: Views,
    rng: np.random.Generator,
    grid: Mapping[str, Any],
    *,
    mnn_learning_rate: float,
    **settings: Any,
) -> Namer:
    """Train the multilayered network."""
    settings["learning_rate"] = mnn_learning_rate
    trained = mnn_training(expected=profiles, there=there, rng=rng, **settings, **grid)
    return lambda tests, there: mnn(
        mnn_training=trained,
        averaged=tests,
        there=there,
        ship=grid["ship"],
        aspect=grid["aspect"],
        frame_count=KINDS,
        inputs=settings["inputs"],
    )


def train_correlation(
    profiles: Profiles, there: Views, rng: np.random.Generator, grid: Mapping[str, Any]
) -> Namer:
    """Learn profiles to correlate others with."""
    lessons = profile_vectors(profiles)[None]
    taught = learned(*(grid[key] for key in VIEWS)) & there

    def name(tests: Profiles, there: Views) -> Arrays:
        found = [
            match_views(lessons, of_kind, there, taught, (False,))
            for of_kind in profile_vectors(tests)
        ]
        return {
            key: np.concatenate([one[key] for one in found]) for key in ("predicted", "correct")
        }

    return name


def answer_nothing(
    profiles: Profiles, there: Views, rng: np.random.Generator, grid: Mapping[str, Any]
) -> Namer:
    """Stand for a classifier that cannot name measured profiles."""
    return lambda tests, there: dict.fromkeys(
        ("predicted", "correct"), np.full(tests.shape[:-1], NONE)
    )


TRAINERS: dict[str, Callable[..., Namer]] = {
    "acn": train_acn,
    "mnn": train_mnn,
    "correlation": train_correlation,
}
"""Who can name measured profiles: whoever needs no moments, which nobody knows of them."""

OWN: dict[str, tuple[str, ...]] = {
    "acn": (
        *("vigilance", "learning_rate", "max_passes", "learn_in_test", "label_rule", "score_rule"),
    ),
    "mnn": (
        *("epochs", "grow_every", "mnn_learning_rate", "tolerance", "inputs", "annealing"),
        "max_hidden",
    ),
}
"""Settings that matter to each."""


@plain(uses=(Grid, Classifier, Network, Mnn), reads={"mnn_learning_rate": Mnn.learning_rate})
def lesson(
    name: str,
    vigilance: float,
    learning_rate: float,
    max_passes: int,
    learn_in_test: bool,
    label_rule: str,
    score_rule: str,
    epochs: int,
    grow_every: int,
    mnn_learning_rate: float,
    tolerance: float,
    inputs: str,
    annealing: bool,
    max_hidden: int,
) -> tuple[str, tuple[tuple[str, Any], ...]]:
    """Return who learns, and the settings that matter to it: others do not train it again."""
    given = locals()
    return name, tuple((key, given[key]) for key in OWN.get(name, ()))


@in_memory(
    uses=(Grid, Classifier),
    gather=(Grid.ship, Grid.aspect),
    noise="mnn",
    stream=(Grid.pulse_width, Irar.depression),
    keep=4,
)
def namer(
    lesson: tuple[str, tuple[tuple[str, Any], ...]],
    learned_signature: Profiles,
    there: Views,
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
    rng: np.random.Generator,
) -> Namer:
    """Return a classifier that learned synthetic profiles, for all flights."""
    name, settings = lesson
    grid = dict(zip(VIEWS, (ship, aspect, unknown, training_aspect), strict=True))
    train = TRAINERS.get(name, answer_nothing)
    return train(learned_signature, there, rng, grid, **dict(settings))


@stage(
    Output(
        "predicted",
        ("kind", "ship", "aspect"),
        "i2",
        label="ship named, as an index into the ship axis",
    ),
    Output(
        "correct",
        ("kind", "ship", "aspect"),
        "i1",
        label="1 where the answer is right: the ship, of the multilayered network its aspect bin, "
        "too",
    ),
    Output("ship_correct", ("kind", "ship", "aspect"), "i1", label="1 where the ship is right"),
    Output(
        "cell",
        ("kind", "ship", "aspect"),
        "i1",
        label="state of a cell of measured profiles",
        failed=0,
        group=STATES,
        attrs=STATE,
    ),
    gather=(Grid.ship, Grid.aspect),
    uses=(Grid,),
    group=GROUP,
    dims=(
        *("pulse_width", "depression", "classifier", "vigilance"),
        *(name for name in FLIGHT if name != "depression"),
    ),
    names=NAMES,
    when=looks(IRAR),
    status="-",
)
def measured(
    namer: Namer,
    signature: Profiles,
    there: Views,
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
) -> Arrays:
    """Return what signatures of every kind are named.

    -1 where a view is not there, or not measured. A signature that shows nothing names no ship,
    which counts as wrong.
    """
    seen = np.moveaxis(signature, 2, 0)
    absent = np.asarray(np.isnan(seen).any(axis=-1))
    found = namer(np.where(absent[..., None], seen[KINDS.index("learned")], seen), there)
    predicted, correct = (np.where(absent, NONE, found[name]) for name in ("predicted", "correct"))
    true = np.arange(len(ship))[:, None]
    return {
        "predicted": predicted,
        "correct": correct,
        "ship_correct": np.where(correct == NONE, NONE, predicted == true),
        "cell": state(correct, there),
    }


kinds_named, kinds_of_states = (
    stage(*signature_kinds.outputs, group=group, when=looks(IRAR), coordinates=True, name=name)(
        signature_kinds.function
    )
    for group, name in ((GROUP, "kinds_named"), (STATES, "kinds_of_states"))
)


def able(choices: Choices) -> tuple[str, ...]:
    """Return those classifiers of a sweep that can name measured profiles."""
    return tuple(name for name in choices[Classifier.name] if name in TRAINERS)


def check(choices: Choices) -> Choices:
    """Refuse classifiers that cannot name measured profiles; drop them where others can.

    Raises
    ------
    ConfigurationError
        Naming the key.
    """
    if not looks(IRAR)(choices):
        return choices
    names = able(choices)
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
    """Tabulate the answers about ships that are learned, and flown past."""
    known = known_ships(classified, choices)
    past = flown(choices)
    known = known.sel(ship=[ship for ship in known.ship.values.tolist() if ship in past])
    tables: Scored = {}
    for name, (prefix, what) in PROFILES.items():
        if name in known:
            tables |= scored(known[name], prefix, what)
    return data_set(tables, known.aspect)


STAGES: tuple[Stage, ...] = (lesson, namer, measured, kinds_named, kinds_of_states)
TABLES: tuple[Table, ...] = (Table("tables/measured", (GROUP,), tabulate_measured, looks(IRAR)),)
