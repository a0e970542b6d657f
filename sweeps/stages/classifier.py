"""Common to all classifiers: settings, training views, answers and their tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.features import profile_vector
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Run, Settings, number, set_of, switch, word
from sweeps.engine.stage import Condition, Output, Stage, Table, in_memory, stage
from sweeps.stages.fresh import Fresh, drawn_aspects, fresh_aspects
from sweeps.stages.scores import VIEW, data_set, formed, scored_profiles, tabulate_rejection
from sweeps.stages.views import INFRARED, RANGE, Grid, looks, ships

if TYPE_CHECKING:
    import xarray as xr

Arrays = dict[str, NDArray[Any]]
Views = NDArray[np.bool_]
Ships = NDArray[np.integer]
Floats = NDArray[np.float64]
Profiles = NDArray[np.float32]

NONE = -1  # of a category, a ship, or an answer: the view is not there
STATE = {"flag_values": [-1, 0, 1], "flag_meanings": "missing failed done"}
GATHERED = (Grid.ship, Grid.aspect)
OF_PROFILES = ("pulse_width", "range", "target_free_ifovs")  # dimensions of expected profiles
RECEIVER, FULL = "ladar.receiver", "full_profile"  # key of a setting, and one of its words

LEFT_ALONE = (
    "classifier.left_out has True, but must be false where {} learned: nothing would be left"
)


class Classifier(Settings, key="classifier"):
    """The classifier and its training set; the experiment gives `name` its words."""

    name = word("acn", (), label="classifier", dimension="classifier", shown=True)
    unknown = set_of(ships(None, label="unknown ships: tested but absent from training"))
    training_aspect = set_of(
        number(
            *(None, 0),
            below=360,
            unit="degree",
            label="training aspects",
            help="a subset of grid.aspect; null: all except those of grid.fresh",
        )
    )
    template_spacing = number(
        *(None, 0.001, 90),
        unit="degree",
        label="spacing of the training aspects",
        help="selects the training aspects that are multiples of it; null: all",
    )
    test_vigilance = number(
        *({"start": 0, "stop": 1, "step": 0.01}, 0, 1),
        label="smallest similarity of an accepted answer",
        help="an answer below it counts as 'unknown'",
    )
    left_out = switch(
        False,
        label="leaving the true aspect out of training",
        help="used by correlation and likelihood",
        noted=True,
    )


SPACING = Classifier.template_spacing


def names_by(name: str, sensor: str) -> Condition:
    """Return the condition that a classifier and a sensor are selected."""
    return lambda choices: name in choices[Classifier.name] and looks(sensor)(choices)


# Training views


@stage(uses=(Grid, Fresh, Run), gather=(Grid.aspect,), plain=True)
def random_aspects(aspect: tuple[float, ...], fresh: int, seed: int) -> tuple[float, ...]:
    """Return the aspects drawn at random, which are absent from training by default."""
    return drawn_aspects(aspect[0], aspect[-1], fresh, seed)


@in_memory(uses=(Grid, Classifier), gather=GATHERED)
def training_views(
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    training_aspect: tuple[float, ...] | None,
    template_spacing: float | None = None,
    random_aspects: tuple[float, ...] = (),
) -> Views:
    """Return the (ship, aspect) mask of training views."""
    learned = training_aspects(aspect, training_aspect, template_spacing, random_aspects)
    return training_ships(ship, unknown)[:, None] & learned


def training_ships(ship: tuple[str, ...], unknown: tuple[str, ...] | None) -> Views:
    """Return the (ship,) mask of ships in the training set."""
    return ~np.isin(np.array(ship, dtype=str), np.array(unknown or (), dtype=str))


def training_aspects(
    aspect: tuple[float, ...],
    training_aspect: tuple[float, ...] | None,
    template_spacing: float | None,
    random_aspects: tuple[float, ...],
) -> Views:
    """Return the (aspect,) mask of aspects in the training set."""
    given = training_aspect
    learned = ~np.isin(aspect, random_aspects) if given is None else np.isin(aspect, given)
    if template_spacing is not None:
        steps = np.array(aspect) / template_spacing
        learned &= np.isclose(steps, np.round(steps), rtol=0, atol=1e-6)
    return learned


def training_marks(sensor: str, group: str) -> tuple[Stage, Stage]:
    """Declare the coordinates `learned` and `known` of a group that classifiers read."""
    uses, place = (Grid, Classifier), {"group": group, "when": looks(sensor), "coordinates": True}
    learned = "in the training set, at ships that are known; others are tests only"
    known = "in the training set; others are unknown to classifiers"
    aspects = Output("learned", ("aspect",), "?", learned, fill=0, without=(Run.seed.name,))
    ships = Output("known", ("ship",), "?", known, fill=0)
    return (
        stage(aspects, uses=uses, gather=GATHERED[1:], name=f"{group}_learned", **place)(
            training_aspects
        ),
        stage(ships, uses=uses, gather=GATHERED[:1], name=f"{group}_known", **place)(
            training_ships
        ),
    )


def learned_of(choices: Choices) -> xr.DataArray:
    """Return the (ship, aspect) mask of a sweep's training views, by template spacing.

    The spacing is a dimension where it is an axis.
    """
    import xarray as xr

    of_all = (*(choices[one] for one in GATHERED), choices.one(Classifier.unknown))
    training, spacings = choices.one(Classifier.training_aspect), choices[SPACING]
    drawn = fresh_aspects(choices, choices[Grid.aspect])
    views = [training_views(*of_all, training, one, drawn) for one in spacings]
    found = xr.DataArray(views, {SPACING.name: list(spacings)}, (SPACING.name, *VIEW))
    return found if len(spacings) > 1 else found.isel({SPACING.name: 0}, drop=True)


def known_of(choices: Choices) -> xr.DataArray:
    """Return the (ship,) mask of the ships in a sweep's training set."""
    learned = learned_of(choices)
    return learned.any([dim for dim in learned.dims if dim != "ship"])


