"""Common to all classifiers: settings, training views, answers and their tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.evaluate import aspect_bins, tabulate_categories, tabulate_rejection, tabulate_scores
from ncti.evaluate.answers import VIEW
from ncti.evaluate.scores import BIN_WIDTH
from ncti.features import map_vector, profile_vector
from ncti.ships.perturbation import MAX_SIGMA_SCALE, Variant
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.settings import (
    Choices,
    Run,
    Settings,
    count,
    number,
    set_of,
    switch,
    word,
)
from sweeps.engine.declare.stage import (
    STATE,
    STATUS,
    At,
    Group,
    Output,
    Status,
    coordinate,
    derived,
    in_memory,
)
from sweeps.engine.resolve.streams import cell_rng
from sweeps.stages import scores, views
from sweeps.stages.infrared import OF_VIEWS
from sweeps.stages.ladar import FULL, PROFILE, Ladar
from sweeps.stages.refusals import refuse, require, require_among
from sweeps.stages.ships import ShipName, ship_name, ships
from sweeps.stages.views import RANGE, Arrays, Floats, Grid, Profiles

if TYPE_CHECKING:
    import xarray as xr

    from sweeps.engine.declare.stage import Condition, Stage, StageDecorator, Table

Mask = NDArray[np.bool_]
Integers = NDArray[np.integer]
Indices = NDArray[np.intp]

NO_ANSWER = -1  # category, ship or answer of a missing view
GATHERED = (Grid.ship, Grid.aspect)
OF_PROFILES = ("pulse_width", "range", "target_free_ifovs")  # dimensions of expected profiles
PROFILE_NOUN = "profiles"  # inputs of most classifiers
AVERAGE_DIMS = ("replicate", "place", "frame_count")  # and of averages
LEFT_OUT_ERROR = "classifier.left_out has True, but must be false where {} learned: no view remains"
UNSEEN = 1000  # seed of generated ships, distinct from seeds of tested variants
MIN_SIZE, MAX_SIZE = 0.7, 1.1  # of generated ships; the receiver's window holds no larger ones
DIGITS = 3  # of a drawn aspect [deg]: 2 mm at the end of a ship


class RandomAspects(Settings, key="grid"):
    """Random test aspects."""

    random_aspects = count(
        0,
        low=0,
        high=10_000,
        label="random test aspects in every 30 degrees, absent from training",
        help="added to grid.aspect, between its ends, by the seed",
        not_swept="all of them are tested together",
    )


def draw_aspects(low: float, high: float, number: int, seed: int) -> tuple[float, ...]:
    """Return aspects [deg] drawn uniformly between two ends, `number` in every 30 degrees.

    The first aspects of a bin are the same for any number, and independent of other bins.
    """
    drawn: list[float] = []
    for start in np.arange(BIN_WIDTH * (low // BIN_WIDTH), high, BIN_WIDTH):
        share = cell_rng(seed, stage="fresh_aspects", start=float(start)).random(number)
        first, last = max(low, start), min(high, start + BIN_WIDTH)
        drawn += np.round(first + share * (last - first), DIGITS).tolist()
    return tuple(drawn)


def random_test_aspects(choices: Choices, grid: tuple[float, ...]) -> tuple[float, ...]:
    """Return the random aspects [deg] of a sweep, between the ends of the grid's aspects.

    Raises
    ------
    ConfigurationError
        If `grid.aspect` has one value, or the sweep several seeds.
    """
    number = choices.value(RandomAspects.random_aspects)
    if not number:
        return ()
    if len(grid) < 2:
        reason = "where grid.aspect has one value: aspects are drawn between its ends"
        refuse(RandomAspects.random_aspects, number, f"0 {reason}")
    if len(seeds := choices[Run.seed]) > 1:
        reason = "where seed has several values: aspects are drawn by one"
        refuse(RandomAspects.random_aspects, number, f"0 {reason}")
    return draw_aspects(grid[0], grid[-1], number, seeds[0])


class Classifier(Settings, key="classifier"):
    """The classifier and its training set."""

    name = word("acn", (), label="classifier", dimension="classifier", role="dimension")
    unknown = set_of(ships(None, label="unknown ships: tested but absent from training"))
    alternative = set_of(
        ships(
            None,
            label="unknown ships with templates in the likelihood: one class, none of the others",
        )
    )
    generated = count(
        0,
        low=0,
        high=1000,
        label="ships generated of each one learned, which are unknown and in the alternative",
        help="variants at four times the uncertainty, of 0.7 to 1.1 times the size",
        not_swept="all of them are one alternative",
    )
    training_aspect = set_of(
        number(
            None,
            low=0,
            below=360,
            unit="degree",
            label="training aspects",
            help="a subset of grid.aspect; null: all except those of grid.random_aspects",
        )
    )
    template_spacing = number(
        None,
        low=0.001,
        high=90,
        unit="degree",
        label="spacing of the training aspects",
        help="selects the training aspects that are multiples of it; null: all",
    )
    test_vigilance = number(
        {"start": 0, "stop": 1, "step": 0.01},
        low=0,
        high=1,
        label="smallest similarity of an accepted answer",
        help="an answer below it counts as 'unknown'",
    )
    left_out = switch(
        False,
        label="leaving the true aspect out of training",
        help="used by correlation and likelihood",
        role="coordinate",
    )


SPACING = Classifier.template_spacing


def generated_ships(learned: Sequence[str], number: int) -> tuple[ShipName, ...]:
    """Return names of variants that stand for unseen ships, `number` for each learned ship.

    Their sizes are log-uniform from 0.7 to 1.1 times their ship's, in steps of the golden ratio, so
    that any number of them is spread evenly. The variants of a ship do not depend on the other
    learned ships.
    """
    step = np.arange(1, number + 1) * (np.sqrt(5) - 1) / 2
    sizes = MIN_SIZE * (MAX_SIZE / MIN_SIZE) ** (step % 1)
    return tuple(
        ship_name(str(Variant(str(name), UNSEEN, k, MAX_SIGMA_SCALE, round(float(size), 3))))
        for name in learned
        for k, size in enumerate(sizes, 1)
    )


def classifies_with(name: str, sensor: str) -> Condition:
    """Return the condition that a classifier and a sensor are selected."""
    return lambda choices: name in choices[Classifier.name] and views.uses_sensor(sensor)(choices)


def tested_ships(ship: Sequence[str]) -> Mask:
    """Return the (ship,) mask of tested ships: all except generated ones."""
    variants = [Variant.parse(str(name)) for name in ship]
    return np.array([variant is None or variant.seed != UNSEEN for variant in variants])


# Training views


@derived(uses=(Grid, RandomAspects, Run), gather=(Grid.aspect,))
def test_aspects(aspect: tuple[float, ...], random_aspects: int, seed: int) -> tuple[float, ...]:
    """Return the random test aspects, which training leaves out by default."""
    return draw_aspects(aspect[0], aspect[-1], random_aspects, seed)


@dataclass(frozen=True)
class AspectSelection:
    """Aspects to learn: given ones, or all except test aspects; then multiples of a spacing."""

    training_aspect: tuple[float, ...] | None
    template_spacing: float | None
    test_aspects: tuple[float, ...]

    def mask(self, aspect: Sequence[float]) -> Mask:
        """Return the (aspect,) mask of aspects in the training set."""
        if self.training_aspect is None:
            learned = ~np.isin(aspect, self.test_aspects)
        else:
            learned = np.isin(aspect, self.training_aspect)
        if self.template_spacing is not None:
            steps = np.array(aspect) / self.template_spacing
            learned &= np.isclose(steps, np.round(steps), rtol=0, atol=1e-6)
        return learned


aspect_selection = derived(uses=(Classifier,), name="aspect_selection")(AspectSelection)


@in_memory(uses=(Grid, Classifier), gather=GATHERED)
def training_views(
    ship: tuple[str, ...],
    aspect: tuple[float, ...],
    unknown: tuple[str, ...] | None,
    aspect_selection: AspectSelection,
) -> Mask:
    """Return the (ship, aspect) mask of training views."""
    return training_ships(ship, unknown)[:, None] & aspect_selection.mask(aspect)


def training_ships(ship: tuple[str, ...], unknown: tuple[str, ...] | None) -> Mask:
    """Return the (ship,) mask of ships in the training set."""
    return ~np.isin(np.array(ship, dtype=str), np.array(unknown or (), dtype=str))


def training_aspects(aspect: tuple[float, ...], aspect_selection: AspectSelection) -> Mask:
    """Return the (aspect,) mask of aspects in the training set."""
    return aspect_selection.mask(aspect)


def training_marks(of: Group) -> tuple[Stage, Stage]:
    """Declare the coordinates `learned` and `known` of a group that classifiers read."""
    of = replace(of, uses=(Grid, Classifier))
    learned = "in the training set, at ships that are known; others are tests only"
    known = "in the training set; others are unknown to classifiers"
    aspects = coordinate("learned", ("aspect",), "?", learned, without=(Run.seed.name,))
    ships = coordinate("known", ("ship",), "?", known)
    return (
        of.stage(aspects, gather=GATHERED[1:], name=f"{of.path}_learned")(training_aspects),
        of.stage(ships, gather=GATHERED[:1], name=f"{of.path}_known")(training_ships),
    )


def _views_by_spacing(choices: Choices) -> list[Mask]:
    """Return the (ship, aspect) mask of a sweep's training views for every template spacing."""
    arguments = (*(choices[setting] for setting in GATHERED), choices.value(Classifier.unknown))
    drawn = random_test_aspects(choices, choices[Grid.aspect])
    aspects = choices.value(Classifier.training_aspect)
    return [
        training_views(*arguments, AspectSelection(aspects, spacing, drawn))
        for spacing in choices[SPACING]
    ]


