"""The axes of flights: expanded from what the user wrote, and checked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any

from ncti.irar import Flight
from sweeps.grid import number_axis

NO_ERROR = ("none", 0.0)

Error = tuple[str, float]


@dataclass(frozen=True)
class FlightGrid:
    """Every value of every axis of the flights, in the units of the configuration.

    Attributes
    ----------
    range, depression, aircraft_speed, ship_speed, aircraft_heading, offset, mirror_angle, ifov, \
line_rate, pulse_rate, range_gate, jitter, jitter_time
        tuple of float: of the flight [km, deg, m/s, m/s, deg, deg, deg, urad, Hz, Hz, m, urad, s].
    aircraft_track, pointing : tuple of float or None
        The same [deg]; None: the heading's, and at the ship.
    samples, detectors : tuple of int
        The same.
    transom_gain, mast_gain : tuple of float
        Reflectivities put in, relative to the ship's.
    cnr, flown_pulse_width, range_sigma, threshold, nedt : tuple of float
        Of the flight's receivers [dB, ns, m, noise powers, K].
    replicate : tuple of int
        Numbers of independent draws of all noise.
    error : tuple of (str, float)
        What is believed wrong of the flight, and by how much; `none` first.
    autofocus : tuple of bool
        Whether the closing speed is then looked for in the image.
    chain : tuple of str
        Whose corrections: `exact`, ours, or the source's, as printed.
    azimuth, mirror, range_filter : tuple of str
        Of `ncti.irar.Correction`.
    """

    range: tuple[float, ...]
    depression: tuple[float, ...]
    aircraft_speed: tuple[float, ...]
    ship_speed: tuple[float, ...]
    aircraft_heading: tuple[float, ...]
    aircraft_track: tuple[float | None, ...]
    offset: tuple[float, ...]
    pointing: tuple[float | None, ...]
    mirror_angle: tuple[float, ...]
    ifov: tuple[float, ...]
    line_rate: tuple[float, ...]
    samples: tuple[int, ...]
    pulse_rate: tuple[float, ...]
    range_gate: tuple[float, ...]
    detectors: tuple[int, ...]
    jitter: tuple[float, ...]
    jitter_time: tuple[float, ...]
    transom_gain: tuple[float, ...]
    mast_gain: tuple[float, ...]
    cnr: tuple[float, ...]
    flown_pulse_width: tuple[float, ...]
    range_sigma: tuple[float, ...]
    threshold: tuple[float, ...]
    nedt: tuple[float, ...]
    replicate: tuple[int, ...]
    error: tuple[Error, ...]
    autofocus: tuple[bool, ...]
    chain: tuple[str, ...]
    azimuth: tuple[str, ...]
    mirror: tuple[str, ...]
    range_filter: tuple[str, ...]


# What the beam meets, and the truth, depend on these axes, the raw images on the next, too, and
# the rest corrects.
FLOWN = (
    *("range", "depression", "aircraft_speed", "ship_speed", "aircraft_heading", "aircraft_track"),
    *("offset", "pointing", "mirror_angle", "ifov", "line_rate", "samples", "pulse_rate"),
    *("range_gate", "detectors", "jitter", "jitter_time", "transom_gain", "mast_gain"),
    "flown_pulse_width",  # the truth's peaks, too, are as wide as the pulse
)
RECORDED = ("replicate", "cnr", "range_sigma", "threshold", "nedt")
CORRECTED = ("error", "autofocus", "chain", "azimuth", "mirror", "range_filter")

IN_SI = {  # axes of a flight that the library has by another name or in another unit
    "range": ("slant_range", 1e3),
    "ifov": ("ifov", 1e-6),
    "jitter": ("jitter", 1e-6),
    "flown_pulse_width": ("pulse_width", 1e-9),
}
OF_NO_FLIGHT = ("transom_gain", "mast_gain", "replicate")  # of the ship, and of the noise


def parameters(values: dict[str, Any]) -> dict[str, Any]:
    """Parameters of a `Flight` from values on the axes of `FLOWN` and `RECORDED`."""
    found = {}
    for name, value in values.items():
        if name == "cnr":
            found[name] = 10 ** (value / 10)
        elif name in IN_SI:
            own, unit = IN_SI[name]
            found[own] = value * unit
        elif name not in OF_NO_FLIGHT:
            found[name] = value
    return found


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
