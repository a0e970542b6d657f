"""Every figure of README.md and docs/results.md: means over seeds, with their intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import xarray as xr

from benchmarks.reports import Report
from docs._tables.repeated import list_argument, sweep_by_seed, sweep_each_seed
from docs._tables.result_flights import (
    CHAINS,
    CLUTTERS,
    FLIGHT,
    MEASURED,
    MEASURED_SHIPS,
    MISSIONS,
    NEAR_STERN,
    SENSITIVITY,
    chains,
    measured_accuracy,
    near_stern,
    sensitivity,
    tilts,
)
from docs._tables.result_learners import learners
from docs._tables.result_tables import (
    GROUPS,
    STEP,
    TEMPLATE_SPACINGS,
    TRACKS,
    UNKNOWN_SHIPS,
    Answers,
    add_known,
    categories,
    fusion,
    new_aspects,
    pairs,
    places,
    prior_knowledge,
    protocol,
    sensors,
    track_benefit,
    unknown_rejection,
)
from docs._tables.sweeping import WORKERS, sweep_groups
from studies.operate.fleets import ARTICLE
from sweeps.engine.run.cluster import ClusterChoice

SEEDS, MIN_SEEDS = 20, 2
DRAWS = 10  # of slow sweeps: trainings of the multilayered network, and flights
CLASSIFIERS = ("acn", "correlation", "likelihood")

LEARNED_ASPECTS = tuple(np.arange(0.0, 90.1, STEP).tolist())
DENSE_ASPECTS = tuple(np.arange(0.0, 90.1, TEMPLATE_SPACINGS[0]).tolist())
RANDOM_ASPECTS = 10
SOURCE_STEP = 3
LINE_RENDERER = "render.engine=lines"
SENSORS = (
    *("sensor=both", "grid.frame_count=16", "infrared.frame_count=16"),
    "infrared.vigilance=0.87",
)
RANDOM_ASPECT_SWEEP = (
    *(*SENSORS, "grid.range=[25,50,100]", "infrared.range=[25,50,100]"),
    *("infrared.super_resolution=none", "classifier.template_spacing=[1.5,3,6]"),
    "classifier.name=[acn,correlation,likelihood,fusion]",
)
SHIFTS = (
    *(*SENSORS, "grid.range=100", "infrared.range=100", "infrared.super_resolution=shifted"),
    *("classifier.template_spacing=[1.5,3,6]", "classifier.name=fusion"),
)
PRIORS = (
    *("grid.frame_count=16", "classifier.name=likelihood", "classifier.misfit_weight=0"),
    *("classifier.gain_sigma=[0,1]", "classifier.floor_sigma=[0,1]"),
)
TEMPLATE_PLACES = (1, 2, 4, 8, 16, 32)  # of templates
CORNER = ("ladar.place=corner", "classifier.template_places=1")
SHORT_RANGE = (
    *(*SENSORS, "grid.range=25", "infrared.range=25", "infrared.super_resolution=none"),
    *("classifier.template_spacing=6", "classifier.name=fusion"),
)
ASPECT_TRACKS = (
    *("grid.frame_count=16", "classifier.name=likelihood"),
    *("classifier.gain_sigma=[0,1]", "classifier.floor_sigma=[0,1]"),
    "classifier.template_spacing=[1.5,6]",
)
LEARNERS = ("grid.frame_count=16", "classifier.name=mnn", "grid.replicate=4")
PROTOCOL = (
    *("+experiment=draws", "grid.pulse_width=30", "grid.vigilance=0.95", "grid.replicate=2"),
    *("classifier.orders=4", "infrared.subpixel_offsets=2", "infrared.orders=4"),
    "classifier.name=[acn,mnn,correlation,likelihood]",
)
CATEGORIES = (
    *("grid.pulse_width=[10,30,50]", "grid.frame_count=16", "classifier.orders=8"),
    "classifier.name=acn",
)
REJECTION = ("grid.frame_count=16", "grid.range=[25,100]")
REJECT_TEMPLATE = (*REJECTION, "classifier.name=[acn,correlation]", "classifier.template_spacing=3")
REJECT_SPACING = (
    *(
        *REJECTION,
        "classifier.name=likelihood",
        f"classifier.template_spacing={list_argument(TEMPLATE_SPACINGS)}",
    ),
    "classifier.misfit_weight=[0,0.01]",
)
SOURCE_SPACING = f"classifier.template_spacing={SOURCE_STEP}"
REJECT_OTHER = (*REJECTION, "classifier.name=likelihood", SOURCE_SPACING)
GENERATED_SHIPS = 8  # of each ship learned
LONG_RANGE = ("grid.frame_count=16", "grid.range=100", "classifier.name=likelihood", SOURCE_SPACING)
CALIBRATED = ("classifier.gain_sigma=0", "classifier.floor_sigma=0")
TRACK = "classifier.aspect_sigma=5"
ALL_SHIPS = (*ARTICLE, *UNKNOWN_SHIPS)
PAIRS, PAIR_SEEDS = tuple(combinations(ALL_SHIPS, 2)), 5


def unknown_arguments(
    *alternative: str, unknown: Sequence[str] = UNKNOWN_SHIPS, tested: Sequence[str] = ARTICLE
) -> tuple[str, ...]:
    """Return the arguments of a sweep with unknown ships, some of them in the alternative."""
    absent = list(dict.fromkeys([*unknown, *alternative]))
    known_absent = [f"classifier.alternative=[{','.join(alternative)}]"] if alternative else []
    ships = ",".join(dict.fromkeys([*tested, *absent]))
    return f"grid.ship=[{ships}]", f"classifier.unknown=[{','.join(absent)}]", *known_absent


def pair_arguments(pair: Sequence[str], generated: int) -> dict[str, tuple[str, ...]]:
    """Return the arguments of sweeps with two of six ships unknown, by the alternative."""

    def arguments_for(*alternative: str) -> tuple[str, ...]:
        return unknown_arguments(*alternative, unknown=pair, tested=ALL_SHIPS)

    return {
        "none": arguments_for(),
        "generated ships": (*arguments_for(), f"classifier.generated={generated}"),
        "variants of the unknown ships": arguments_for(*_variants(pair)),
        "the unknown ships themselves": arguments_for(*pair),
    }


def _variants(ships: Iterable[str]) -> tuple[str, ...]:
    """Return a variant of each ship, drawn with twice the uncertainty of its sheet."""
    return tuple(f"{ship}@1.1x2" for ship in ships)


@dataclass(frozen=True)
class Sizes:
    """Sizes of the sweeps: as published, or smaller for a test.

    Attributes
    ----------
    seeds : int
        Number of seeds, at least two.
    draws : int
        Number of seeds of trainings of the multilayered network and of flights, at least two.
    more : tuple of str
        Arguments of `ncti-sweep` that are added to every sweep.
    learned : tuple of float
        Learned aspects, multiples of `STEP` [deg].
    fresh : int
        Number of random aspects of a seed in every 30 degrees.
    parts : tuple of str
        Names of the parts of `PARTS` that are made; all if empty.
    workers : ClusterChoice
        Where cells are computed.
    finest : tuple of float
        Learned aspects where unknown ships are rejected [deg].
    generated : int
        Number of ships that are generated of each one learned, to stand for unknown ones.
    """

    seeds: int
    draws: int = DRAWS
    more: tuple[str, ...] = ()
    learned: tuple[float, ...] = LEARNED_ASPECTS
    fresh: int = RANDOM_ASPECTS
    parts: tuple[str, ...] = ()
    workers: ClusterChoice = WORKERS
    finest: tuple[float, ...] = DENSE_ASPECTS
    generated: int = GENERATED_SHIPS

    def article_aspects(
        self, overrides: Sequence[str], groups: Sequence[str], label: str
    ) -> dict[str, xr.Dataset]:
        """Return groups of one sweep with all seeds as an axis, at the article's aspects."""
        aspects = [aspect for aspect in self.learned if aspect % SOURCE_STEP == 0]
        axes = [f"seed={list_argument(range(self.seeds))}", f"grid.aspect={list_argument(aspects)}"]
        return sweep_groups(
            [*overrides, *axes, *self.more], groups, label=label, workers=self.workers
        )

    def random_aspects(
        self, overrides: Sequence[str], groups: Sequence[str], label: str
    ) -> Answers:
        """Return groups of a sweep with the random aspects of all seeds."""
        return sweep_by_seed(
            *([*overrides, LINE_RENDERER, *self.more], groups),
            seeds=self.seeds,
            learned=self.learned,
            fresh=self.fresh,
            label=label,
            workers=self.workers,
        )

    def rejection_answers(
        self,
        overrides: Sequence[str],
        names: Sequence[str],
        label: str,
        step: float = TEMPLATE_SPACINGS[0],
        seeds: int | None = None,
    ) -> Answers:
        """Return answers of some classifiers in several draws to ships that may be unknown."""
        return sweep_by_seed(
            [*overrides, LINE_RENDERER, *self.more],
            group_names("classification/", *names),
            seeds=seeds or self.draws,
            learned=[aspect for aspect in self.finest if aspect % step == 0],
            fresh=self.fresh,
            label=label,
            workers=self.workers,
        )

    def flight_group(
        self, overrides: Sequence[str], label: str, group: str = "validation"
    ) -> xr.Dataset:
        """Return a group of a sweep of flights, of several draws."""
        arguments = [*overrides, f"grid.replicate={self.draws}", *self.more]
        return sweep_groups(arguments, [group], label=label, workers=self.workers)[group].squeeze(
            drop=True
        )

    def ship_flights(
        self, ships: Iterable[str], overrides: Sequence[str], label: str
    ) -> dict[str, xr.Dataset]:
        """Return flights past ships, each at its range."""
        at_range = {ship: (f"grid.ship={ship}", f"irar.range={MISSIONS[ship]}") for ship in ships}
        return {
            ship: self.flight_group([*overrides, *of_ship], f"{label}, {ship}")
            for ship, of_ship in at_range.items()
        }


