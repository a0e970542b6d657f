"""What a configuration may say of the infrared airborne radar's flights."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import trimesh

from ncti.irar import Flight, Window, plan_scan, ship_heading
from ncti.irar.chain import MIRROR_METHODS, RANGE_FILTERS
from ncti.irar.registration import MOTION_METHODS
from sweeps.classifier_schema import ACN, CORRELATION, EXPECTED, MNN, ClassifierConfig
from sweeps.errors import ConfigurationError
from sweeps.flight_grid import FlightErrors, FlightGrid, believed, parameters, passes
from sweeps.grid import (
    Grid,
    between,
    count_axis,
    number_axis,
    optional_axis,
    ship_axis,
    ship_label,
    switch_axis,
    word_axis,
)
from sweeps.sensor_schema import MOST_FRAMES

OF_MEASURED = (ACN, MNN, CORRELATION)  # classifiers that can name a measured profile
ALONE = ("learning_rate", "label_rule", "score_rule", "training", "left_out")
ALONE_OF_MNN = ("epochs", "grow_every", "learning_rate", "tolerance", "inputs", "annealing")

EXACT = "exact"
RATES = {"printed": "line", "printed_pulse_rate": "pulse"}
"""Of the source's corrections, as printed: what f is, the line rate, or the pulse-repetition
frequency that it says f is."""
SLOWEST, FASTEST = 0.25, 1.9  # believed closing speeds, of the true one

NUMBERS = {  # axes: least and most, in the units of the configuration
    "range": (0.1, 1000),
    "depression": (0.1, 60),
    "aircraft_speed": (1, 1000),
    "ship_speed": (0, 50),
    "aircraft_heading": (-360, 360),
    "offset": (-360, 360),
    "mirror_angle": (1, 80),
    "ifov": (1, 10_000),
    "line_rate": (1, 100_000),
    "pulse_rate": (1, 1e9),
    "range_gate": (10, 1e5),
    "jitter": (0, 10_000),
    "jitter_time": (1e-6, 1000),
    "transom_gain": (0, 1000),
    "mast_gain": (0, 1000),
    "cnr": (-100, 90),
    "pulse_width": (2, 1000),
    "range_sigma": (0, 100),
    "threshold": (0, 1e9),
    "nedt": (0, 1000),
}
COUNTS = {"samples": (2, 10_000), "detectors": (1, 1000)}
WITH_NULL = ("aircraft_track", "pointing")  # deg; null: what the heading, or the ship, has them be
WORDS = {
    "chain": (EXACT, *RATES),
    "azimuth": (*MOTION_METHODS, "none"),
    "mirror": MIRROR_METHODS,
    "range_filter": RANGE_FILTERS,
}


@dataclass
class FlightConfig:
    """The infrared airborne radar: its flight, its sensor, and how its images are corrected."""

    range: Any = 3.9
    depression: Any = 6.7
    aircraft_speed: Any = 90.0
    ship_speed: Any = 8.0
    aircraft_heading: Any = 0.0
    aircraft_track: Any = None
    offset: Any = 5.0
    pointing: Any = None
    mirror_angle: Any = 45.0
    ifov: Any = 205.0
    line_rate: Any = 119.0
    samples: Any = 160
    pulse_rate: Any = 20_000.0
    range_gate: Any = 300.0
    detectors: Any = 12
    jitter: Any = 0.0
    jitter_time: Any = 0.1
    cnr: Any = 20.0
    pulse_width: Any = 30.0
    range_sigma: Any = 1.0
    threshold: Any = 4.0
    nedt: Any = 0.4
    transom_gain: Any = 1.0
    mast_gain: Any = 1.0
    chain: Any = EXACT
    azimuth: Any = "pixel"
    mirror: Any = "exact"
    range_filter: Any = "cluster"
    autofocus: Any = False
    errors: FlightErrors = field(default_factory=FlightErrors)
    segmentation_threshold: float | None = None
    profile_range: float = 100.0
    profile_frames: int = 16
    flown: Any = None
    pictures: bool = False

    def __post_init__(self) -> None:
        """Check the ranges of what is no axis."""
        between("irar.profile_range", self.profile_range, 1, 1000)
        between("irar.profile_frames", self.profile_frames, 1, MOST_FRAMES)
        if self.segmentation_threshold is not None:
            between("irar.segmentation_threshold", self.segmentation_threshold, 0, 1e9)

    def expand(self, replicate: tuple[int, ...] = (0,)) -> FlightGrid:
        """Every value of every axis, checked; draws are numbered by the grid."""
        values: dict[str, Any] = {
            name: number_axis(f"irar.{name}", getattr(self, name), minimum=low, maximum=high)
            for name, (low, high) in NUMBERS.items()
        }
        values |= {
            name: count_axis(f"irar.{name}", getattr(self, name), minimum=low, maximum=high)
            for name, (low, high) in COUNTS.items()
        }
        values |= {
            name: optional_axis(f"irar.{name}", getattr(self, name), minimum=-360, maximum=360)
            for name in WITH_NULL
        }
        values |= {
            name: word_axis(f"irar.{name}", getattr(self, name), allowed)
            for name, allowed in WORDS.items()
        }
        self._check_chain(values)
        return FlightGrid(
            flown_pulse_width=values.pop("pulse_width"),
            **values,
            autofocus=switch_axis("irar.autofocus", self.autofocus),
            error=self.errors.expand(),
            replicate=replicate,
        )

    def _check_chain(self, values: dict[str, Any]) -> None:
        """The source's chain has its own way with columns, the mirror and ranges."""
        printed = next((name for name in values["chain"] if name != EXACT), None)
        for name in ("azimuth", "mirror", "range_filter") if printed else ():
            own = FlightConfig.__dataclass_fields__[name].default
            if values[name] != (own,):
                raise ConfigurationError(
                    f"irar.{name} is {', '.join(values[name])}, but must be {own} where irar.chain "
                    f"has {printed}, which has a way of its own"
                )

    def flies(self, ships: tuple[str, ...]) -> tuple[str, ...]:
        """Those ships that are flown past; the others are learned only."""
        if self.flown is None:
            return ships
        for name in ship_axis("irar.flown", self.flown):
            if name not in ships:
                raise ConfigurationError(
                    f"irar.flown has {name!r}, but every value must be one of {', '.join(ships)}, "
                    "the values of grid.ship"
                )
        return tuple(name for name in ships if name in ship_axis("irar.flown", self.flown))

    def flight(self, aspect: float, **values: Any) -> Flight:
        """A pass by a ship at an aspect [deg], of values on the axes of `FLOWN` and `RECORDED`."""
        sight = values["aircraft_heading"] + values["offset"]
        return Flight(ship_heading=ship_heading(aspect=aspect, sight=sight), **parameters(values))

    def check(self, aspects: tuple[float, ...]) -> None:
        """Refuse what cannot be flown, or be believed of a flight, at some aspect.

        Raises
        ------
        ConfigurationError
            Naming the key.
        """
        grid = self.expand()
        for aspect, values in product(aspects, passes(grid)):
            try:
                flight = self.flight(aspect, **values)
            except ValueError as error:
                raise ConfigurationError(_of_key(error, values["range"])) from error
            for parameter, value in grid.error:
                try:
                    speed = believed(flight, (parameter, value)).closing_speed
                except ValueError as error:
                    raise ConfigurationError(
                        f"irar.errors.{parameter} has {value:g}, with which {error}"
                    ) from error
                least, most = (share * flight.closing_speed for share in (SLOWEST, FASTEST))
                if not least <= speed <= most:
                    raise ConfigurationError(
                        f"irar.errors.{parameter} has {value:g}, with which the ship comes closer "
                        f"at {speed:.3g} m/s, but must be such that it does at {least:.3g} to "
                        f"{most:.3g}"
                    )

    def check_ship(self, label: str, hull: trimesh.Trimesh, aspects: tuple[float, ...]) -> None:
        """Refuse flights that do not see a whole ship, as `check` does."""
        for aspect, values in product(aspects, passes(self.expand())):
            try:
                plan = plan_scan(hull, self.flight(aspect, **values))
            except ValueError as error:
                raise ConfigurationError(
                    f"{_of_key(error, values['range'])} ({label} at {aspect:g} deg)"
                ) from error
            if not plan.meets(hull):
                raise ConfigurationError(
                    f"irar.pointing has {values['pointing']:g}, but must be nearer "
                    f"{values['offset']:g}, irar.offset: no sample meets {label} at {aspect:g} deg"
                )


