"""What a configuration may say of the infrared airborne radar's flights."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from itertools import product
from typing import Any

import trimesh

from ncti.irar import Flight, Window, plan_scan, ship_heading
from ncti.irar.chain import MIRROR_METHODS, RANGE_FILTERS
from ncti.irar.registration import MOTION_METHODS
from sweeps.classifier_schema import ACN, CORRELATION, EXPECTED, MNN, ClassifierConfig
from sweeps.errors import ConfigurationError
from sweeps.grid import (
    Grid,
    between,
    number_axis,
    ship_axis,
    ship_label,
    switch_axis,
    word_axis,
)
from sweeps.sensor_schema import MOST_FRAMES

OF_MEASURED = (ACN, MNN, CORRELATION)  # classifiers that can name a measured profile
ALONE = ("learning_rate", "label_rule", "score_rule", "training", "left_out")
ALONE_OF_MNN = ("epochs", "grow_every", "learning_rate", "tolerance", "inputs", "annealing")

NO_ERROR = ("none", 0.0)

Error = tuple[str, float]


@dataclass(frozen=True)
class FlightGrid:
    """Every value of every axis of the flights, in the units of the configuration.

    Attributes
    ----------
    range, depression, aircraft_speed, ship_speed, aircraft_heading, offset, line_rate, jitter
        tuple of float: of the flight [km, deg, m/s, m/s, deg, deg, Hz, urad].
    transom_gain, mast_gain : tuple of float
        Reflectivities put in, relative to the ship's.
    cnr : tuple of float
        Carrier-to-noise ratios [dB].
    replicate : tuple of int
        Numbers of independent draws of all noise.
    error : tuple of (str, float)
        What is believed wrong of the flight, and by how much; `none` first.
    autofocus : tuple of bool
        Whether the closing speed is then looked for in the image.
    azimuth, mirror, range_filter : tuple of str
        Of `ncti.irar.Correction`.
    """

    range: tuple[float, ...]
    depression: tuple[float, ...]
    aircraft_speed: tuple[float, ...]
    ship_speed: tuple[float, ...]
    aircraft_heading: tuple[float, ...]
    offset: tuple[float, ...]
    line_rate: tuple[float, ...]
    jitter: tuple[float, ...]
    transom_gain: tuple[float, ...]
    mast_gain: tuple[float, ...]
    cnr: tuple[float, ...]
    replicate: tuple[int, ...]
    error: tuple[Error, ...]
    autofocus: tuple[bool, ...]
    azimuth: tuple[str, ...]
    mirror: tuple[str, ...]
    range_filter: tuple[str, ...]


# What the beam meets depends on these axes, the raw images on these, too, and the rest corrects.
FLOWN = (
    *("range", "depression", "aircraft_speed", "ship_speed", "aircraft_heading", "offset"),
    *("line_rate", "jitter", "transom_gain", "mast_gain"),
)
RECORDED = ("replicate", "cnr")
CORRECTED = ("error", "autofocus", "azimuth", "mirror", "range_filter")

# Parameters of a flight that are in its own units here.
AS_FLOWN = (
    *("depression", "aircraft_speed", "ship_speed", "aircraft_heading", "offset", "line_rate"),
)
AS_GIVEN = (
    *("aircraft_track", "pointing", "mirror_angle", "samples", "pulse_rate", "range_sigma"),
    *("range_gate", "threshold", "detectors", "nedt", "jitter_time"),
)


@dataclass
class FlightErrors:
    """Errors of what navigation believes, one at a time; 0, no error, is always there."""

    aircraft_speed: Any = None
    ship_speed: Any = None
    aircraft_heading: Any = None
    ship_heading: Any = None
    pointing: Any = None

    def expand(self) -> tuple[Error, ...]:
        """Every error, checked."""
        bounds = {"aircraft_speed": 50.0, "ship_speed": 50.0}  # %, m/s; else deg
        found = [NO_ERROR]
        for parameter in (one.name for one in fields(self)):
            given, most = getattr(self, parameter), bounds.get(parameter, 30.0)
            if given is not None:
                key = f"irar.errors.{parameter}"
                values = number_axis(key, given, minimum=-most, maximum=most)
                found += [(parameter, value) for value in values if value]
        return tuple(found)


@dataclass
class FlightConfig:
    """The infrared airborne radar: its flight, its sensor, and how its images are corrected."""

    range: Any = 3.9
    depression: Any = 6.7
    aircraft_speed: Any = 90.0
    ship_speed: Any = 8.0
    aircraft_heading: Any = 0.0
    offset: Any = 5.0
    line_rate: Any = 119.0
    cnr: Any = 20.0
    jitter: Any = 0.0
    transom_gain: Any = 1.0
    mast_gain: Any = 1.0
    azimuth: Any = "pixel"
    mirror: Any = "exact"
    range_filter: Any = "cluster"
    autofocus: Any = False
    errors: FlightErrors = field(default_factory=FlightErrors)
    aircraft_track: float | None = None
    pointing: float | None = None
    mirror_angle: float = 45.0
    ifov: float = 205.0
    samples: int = 160
    pulse_rate: float = 20_000.0
    pulse_width: float = 30.0
    range_sigma: float = 1.0
    range_gate: float = 300.0
    threshold: float = 4.0
    detectors: int = 12
    nedt: float = 0.4
    jitter_time: float = 0.1
    segmentation_threshold: float | None = None
    profile_range: float = 100.0
    profile_frames: int = 16
    flown: Any = None

    def __post_init__(self) -> None:
        """Check the ranges of what is no axis."""
        for key, low, high in (
            ("mirror_angle", 1, 80),
            ("ifov", 1, 10_000),
            ("samples", 2, 10_000),
            ("pulse_rate", 1, 1e9),
            ("pulse_width", 2, 1000),
            ("range_sigma", 0, 100),
            ("range_gate", 10, 1e5),
            ("threshold", 0, 1e9),
            ("detectors", 1, 1000),
            ("nedt", 0, 1000),
            ("jitter_time", 1e-6, 1000),
            ("profile_range", 1, 1000),
            ("profile_frames", 1, MOST_FRAMES),
        ):
            between(f"irar.{key}", getattr(self, key), low, high)
        for key, low, high in (
            ("aircraft_track", -360, 360),
            ("pointing", -360, 360),
            ("segmentation_threshold", 0, 1e9),
        ):
            if getattr(self, key) is not None:
                between(f"irar.{key}", getattr(self, key), low, high)

    def expand(self, replicate: tuple[int, ...] = (0,)) -> FlightGrid:
        """Every value of every axis, checked; draws are numbered by the grid."""
        bounds = {
            "range": (0.1, 1000),
            "depression": (0.1, 60),
            "aircraft_speed": (1, 1000),
            "ship_speed": (0, 50),
            "aircraft_heading": (-360, 360),
            "offset": (-360, 360),
            "line_rate": (1, 100_000),
            "jitter": (0, 10_000),
            "transom_gain": (0, 1000),
            "mast_gain": (0, 1000),
            "cnr": (-100, 90),
        }
        words = {
            "azimuth": (*MOTION_METHODS, "none"),
            "mirror": MIRROR_METHODS,
            "range_filter": RANGE_FILTERS,
        }
        values: dict[str, Any] = {
            name: number_axis(f"irar.{name}", getattr(self, name), minimum=low, maximum=high)
            for name, (low, high) in bounds.items()
        } | {
            name: word_axis(f"irar.{name}", getattr(self, name), allowed)
            for name, allowed in words.items()
        }
        return FlightGrid(
            **values,
            autofocus=switch_axis("irar.autofocus", self.autofocus),
            error=self.errors.expand(),
            replicate=replicate,
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

    def flight(self, aspect: float, **values: float) -> Flight:
        """A pass by a ship at an aspect [deg], of values on the axes of `FLOWN` and `cnr`."""
        sight = values["aircraft_heading"] + values["offset"]
        own: dict[str, Any] = {name: values[name] for name in AS_FLOWN}
        own |= {name: getattr(self, name) for name in AS_GIVEN}
        return Flight(
            slant_range=values["range"] * 1e3,
            ship_heading=ship_heading(aspect=aspect, sight=sight),
            ifov=self.ifov * 1e-6,
            pulse_width=self.pulse_width * 1e-9,
            jitter=values["jitter"] * 1e-6,
            cnr=10 ** (values.get("cnr", 0.0) / 10),
            **own,
        )

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
                    believed(flight, (parameter, value))
                except ValueError as error:
                    raise ConfigurationError(
                        f"irar.errors.{parameter} has {value:g}, with which {error}"
                    ) from error

    def check_ship(self, label: str, hull: trimesh.Trimesh, aspects: tuple[float, ...]) -> None:
        """Refuse flights that do not see a whole ship, as `check` does."""
        for aspect, values in product(aspects, passes(self.expand())):
            try:
                plan_scan(hull, self.flight(aspect, **values))
            except ValueError as error:
                raise ConfigurationError(
                    f"{_of_key(error, values['range'])} ({label} at {aspect:g} deg)"
                ) from error


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


def passes(grid: FlightGrid) -> Iterator[dict[str, float]]:
    """Values on the axes of `FLOWN` of every pass."""
    for values in product(*(getattr(grid, name) for name in FLOWN)):
        yield dict(zip(FLOWN, values, strict=True))


def believed(flight: Flight, error: Error) -> Flight:
    """A flight as navigation has it, with one error.

    Parameters
    ----------
    flight : Flight
        As it was, with its pointing settled where that is wrong.
    error : (str, float)
        The parameter, and by how much it is wrong: of the aircraft's speed in percent.

    Raises
    ------
    ValueError
        If no such flight can be.
    """
    parameter, value = error
    if parameter == NO_ERROR[0]:
        return flight
    if parameter == "aircraft_speed":
        return replace(flight, aircraft_speed=flight.aircraft_speed * (1 + value / 100))
    if parameter == "pointing" and flight.pointing is None:
        return replace(flight, pointing=flight.offset + value)
    return replace(flight, **{parameter: getattr(flight, parameter) + value})


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