def aspects_of(choices: Choices) -> dict[str, xr.DataArray]:
    """Return masks of learned, intermediate and random aspects, of kinds that there are."""
    import xarray as xr

    learned = learned_of(choices).any("ship")
    aspects = choices[Grid.aspect]
    drawn = xr.DataArray(np.isin(aspects, fresh_aspects(choices, aspects)), dims="aspect")
    found = {"learned": learned, "between": ~learned & ~drawn, "random": ~learned & drawn}
    return {name: where for name, where in found.items() if where.any()}


def check(choices: Choices) -> Choices:
    """Refuse unknown ships and training aspects that the grid lacks, or that leave nothing.

    Aspects that are drawn come into the grid, and are not learned.
    """
    given = choices[Grid.aspect]
    drawn = fresh_aspects(choices, given)
    choices = choices.having(Grid.aspect, tuple(sorted({*given, *drawn})))
    there, unknown = choices[Grid.ship], choices.one(Classifier.unknown) or ()
    for name in unknown:
        if name not in there:
            raise ConfigurationError(
                f"classifier.unknown has {str(name)!r}, but every value must be one of "
                f"{', '.join(there)}, the values of grid.ship"
            )
    if len(unknown) == len(there):
        raise ConfigurationError(
            "classifier.unknown has every ship of grid.ship, but must leave one to learn"
        )
    for aspect in choices.one(Classifier.training_aspect) or ():
        if aspect not in choices[Grid.aspect]:
            raise ConfigurationError(
                f"classifier.training_aspect has {aspect:g}, but every value must be one of "
                "grid.aspect"
            )
    given = choices.one(Classifier.training_aspect)
    drawn = fresh_aspects(choices, choices[Grid.aspect])
    for spacing in choices[SPACING]:
        of_all = choices[GATHERED[0]], choices[Grid.aspect], unknown, given, spacing, drawn
        if spacing is not None and not training_views(*of_all).any():
            raise ConfigurationError(
                f"{SPACING.key} has {spacing:g}, but must have a multiple among the aspects learned"
            )
    return choices


def check_left_out(choices: Choices) -> None:
    """Refuse to leave the true aspect out where no other is learned."""
    aspects = int(learned_of(choices).any("ship").sum("aspect").min())
    if any(choices[Classifier.left_out]) and aspects < 2:
        raise ConfigurationError(LEFT_ALONE.format(f"{aspects} aspect is"))


def require_another_aspect(training_views: Views, left_out: tuple[bool, ...]) -> None:
    """Refuse (`ValueError`) the same where views failed and so are absent from training."""
    if any(left_out) and training_views.any(axis=0).sum() < 2:
        raise ValueError(LEFT_ALONE.format("fewer than two aspects are"))


def check_receiver(choices: Choices, name: str) -> None:
    """Refuse receivers whose moments a classifier needs and lacks."""
    for receiver in choices.values[RECEIVER]:
        if receiver != FULL:
            raise ConfigurationError(
                f"{RECEIVER} is {receiver!r}, but must be {FULL} for the classifier {name}, "
                "which knows the moments of no other"
            )


# Inputs


def profile_vectors(profiles: Profiles | Floats) -> Floats:
    """Return (..., ship, aspect, bin) profiles as (..., view, bin) vectors, zero where missing."""
    flat = profiles.reshape(*profiles.shape[:-3], -1, profiles.shape[-1])
    return profile_vector(np.where(np.isfinite(flat), flat, 0.0))