@dataclass(frozen=True)
class FlightPlan:
    """What all flights of a sweep have in common.

    Attributes
    ----------
    flown : tuple of str
        Ships that are flown past.
    grid, config
        Every value of every axis, and the rest.
    window : ncti.irar.Window
        Pixels of the stored images, whatever the ship.
    """

    flown: tuple[str, ...]
    grid: FlightGrid
    config: FlightConfig
    window: Window

    @classmethod
    def of(cls, config: FlightConfig, grid: Grid, window: Window) -> FlightPlan:
        """The plan of a checked configuration."""
        flown = config.flies(tuple(ship_label(name) for name in grid.ship))
        return cls(flown, config.expand(grid.replicate), config, window)


def check_learning(classifier: ClassifierConfig, floors: tuple[int, ...]) -> None:
    """Refuse what measured profiles cannot be named with, each setting having one value.

    Raises
    ------
    ConfigurationError
        Naming the key.
    """
    axes = classifier.expand()
    if not set(axes.name) & set(OF_MEASURED):
        raise ConfigurationError(
            f"classifier.name is {', '.join(axes.name)}, but must have one of "
            f"{', '.join(OF_MEASURED)} where sensor is irar"
        )
    of_mnn = {"learning_rate": "mnn_learning_rate"}
    for key, values in (
        *((name, getattr(axes, name)) for name in ALONE),
        *((f"mnn.{name}", getattr(axes, of_mnn.get(name, name))) for name in ALONE_OF_MNN),
    ):
        if len(values) > 1:
            raise ConfigurationError(
                f"classifier.{key} has {len(values)} values, but must have one where sensor is irar"
            )
    if axes.training != (EXPECTED,) or any(axes.left_out):
        key, value = ("left_out", "true") if any(axes.left_out) else ("training", axes.training[0])
        raise ConfigurationError(
            f"classifier.{key} is {value}, but must be "
            f"{'false' if any(axes.left_out) else EXPECTED} where sensor is irar"
        )
    if len(floors) > 1:
        raise ConfigurationError(
            f"ladar.target_free_ifovs has {len(floors)} values, but must have one where sensor is "
            "irar"
        )


def _of_key(error: ValueError, slant_range: float) -> str:
    """What the library says of a flight, by the configuration's key and in its unit."""
    said = re.fullmatch(r"slant_range is .*? must be at least ([\d.e+]+), (.*)", str(error))
    if said:
        least = float(said[1]) / 1e3
        return f"irar.range has {slant_range:g}, but must be at least {least:g}, {said[2]}"
    return f"irar.{error}"