def group_names(group: str, *names: str) -> tuple[str, ...]:
    """Return the names of groups of a store that begin alike."""
    return tuple(group + name for name in names)


def measure(sizes: Sizes) -> dict[str, Report]:
    """Return the tables by name, after the sweeps that they need."""
    reports: dict[str, Report] = {}
    for part in PARTS:
        if part in (sizes.parts or PARTS):
            reports |= MEASURES[part](sizes)
    if "summary" in reports and "known" in reports:
        reports["summary"] = add_known(reports["summary"], reports["known"])
    return reports


def _new_aspects(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of new aspects, and of fusion."""
    answers = sizes.random_aspects(RANDOM_ASPECT_SWEEP, GROUPS, "new aspects")
    shifted = sizes.random_aspects(
        SHIFTS, group_names("classification/", "fusion"), "shifted frames"
    )
    return new_aspects(answers) | {"fusion": fusion(answers, shifted)}


def _prior_knowledge(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of prior knowledge, and of places of templates."""
    groups = group_names("classification/", "likelihood")
    reports = prior_knowledge(sizes.random_aspects(PRIORS, groups, "known gain and floor"))
    at_places = {
        f"{count} place{'s' * (count > 1)}": (
            (f"classifier.template_places={count}",),
            f"templates at {count} places",
        )
        for count in TEMPLATE_PLACES
    } | {"at the corner": (CORNER, "templates and tests at the corner")}
    return reports | places(
        {
            name: sizes.rejection_answers([*PRIORS, *overrides], CLASSIFIERS[2:], label, STEP)
            for name, (overrides, label) in at_places.items()
        }
    )


def _track(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of tracks."""
    tracks = f"classifier.aspect_sigma={list_argument(TRACKS)}"
    groups = group_names("classification/", "likelihood")
    return track_benefit(
        sizes.random_aspects(ASPECT_TRACKS, groups, "aspect unknown"),
        sizes.random_aspects([*ASPECT_TRACKS, tracks], groups, "tracks"),
    )


def _sensors(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of both sensors."""
    near, far = (
        sweep_by_seed(
            [*overrides, LINE_RENDERER, *sizes.more],
            group_names("classification/", "fusion"),
            seeds=sizes.draws,
            learned=sizes.learned,
            fresh=sizes.fresh,
            label=label,
            workers=sizes.workers,
        )
        for overrides, label in ((SHORT_RANGE, "both sensors, 25 km"), (SHIFTS, "shifted frames"))
    )
    return sensors(near, far)


def _learners(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of other learners."""
    return learners(
        sweep_each_seed(
            [*LEARNERS, LINE_RENDERER, *sizes.more],
            ["range_profile", "classification/mnn"],
            seeds=sizes.draws,
            learned=sizes.learned,
            fresh=sizes.fresh,
            label="other learners",
            workers=sizes.workers,
        )
    )


def _protocol(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of the article's protocol."""
    groups = group_names("classification/", *CLASSIFIERS, "mnn", "acn_infrared")
    return protocol(sizes.article_aspects(PROTOCOL, groups, "the article's protocol"))


def _categories(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of categories."""
    return categories(
        sizes.article_aspects(CATEGORIES, group_names("classification/", "acn"), "categories")
    )


def _unknown_ships(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of unknown ships."""
    variant_arguments = unknown_arguments(*_variants(UNKNOWN_SHIPS))
    exact = unknown_arguments(*UNKNOWN_SHIPS)
    looked_up, likely, against, themselves = (
        sizes.rejection_answers([*overrides, *ships], names, label)
        for overrides, ships, names, label in (
            (REJECT_TEMPLATE, unknown_arguments(), CLASSIFIERS[:2], "unknown ships"),
            (REJECT_SPACING, unknown_arguments(), CLASSIFIERS[2:], "unknown ships, likelihood"),
            (REJECT_OTHER, variant_arguments, CLASSIFIERS[2:], "unknown ships, alternative"),
            (REJECT_OTHER, exact, CLASSIFIERS[2:], "unknown ships, bound"),
        )
    )
    blind = [*unknown_arguments(), f"classifier.generated={sizes.generated}"]
    blind_answers, calibrated, with_track = (
        sizes.rejection_answers([*LONG_RANGE, *ships], CLASSIFIERS[2:], label, SOURCE_STEP)
        for ships, label in (
            (blind, "generated ships"),
            ([*blind, *CALIBRATED], "generated ships, gain and floor known"),
            ([*blind, *CALIBRATED, TRACK], "generated ships, and a track"),
        )
    )
    generated = {
        "blind": blind_answers,
        "blind, gain and floor known": calibrated,
        "blind, gain and floor known, aspect within 5°": with_track,
    }
    return unknown_rejection(looked_up, likely, generated, against, themselves)


def _pairs(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of pairs of unknown ships."""
    return pairs(
        {
            pair: {
                alternative: sizes.rejection_answers(
                    [*LONG_RANGE, *overrides],
                    CLASSIFIERS[2:],
                    f"{' and '.join(pair)} unknown, alternative: {alternative}",
                    SOURCE_STEP,
                    seeds=min(sizes.draws, PAIR_SEEDS),
                )
                for alternative, overrides in pair_arguments(pair, sizes.generated).items()
            }
            for pair in PAIRS
        }
    )


def _flights(sizes: Sizes) -> dict[str, Report]:
    """Return the tables of flights."""
    cluttered = [*FLIGHT, f"irar.clutter={list_argument(CLUTTERS)}"]
    return (
        near_stern(sizes.ship_flights(MISSIONS, NEAR_STERN, "near-stern flights"))
        | tilts(sizes.ship_flights(MEASURED_SHIPS, cluttered, "clutter"))
        | chains(sizes.flight_group(CHAINS, "chains of corrections"))
        | sensitivity(sizes.flight_group(SENSITIVITY, "errors of navigation"))
        | measured_accuracy(
            sizes.flight_group(MEASURED, "measured profiles", "classification/measured")
        )
    )


MEASURES: dict[str, Callable[[Sizes], dict[str, Report]]] = {
    "new": _new_aspects,
    "known": _prior_knowledge,
    "track": _track,
    "sensors": _sensors,
    "learners": _learners,
    "protocol": _protocol,
    "categories": _categories,
    "unknown": _unknown_ships,
    "pairs": _pairs,
    "flights": _flights,
}
PARTS = tuple(MEASURES)