def map_vectors(maps: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return (..., ship, aspect, angle, radius) maps as (..., view, feature) shares of cells."""
    flat = maps.reshape(*maps.shape[:-4], -1, maps.shape[-2] * maps.shape[-1])
    return np.asarray(flat * np.float32(1 / np.iinfo(maps.dtype).max), dtype=np.float32)


# Answers


def judged(named: Ships, there: Views) -> Arrays:
    """Return the arrays of answers: (..., ship, aspect) ships predicted for existing views."""
    predicted = np.where(there, named, NONE)
    correct = np.where(there, predicted == np.arange(len(there))[:, None], NONE)
    return {"predicted": predicted, "correct": correct, "cell": state(correct, there)}


def state(correct: Ships, there: Views) -> NDArray[np.int8]:
    """Return the state of answers: done, failed without a view, missing if not requested."""
    return np.where(correct >= 0, 1, np.where(there, -1, 0)).astype("i1")


def most_probable(posterior: tuple[Ships, Floats], true: Ships) -> tuple[Ships, Floats]:
    """Return (view,) most probable ships and probabilities of the true ones, 0 if unknown.

    Of the ships there are, and their (view, ship) probabilities.
    """
    ships, probability = posterior
    own = ships == true[:, None]
    return ships[probability.argmax(axis=1)], (probability * own).sum(axis=1)


# Declarations


def known_ships(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the answers about ships in the training set; unknown ones cannot be right."""
    return classified.isel(ship=np.flatnonzero(known_of(choices)))


def tabulate_answers(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return all scores of answers about range profiles by aspect bin, of ships in training.

    Where categories form, with their numbers; with the receiver for an attribute, if all have one.
    """
    known = known_ships(classified, choices)
    tables = formed(known, "training profiles") if "training_category" in known else {}
    found = data_set(tables | scored_profiles(known, aspects_of(choices)), known.aspect)
    receivers = choices.values.get(RECEIVER, ())
    return found.assign_attrs({"receiver": receivers[0]} if len(receivers) == 1 else {})


@dataclass(frozen=True)
class Naming:
    """A group of answers, with the declarations of its stages and tables.

    Its name, and those of its tables; when a configuration has it; whose cells there are states
    of, and their group, by the name when empty; and the dimensions of an answer.
    """

    name: str
    when: Condition
    of: str = ""
    states: str = ""
    dims: tuple[str, ...] = VIEW

    def stage(self, *outputs: Output, **how: Any) -> Callable[[Callable[..., Any]], Stage]:
        """Declare a stage of the group; see `sweeps.engine.stage.stage`."""
        group = f"classification/{self.name}"
        return stage(*outputs, group=group, when=self.when, status="-", **how)

    def answers(
        self,
        *outputs: Output,
        without: tuple[str, ...] = (),
        right: str = "",
        gather: tuple[Any, ...] = GATHERED,
        **how: Any,
    ) -> Callable[[Callable[..., Any]], Stage]:
        """Declare the stage that names ships, which may have more outputs.

        The ship named does not depend on some settings, and more than it may have to be right.
        """
        named = "ship named, as an index into the ship axis"
        states = self.states or f"status_{self.name}"
        state = f"state of a cell of {self.of or self.name}"
        return self.stage(
            Output("predicted", self.dims, "i2", label=named, without=without),
            Output("correct", self.dims, "i1", label=f"1 where the answer is right{right}"),
            *outputs,
            Output("cell", self.dims, "i1", label=state, failed=0, group=states, attrs=STATE),
            gather=gather,
            **how,
        )

    def tables(
        self, make: Callable[..., xr.Dataset] = tabulate_answers, *, rejecting: bool = False
    ) -> tuple[Table, ...]:
        """Return the tables of the group; of rejections, too, where a ship is not learned."""
        group = (f"classification/{self.name}",)

        def reject(found: xr.Dataset, choices: Choices) -> xr.Dataset:
            known, aspects = known_of(choices), aspects_of(choices)
            return tabulate_rejection(found, known, aspects, choices[Classifier.test_vigilance])

        def asked(choices: Choices) -> bool:
            return self.when(choices) and not bool(known_of(choices).all())

        scores = Table(f"tables/{self.name}", group, make, self.when)
        rejections = Table(f"tables/rejection_{self.name}", group, reject, asked)
        return (scores, rejections) if rejecting else (scores,)


SETTINGS: tuple[type[Settings], ...] = (Fresh, Classifier)
STAGES: tuple[Stage, ...] = (
    random_aspects,
    training_views,
    *training_marks(RANGE, "range_profile"),
    *training_marks(INFRARED, "infrared"),
)