def training_view_mask(choices: Choices) -> xr.DataArray:
    """Return the (ship, aspect) mask of a sweep's training views, by template spacing.

    The spacing is a dimension where it is an axis.
    """
    import xarray as xr

    spacings = {SPACING.name: list(choices[SPACING])}
    learned = xr.DataArray(_views_by_spacing(choices), spacings, (SPACING.name, *VIEW))
    return learned if len(learned) > 1 else learned.isel({SPACING.name: 0}, drop=True)


def training_ship_mask(choices: Choices) -> xr.DataArray:
    """Return the (ship,) mask of the ships in a sweep's training set."""
    learned = training_view_mask(choices)
    return learned.any([dim for dim in learned.dims if dim != "ship"])


def aspect_masks(choices: Choices) -> dict[str, xr.DataArray]:
    """Return masks of the kinds of aspects of a sweep: see `kinds_of_aspects`."""
    import xarray as xr

    aspects = choices[Grid.aspect]
    drawn = xr.DataArray(np.isin(aspects, random_test_aspects(choices, aspects)), dims="aspect")
    return kinds_of_aspects(training_view_mask(choices).any("ship"), drawn)


def kinds_of_aspects(learned: xr.DataArray, drawn: xr.DataArray) -> dict[str, xr.DataArray]:
    """Return masks of learned, intermediate and random aspects, of the kinds present."""
    kinds = {"learned": learned, "between": ~learned & ~drawn, "random": ~learned & drawn}
    return {name: mask for name, mask in kinds.items() if mask.any()}


