"""The infrared airborne radar: settings of its flights, its receivers and its corrections."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.irar.chain import MIRROR_METHODS, RANGE_FILTERS
from ncti.irar.registration import MOTION_METHODS
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import Kind, Number, Value
from sweeps.engine.settings import Setting, Settings, count, number, set_of, switch, word
from sweeps.stages.views import IRAR, MOST_FRAMES, Grid, ships

EXACT = "exact"
RATES = {"printed": "line", "printed_pulse_rate": "pulse"}
"""Of the source's corrections, as printed: what f is, the line rate, or the pulse-repetition
frequency that it says f is."""

Error = tuple[str, float]
NO_ERROR: Error = ("none", 0.0)
MOST_WRONG = {  # percent, m/s, degrees
    "aircraft_speed": 50.0,
    "ship_speed": 50.0,
    "aircraft_heading": 30.0,
    "ship_heading": 30.0,
    "pointing": 30.0,
}


@dataclass(frozen=True)
class Errors(Kind):
    """Errors of what navigation believes, one at a time; no error is always among them.

    Attributes
    ----------
    fields : tuple of str
        Parameters that may be wrong.
    """

    fields: tuple[str, ...] = tuple(MOST_WRONG)

    @property
    def allowed(self) -> str:
        """See `sweeps.engine.kinds.Kind.allowed`."""
        return f"a mapping that gives values to some of {', '.join(self.fields)}"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """(parameter, error) pairs, `none` first; see `sweeps.engine.kinds.Kind.values`."""
        if not isinstance(given, Mapping | None):
            raise ConfigurationError(f"{key} is {given!r}, but must be {self.allowed}")
        found: set[Error] = set()
        for parameter, errors in (given or {}).items():
            if parameter not in MOST_WRONG:
                raise ConfigurationError(
                    f"{key}.{parameter} is no key of the configuration; {key} has "
                    f"{', '.join(self.fields)}"
                )
            if errors is not None:
                most = MOST_WRONG[parameter]
                listed = Number(-most, most).values(f"{key}.{parameter}", errors)
                found.update((parameter, error) for error in listed if error)
        return (NO_ERROR, *sorted(found))

    def written(self, values: tuple[Value, ...]) -> dict[str, list[float]]:
        """Return what a user writes to get some values."""
        return {
            parameter: [error for name, error in values if name == parameter]
            for parameter in sorted({name for name, _ in values} - {NO_ERROR[0]})
        }

    def coordinates(
        self, values: tuple[Value, ...]
    ) -> dict[str, tuple[NDArray[Any], dict[str, str]]]:
        """Return coordinates of an axis of some values, its own first, with their attributes."""
        parameters, errors = zip(*values, strict=True)
        return {
            "error": (np.arange(len(values)), Irar.errors.attrs),
            "error_parameter": (
                np.array(parameters, dtype=object),
                {"long_name": "what is believed wrong of the flight"},
            ),
            "error_value": (
                np.array(errors),
                {
                    "units": "1",
                    "long_name": "how wrong: aircraft_speed in percent, ship_speed in m/s, others "
                    "in degrees",
                },
            ),
        }


def axis(
    default: float | None, low: float, high: float, unit: str, label: str, **about: Any
) -> Setting:
    """Return the setting of a number that with one value is a scalar coordinate."""
    return number(default, low, high, unit=unit, label=label, noted=True, **about)


class Irar(Settings, key="irar"):
    """Flights past the ships.

    The source gives the ranges, the mirror, the detectors and the 1 m of a range; speeds, rates,
    gate, samples and carrier-to-noise ratio are assumptions that lead to its 8 to 12 lines a pixel.
    """

    range = number(3.9, 0.1, 1000, unit="km", label="slant range", shown=True)
    depression = axis(6.7, 0.1, 60, "degree", "depression of the line of sight")
    aircraft_speed = axis(90, 1, 1000, "m s-1", "speed of the aircraft")
    ship_speed = axis(
        8, 0, 50, "m s-1", "speed of the ship", help="its heading is what grid.aspect asks for"
    )
    aircraft_heading = axis(0, -360, 360, "degree", "heading of the aircraft, from north")
    aircraft_track = axis(
        None,
        -360,
        360,
        "degree",
        "direction of the aircraft's motion, from north; NaN: its heading",
    )
    offset = axis(5, -360, 360, "degree", "azimuth of the ship from the aircraft's heading")
    pointing = axis(
        None,
        -360,
        360,
        "degree",
        "azimuth of the scan's middle from the aircraft's heading; NaN: at the ship",
    )
    mirror_angle = axis(45, 1, 80, "degree", "mirror pointing angle")
    ifov = axis(205, 1, 10_000, "urad", "instantaneous field of view, and spacing of samples")
    line_rate = axis(119, 1, 100_000, "Hz", "lines a second")
    samples = count(160, 2, 10_000, label="samples of a line", noted=True)
    pulse_rate = axis(
        20_000, 1, 1e9, "Hz", "pulse-repetition frequency", help="at least line_rate times samples"
    )
    range_gate = axis(300, 10, 1e5, "m", "depth in which the receiver looks for its peak")
    detectors = count(12, 1, 1000, label="passive detectors along the scan", noted=True)
    jitter = axis(0, 0, 10_000, "urad", "standard deviation of the line of sight")
    jitter_time = axis(0.1, 1e-6, 1000, "s", "correlation time of the line of sight")
    transom_gain = axis(
        1,
        0,
        1000,
        "1",
        "input on the source's word: reflectivity of the transom over the ship's",
        help="0: dark",
    )
    mast_gain = axis(
        1,
        0,
        1000,
        "1",
        "input on the source's word: reflectivity of masts over the ship's",
        help="above 1 they glint",
    )
    cnr = axis(20, -100, 90, "dB", "carrier-to-noise ratio of an IFOV that the ship fills")
    pulse_width = axis(
        30,
        2,
        1000,
        "ns",
        "pulse width of the flight's radar, full width at 1/e^2",
        dimension="flown_pulse_width",
    )
    range_sigma = axis(1, 0, 100, "m", "standard deviation of a measured range")
    threshold = axis(4, 0, 1e9, "1", "noise powers that a peak must reach to be reported")
    nedt = axis(0.4, 0, 1000, "K", "noise-equivalent temperature difference of one sample")
    errors = Setting(
        Errors(),
        {},
        label="number of what is believed wrong of the flight, 0 none",
        help="one at a time; each a value, a list, or start, stop and step",
        dimension="error",
        noted=True,
    )
    autofocus = switch(
        False,
        label="1 where the closing speed is found in the image",
        help="the exactly corrected one",
        noted=True,
    )
    chain = word(
        EXACT,
        (EXACT, *RATES),
        label="whose corrections: exact, or as the source prints them",
        help="f of the printed ones is the line rate, or the pulse rate that the source says it is",
        noted=True,
    )
    azimuth = word(
        "pixel",
        (*MOTION_METHODS, "none"),
        label="how columns follow the motion",
        help="by each sample's own range and time, by line, by one constant, or not at all",
        noted=True,
    )
    mirror = word(EXACT, MIRROR_METHODS, label="how the mirror's turn is taken out", noted=True)
    range_filter = word(
        "cluster", RANGE_FILTERS, label="what makes one range of a pixel's looks", noted=True
    )
    segmentation_threshold = number(
        None,
        0,
        1e9,
        label="noise powers that a pixel of the ship must reach",
        help="null: what one pixel of the sea in 1,000 exceeds",
    )
    profile_range = number(
        100,
        1,
        1000,
        unit="km",
        label="slant range of the proposed sensor that measured images stand in for",
        help="its other settings are those of ladar",
    )
    profile_frames = count(16, 1, MOST_FRAMES, label="frames averaged of a synthetic test profile")
    flown = set_of(
        ships(None, label="ships that are flown past; the others are learned only; null: all")
    )
    pictures = switch(
        False,
        label="whether every stage of the corrections is drawn, too, beside the tables",
        fixed="pictures are drawn of the numbers",
        identity=False,
    )


FLOWN: tuple[Setting, ...] = (
    *(Irar.range, Irar.depression, Irar.aircraft_speed, Irar.ship_speed, Irar.aircraft_heading),
    *(Irar.aircraft_track, Irar.offset, Irar.pointing, Irar.mirror_angle, Irar.ifov),
    *(Irar.line_rate, Irar.samples, Irar.pulse_rate, Irar.range_gate, Irar.detectors),
    *(Irar.jitter, Irar.jitter_time, Irar.transom_gain, Irar.mast_gain),
    Irar.pulse_width,  # the truth's peaks, too, are as wide as the pulse
)
"""What the beam meets, and the truth, depend on."""

RECORDED: tuple[Setting, ...] = (
    *(Grid.replicate, Irar.cnr, Irar.range_sigma, Irar.threshold, Irar.nedt),
)
"""What the raw images depend on, too."""

CORRECTED: tuple[Setting, ...] = (
    *(Irar.errors, Irar.autofocus, Irar.chain, Irar.azimuth, Irar.mirror, Irar.range_filter),
)
"""What corrected images depend on, too."""

FLIGHT: tuple[str, ...] = (  # dimensions of a flight in the store, in their order
    *(one.name for one in FLOWN if one is not Irar.pulse_width),
    *(one.name for one in (Irar.cnr, Irar.pulse_width, Irar.range_sigma, Irar.threshold)),
    *(one.name for one in (Irar.nedt, *CORRECTED, Grid.replicate)),
)

SENSOR = IRAR
SETTINGS: tuple[type[Settings], ...] = (Irar,)
