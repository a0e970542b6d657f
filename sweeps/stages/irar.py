"""The infrared airborne radar: settings of its flights, and flights from their values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.irar import Flight, Pass, Scan, fly, reflectivity, ship_heading
from ncti.irar.chain import MIRROR_METHODS, RANGE_FILTERS
from ncti.irar.corrected import EXACT, NO_ERROR, RATES
from ncti.irar.loops import TILTS
from ncti.irar.registration import MOTION_METHODS
from ncti.ladar.budget import power_ratio
from ncti.machine_code import CompiledLoops
from ncti.render.choice import choose_engine
from ncti.render.loops import LINES, engine_loops
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import Kind, Number, Value
from sweeps.engine.declare.settings import (
    AFFECTS_NO_RESULT,
    Choices,
    Setting,
    Settings,
    count,
    number,
    set_of,
    switch,
    word,
)
from sweeps.engine.declare.stage import Group
from sweeps.engine.resolve.streams import cell_rng
from sweeps.stages.ladar import Ladar
from sweeps.stages.ships import ships
from sweeps.stages.views import IRAR, MAX_FRAMES, SI, STATUS, Grid, Render, quantity, uses_sensor

if TYPE_CHECKING:
    import trimesh

Values = Mapping[str, Any]  # by dimension

SENSOR = IRAR

Error = tuple[str, float]
MAX_ERROR = {  # percent, m/s, degrees
    "aircraft_speed": 50.0,
    "ship_speed": 50.0,
    "aircraft_heading": 30.0,
    "ship_heading": 30.0,
    "pointing": 30.0,
}
ERROR_VALUE = "error: aircraft_speed in percent, ship_speed in m/s, others in degrees"

LIBRARY = {"range": "slant_range", "flown_pulse_width": "pulse_width"}  # names of a `Flight`
NON_FLIGHT_SETTINGS = ("transom_gain", "mast_gain", "replicate")  # of the surface and the noise


@dataclass(frozen=True)
class Errors(Kind):
    """Errors of recorded flight parameters, one at a time; no error is always among them."""

    fields: tuple[str, ...] = tuple(MAX_ERROR)  # keys that a configuration may give

    @property
    def allowed(self) -> str:
        """See `sweeps.engine.declare.kinds.Kind.allowed`."""
        return f"a mapping that gives values to some of {', '.join(self.fields)}"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """(parameter, error) pairs, `none` first; see `sweeps.engine.declare.kinds.Kind.values`."""
        if not isinstance(given, Mapping):
            value = "null" if given is None else repr(given)
            raise ConfigurationError(f"{key} is {value}, but must be {self.allowed}")
        pairs: set[Error] = set()
        for parameter, errors in given.items():
            if parameter not in MAX_ERROR:
                raise ConfigurationError(
                    f"{key}.{parameter} is not a key of the configuration; {key} has "
                    f"{', '.join(MAX_ERROR)}"
                )
            if errors is not None:
                limit = MAX_ERROR[parameter]
                listed = Number(-limit, limit).values(f"{key}.{parameter}", errors)
                pairs.update((parameter, error) for error in listed if error)
        return (NO_ERROR, *sorted(pairs))

    def as_input(self, values: tuple[Value, ...]) -> dict[str, list[float]]:
        """Return values as in a configuration: a list of errors for each parameter."""
        return {
            parameter: [error for name, error in values if name == parameter]
            for parameter in sorted({name for name, _ in values} - {NO_ERROR[0]})
        }

    def coordinates(
        self, values: tuple[Value, ...]
    ) -> dict[str, tuple[NDArray[Any], dict[str, str]]]:
        """Return the index of the axis, and parameter and value of each error, with attributes."""
        parameters, errors = zip(*values, strict=True)
        attrs = {"long_name": "recorded flight parameter in error"}
        return {
            "error": (np.arange(len(values)), Irar.errors.attrs),
            "error_parameter": (np.array(parameters), attrs),
            "error_value": (np.array(errors), {"units": "1", "long_name": ERROR_VALUE}),
        }


# Settings of one value are scalar coordinates of results that depend on them.
# Not converted to SI, because their values also key the random streams of the noise.
_axis = partial(quantity, si=False)
_word = partial(word, role="coordinate")


class Course(Settings, key="irar", role="coordinate"):
    """Course and radar of a flight, which determine the pass and the truth.

    The article gives the ranges, the mirror, the detectors and the 1 m of a range; speeds, rates,
    gate, samples and carrier-to-noise ratio are assumptions that lead to its 8 to 12 lines a pixel.
    """

    range = quantity(3.9, 0.1, 1000, "km", "slant range", role="dimension", si=False)
    depression = _axis(6.7, 0.1, 60, "degree", "depression of the line of sight")
    aircraft_speed = _axis(90, 1, 1000, "m s-1", "speed of the aircraft")
    ship_speed = _axis(
        8, 0, 50, "m s-1", "speed of the ship", help="its heading follows from grid.aspect"
    )
    aircraft_heading = _axis(0, -360, 360, "degree", "heading of the aircraft, from north")
    aircraft_track = _axis(
        *(None, -360, 360, "degree"),
        label="direction of the aircraft's motion, from north; null: its heading",
    )
    offset = _axis(5, -360, 360, "degree", "azimuth of the ship from the aircraft's heading")
    pointing = _axis(
        *(None, -360, 360, "degree"),
        label="azimuth of the scan's middle from the aircraft's heading; null: at the ship",
    )
    mirror_angle = _axis(45, 1, 80, "degree", "mirror pointing angle")
    ifov = _axis(205, 1, 10_000, "urad", "instantaneous field of view, and spacing of samples")
    line_rate = _axis(119, 1, 100_000, "Hz", "lines a second")
    samples = count(160, 2, 10_000, label="samples of a line")
    pulse_rate = _axis(
        20_000, 1, 1e9, "Hz", "pulse-repetition frequency", help="at least line_rate times samples"
    )
    range_gate = _axis(300, 10, 1e5, "m", "depth in which the receiver looks for its peak")
    detectors = count(12, 1, 1000, label="passive detectors along the scan")
    jitter = _axis(0, 0, 10_000, "urad", "standard deviation of the line of sight")
    jitter_time = _axis(0.1, 1e-6, 1000, "s", "correlation time of the line of sight")
    transom_gain = _axis(
        1, 0, 1000, "1", "assumed reflectivity of the transom relative to the ship", help="0: dark"
    )
    mast_gain = _axis(
        1,
        0,
        1000,
        "1",
        "assumed reflectivity of masts relative to the ship",
        help="above 1 they glint",
    )
    pulse_width = _axis(
        30,
        2,
        1000,
        "ns",
        "pulse width of the flight's radar, full width at 1/e^2",
        dimension="flown_pulse_width",
    )


class Receivers(Settings, key="irar", role="coordinate"):
    """Receivers of a flight, which affect its raw images but neither the pass nor the truth."""

    cnr = _axis(20, -100, 90, "dB", "carrier-to-noise ratio of an IFOV that the ship fills")
    range_sigma = _axis(1, 0, 100, "m", "standard deviation of a measured range")
    threshold = _axis(4, 0, 1e9, "1", "noise powers that a peak must reach to be reported")
    nedt = _axis(0.4, 0, 1000, "K", "noise-equivalent temperature difference of one sample")


class Passive(Settings, key="irar", role="coordinate"):
    """The passive image of a flight; its settings do not key the noise."""

    band_start = _axis(8, 0.1, 1000, "um", "shortest wavelength of the passive detectors")
    band_stop = _axis(12, 0.1, 1000, "um", "longest wavelength of the passive detectors")
    contrast_at_zero = _axis(2.1585, 0, 1000, "K", "contrast of ship to sea at zero range")
    sea_temperature = _axis(288.15, 100, 1000, "K", "temperature of the sea")
    band_extinction = _axis(
        0.5,
        0,
        10,
        "dB km-1",
        "extinction of radiance in the passive band, one way",
        help="an assumption",
    )
    clutter = _axis(
        *(0, 0, 1000, "K", "standard deviation of the sea's own temperature, of a passive sample"),
        help="infrared.sea_spread is that of the imager",
    )
    clutter_length = _axis(
        10, 0.01, 1e5, "m", "distance on the water at which clutter is correlated by 1/e"
    )


class Irar(Course, Receivers, Passive, key="irar"):
    """Flights past the ships, and the corrections of their images."""

    errors = Setting(
        Errors(),
        {},
        label="error of a recorded flight parameter, by number; 0 is none",
        help="one at a time; each a value, a list, or start, stop and step",
        dimension="error",
        role="coordinate",
    )
    autofocus = switch(
        False,
        label="estimation of the closing speed from the image",
        help="of the exact chain",
        role="coordinate",
    )
    chain = _word(
        EXACT,
        (EXACT, *RATES),
        label="chain of corrections: exact, or as printed by the article",
        help="in the printed chains f is the line rate, or the pulse rate as the article states",
    )
    azimuth = _word(
        "pixel",
        (*MOTION_METHODS, "none"),
        label="correction of the motion in azimuth",
        help="by each sample's own range and time, by line, by one constant, or not at all",
    )
    mirror = _word(EXACT, MIRROR_METHODS, label="correction of the mirror's rotation")
    range_filter = _word(
        "cluster", RANGE_FILTERS, label="filter that combines the ranges of a pixel's looks"
    )
    segmentation_threshold = number(
        None,
        0,
        1e9,
        label="segmentation threshold, in noise powers",
        help="null: exceeded by one sea pixel in 1,000",
    )
    profile_range = quantity(
        *(100, 1, 1000, "km"),
        label="slant range of the proposed sensor that images of flights are converted to",
        help="its other settings are those of ladar",
    )
    profile_frames = count(16, 1, MAX_FRAMES, label="frames averaged in a synthetic test profile")
    flown = set_of(
        ships(None, label="ships flown past; the others are only in training; null: all")
    )
    pictures = switch(
        False,
        label="pictures of every stage of the corrections, written beside the tables",
        not_swept=AFFECTS_NO_RESULT,
    )


FLOWN = Course.declared
"""Settings on which the pass and the truth depend."""

RECORDED = (Grid.replicate, *Receivers.declared, *Passive.declared)
"""Settings on which the raw images depend as well."""

FLIGHT: tuple[str, ...] = tuple(  # dimensions of a flight in the store, in their order
    setting.name
    for setting in (
        *FLOWN[:-1],
        *(Irar.cnr, Irar.pulse_width, *Receivers.declared[1:], *Passive.declared),
        # Settings of corrected images, and the draw.
        *(Irar.errors, Irar.autofocus, Irar.chain, Irar.azimuth, Irar.mirror, Irar.range_filter),
        Grid.replicate,
    )
)
FLIGHTS = Group(
    "validation",
    uses_sensor(IRAR),
    dims=("ship", "aspect", *FLIGHT, "pulse_width"),
    status=STATUS,
    names={  # a flight has settings of the same words
        Ladar.ifov: "ladar_ifov",
        Ladar.cnr: "ladar_cnr",
        Render.samples: "render_samples",
    },
)


def parameters(values: Values) -> dict[str, Any]:
    """Return parameters of a `Flight`, in SI, from values of `FLOWN` and `RECORDED`."""
    units = {setting.name: SI.get(setting.unit) for setting in (*FLOWN, *RECORDED)}
    converted = {
        LIBRARY.get(name, name): value if units[name] is None else value * units[name]
        for name, value in values.items()
        if name not in NON_FLIGHT_SETTINGS
    }
    return converted | ({"cnr": power_ratio(converted["cnr"])} if "cnr" in converted else {})


def flight_of(aspect: float, values: Values) -> Flight:
    """Return the pass by a ship at an aspect [deg], from values of `FLOWN` or also `RECORDED`.

    Its carrier-to-noise ratio is 1 unless `values` have one.
    Raise ValueError for an impossible flight.
    """
    sight = values["aircraft_heading"] + values["offset"]
    heading = ship_heading(aspect=aspect, sight=sight)
    return Flight(ship_heading=heading, **parameters({"cnr": 0.0, **values}))


def surface(mesh: trimesh.Trimesh, values: Values, reflectance: str) -> dict[str, Any]:
    """Return the reflectance of a ship, gains included: keywords of `fly` and `true_snapshot`."""
    gains = {name: values[name] for name in ("transom_gain", "mast_gain")}
    return {"reflectivity": reflectivity(mesh, **gains), "lambertian": reflectance == "lambertian"}


def fly_past(
    mesh: trimesh.Trimesh,
    course: Values,
    *,
    replicate: int,
    reflectance: str,
    seed: int,
    **view: Any,
) -> Pass:
    """Return a pass by a ship on a course, at a carrier-to-noise ratio of 1.

    `course` has the values of `FLOWN`; `view` has the name of the ship and its aspect [deg].
    Without jitter all replicates share one draw.
    """
    draw = {"stage": "flight_attitude", "replicate": draw_number(replicate, course["jitter"])}
    flight, rng = flight_of(view["aspect"], course), cell_rng(seed, **draw, **view, **course)
    return fly(mesh, flight, rng=rng, **surface(mesh, course, reflectance))


def draw_number(replicate: int, jitter: float) -> int:
    """Return the number of the attitude draw of a replicate: the same for all without jitter."""
    return replicate if jitter else 0


def apply_receivers(flown: Pass, receivers: Values) -> Pass:
    """Return the same pass with receivers of values of `RECORDED`."""
    flight = replace(flown.plan.flight, **parameters(receivers))
    return replace(flown, plan=replace(flown.plan, flight=flight))


def record_scan(flown: Pass, course: Values, receivers: Values, *, seed: int, **view: Any) -> Scan:
    """Return the raw images of a pass, by receivers of values of `RECORDED`.

    The draw of the noise does not depend on the passive band.
    """
    passive = {setting.name for setting in Passive.declared}
    noise_key = {name: value for name, value in receivers.items() if name not in passive}
    rng = cell_rng(seed, stage="flight", **view, **course, **noise_key)
    return apply_receivers(flown, receivers).record(rng)


def scan_again(values: Values, mesh: trimesh.Trimesh, *, reflectance: str, **place: Any) -> Scan:
    """Return the raw images that a sweep made of a flight past a ship.

    `values` must have all of `FLOWN` and `RECORDED`, with None for null; others are ignored.
    `place` has the sweep's seed, the name of the ship, and its aspect [deg].
    """
    names = ([setting.name for setting in settings] for settings in (FLOWN, RECORDED))
    course, receivers = ({name: values[name] for name in group} for group in names)
    draw = {"replicate": receivers["replicate"], "reflectance": reflectance}
    return record_scan(fly_past(mesh, course, **draw, **place), course, receivers, **place)


def loops(choices: Choices) -> list[CompiledLoops]:
    """Return the compiled loops of flights, and of a pixel engine if the sweep draws lines."""
    if not uses_sensor(IRAR)(choices):
        return []
    return [TILTS] + [engine_loops(choose_engine("auto"))] * (LINES in choices[Render.engine])