def check(choices: Choices) -> Choices:
    """Refuse unknown ships and training aspects that the grid lacks or that leave no training.

    Random aspects are added to the grid, but not learned.
    """
    aspects = choices[Grid.aspect]
    drawn = random_test_aspects(choices, aspects)
    choices = choices.replace(Grid.aspect, tuple(sorted({*aspects, *drawn})))
    ships_given, unknown = choices[Grid.ship], choices.value(Classifier.unknown) or ()
    require_among(choices, Classifier.unknown, Grid.ship)
    require_among(choices, Classifier.training_aspect, Grid.aspect)
    for name in choices.value(Classifier.alternative) or ():
        if name not in unknown:
            allowed = ", ".join(unknown) or "none of them, as there are none"
            refuse(Classifier.alternative, repr(str(name)), f"of classifier.unknown: {allowed}")
    if len(unknown) == len(ships_given):
        refuse(Classifier.unknown, "every ship of grid.ship", "fewer, which leave one to learn")
    for spacing, learned in zip(choices[SPACING], _views_by_spacing(choices), strict=True):
        if spacing is not None and not learned.any():
            refuse(SPACING, spacing, "such that an aspect learned is a multiple of it")
    return choices


def check_left_out(choices: Choices) -> None:
    """Refuse to leave the true aspect out if no other aspect is learned."""
    aspects = min(int(learned.any(axis=0).sum()) for learned in _views_by_spacing(choices))
    if any(choices[Classifier.left_out]) and aspects < 2:
        raise ConfigurationError(LEFT_OUT_ERROR.format(f"{aspects} aspect is"))


def require_another_aspect(training_views: Mask, left_out: bool) -> None:
    """Raise `ValueError` if `left_out` has no other aspect left, because views failed."""
    if left_out and training_views.any(axis=0).sum() < 2:
        raise ValueError(LEFT_OUT_ERROR.format("fewer than two aspects are"))


def check_receiver(choices: Choices, name: str) -> None:
    """Refuse every receiver but the full profile, whose moments the classifier needs."""
    reason = f"for the classifier {name}, which knows the moments of no other"
    require(choices, Ladar.receiver, FULL, reason)


# Inputs


def profile_vectors(profiles: Profiles | Floats) -> Floats:
    """Return (..., ship, aspect, bin) profiles as (..., view, bin) vectors, zero where missing."""
    return to_vectors(stack_views(profiles))


def stack_views(profiles: Profiles | Floats) -> Profiles | Floats:
    """Return (..., ship, aspect, bin) profiles as (..., view, bin) ones."""
    return profiles.reshape(*profiles.shape[:-3], -1, profiles.shape[-1])


def to_vectors(profiles: Profiles | Floats) -> Floats:
    """Return the vectors of (..., bin) profiles, zero for missing ones."""
    return profile_vector(np.where(np.isfinite(profiles), profiles, 0.0))


def map_vectors(maps: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return (..., ship, aspect, angle, radius) maps as (..., view, feature) shares of cells."""
    return map_vector(maps.reshape(*maps.shape[:-4], -1, *maps.shape[-2:]))


def read_in_blocks(*names: str) -> dict[str, At]:
    """Return reads of stages whose results are gathered over all views, in blocks."""
    return {name: At(name, in_blocks=True) for name in names}


# Answers


def mark_answers(named: Integers, valid: Mask, tested: Mask | None = None) -> Arrays:
    """Return the arrays of answers: (..., ship, aspect) predictions for existing views.

    Views that are not `tested` have no answer.
    """
    answered = valid if tested is None else valid & tested
    predicted = np.where(answered, named, NO_ANSWER)
    right = predicted == np.arange(len(valid))[:, None]
    correct = np.where(answered, right, np.int8(NO_ANSWER))
    return {"predicted": predicted, "correct": correct, "cell": answer_state(correct, valid)}


def answer_state(correct: Integers, valid: Mask) -> NDArray[np.int8]:
    """Return the state of answers: done, failed without a view, missing if not requested."""
    return np.where(correct >= 0, 1, np.where(valid, -1, 0)).astype("i1")


def best_ships(posterior: tuple[Integers, Floats], true: Integers) -> tuple[Integers, Floats]:
    """Return (view,) most probable ships and probabilities of the true ones, 0 if unknown.

    `posterior` has the ships and their (view, ship) probabilities.
    """
    ships, probability = posterior
    is_true = ships == true[:, None]
    return ships[probability.argmax(axis=1)], (probability * is_true).sum(axis=1)


# Declarations


def known_ships(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the answers about ships in the training set; unknown ones cannot be right."""
    return classified.isel(ship=np.flatnonzero(training_ship_mask(choices)))


def tabulate_answers(
    classified: xr.Dataset, choices: Choices, source: str = PROFILE_NOUN
) -> xr.Dataset:
    """Return all scores of answers by aspect bin, of ships in training.

    Tables of range profiles have the receiver as an attribute, if all have the same.
    """
    table = tabulate_scores(known_ships(classified, choices), aspect_masks(choices), source)
    receivers = choices.values.get(Ladar.receiver.key, ())
    one_receiver = len(receivers) == 1 and source == PROFILE_NOUN
    return table.assign_attrs({"receiver": receivers[0]} if one_receiver else {})


@dataclass(frozen=True, eq=False)
class ClassifierGroup(Group):
    """A group of answers, with the declarations of its stages and tables."""

    answer: tuple[str, ...] = VIEW  # dimensions of an answer

    @classmethod
    def of_classifier(
        cls, name: str, when: Condition, dims: tuple[str, ...], **options: Any
    ) -> ClassifierGroup:
        """Return the group of a classifier."""
        return cls(f"classification/{name}", when, dims=dims, status=Status(name), **options)

    @property
    def name(self) -> str:
        """Name of the classifier, and of its tables."""
        return self.path.rpartition("/")[2]

    def answers(
        self, *outputs: Output, without: tuple[str, ...] = (), right: str = "", **options: Any
    ) -> StageDecorator:
        """Declare the stage that names ships, with any further outputs.

        The predicted ship does not depend on the settings `without`; `right` extends the label.
        """
        label = "ship named, as an index into the ship axis"
        return self.stage(
            Output("predicted", self.answer, "i2", label=label, without=without),
            Output("correct", self.answer, "i1", label=f"1 where the answer is right{right}"),
            *outputs,
            Output("cell", self.answer, "i1", "state of the cell", role=STATE),
            **{"gather": GATHERED, **options},
        )

    def coordinates(
        self, *outputs: Output, **options: Any
    ) -> Callable[[Callable[..., Any]], tuple[Stage, ...]]:
        """Declare coordinates of the group of answers and of the group of cell states."""
        groups = self, replace(self, path=STATUS)
        return lambda function: tuple(
            group.stage(*outputs, name=f"{function.__name__}_{k}", **options)(function)
            for k, group in enumerate(groups)
        )

    def tables(
        self,
        make: Callable[..., xr.Dataset] = tabulate_answers,
        *,
        rejecting: bool = False,
        forming: bool = False,
        labels: Mapping[str, str] | None = None,
        scored: str = "ship",
    ) -> tuple[Table, ...]:
        """Return the tables of the group: scores and, on request, categories and rejection.

        `forming` adds categories, and `rejecting` adds rejection where a ship is unknown. `labels`
        mark the rows of this classifier; `scored` names the rule of a right answer.
        """
        labels = {"classifier": self.name, "channel": RANGE} if labels is None else labels

        def ship_chance(choices: Choices) -> float:
            return 100.0 / int(training_ship_mask(choices).sum())

        def answer_chance(choices: Choices) -> float:
            classes = 1 if scored == "ship" else len(aspect_bins(choices[Grid.aspect])[0])
            return ship_chance(choices) / classes

        def tabulate_formed(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
            return tabulate_categories(known_ships(classified, choices))

        def tabulate_rejected(classified: xr.Dataset, choices: Choices) -> xr.Dataset:
            vigilances = choices[Classifier.test_vigilance]
            # Ships of the alternative are known to it, so they do not test rejection.
            tested = ~np.isin(choices[Grid.ship], choices.value(Classifier.alternative) or ())
            arguments = (
                training_ship_mask(choices).isel(ship=tested),
                aspect_masks(choices),
                vigilances,
            )
            return tabulate_rejection(classified.isel(ship=tested), *arguments)

        def has_unknown_ships(choices: Choices) -> bool:
            return self.when(choices) and not bool(training_ship_mask(choices).all())

        name, chance = self.name, (answer_chance, ship_chance)
        answer_displays = scores.score_displays(labels, scored=scored, source=name, chance=chance)
        tables = [self.table(name, make, *answer_displays)]
        if forming:
            display = scores.category_display(labels, name)
            tables.append(self.table(f"categories_{name}", tabulate_formed, display))
        if rejecting:
            displays = scores.rejection_displays(labels)
            tables.append(
                replace(self, when=has_unknown_ships).table(
                    f"rejection_{name}", tabulate_rejected, *displays
                )
            )
        return tuple(tables)


def of_profiles(name: str, *extra_dims: str) -> ClassifierGroup:
    """Return the group of a classifier of range profiles, with its own dimensions."""
    return ClassifierGroup.of_classifier(
        name, classifies_with(name, RANGE), (*OF_PROFILES, *extra_dims, *AVERAGE_DIMS)
    )


PROFILE_MARKS, IMAGE_MARKS = map(training_marks, (PROFILE, OF_VIEWS))


WORDS = {Classifier.name: "NAME"}

STAGES = (
    test_aspects,
    aspect_selection,
    training_views,
    PROFILE_MARKS,
    IMAGE_MARKS,
)
