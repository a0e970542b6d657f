"""Parameters of a flight past a ship and the geometry that follows from them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.infrared.bands import (
    LONG_WAVE,
    LONG_WAVE_EXTINCTION,
    SEA_TEMPERATURE,
    band_contrast,
)
from ncti.infrared.radiometry import CONTRAST_AT_ZERO
from ncti.irar.mirror import compass_directions, mirror_axes
from ncti.ladar.pulse import SPEED_OF_LIGHT

Floats = NDArray[np.float64]

WAVELENGTH = 10.6e-6
"""Wavelength of the CO2 laser [m]."""


TURN = ("degree", {"minimum": -360, "maximum": 360})
KELVIN = ("K", {"minimum": 0, "maximum": 1000})  # of a difference of temperatures
WAVE = ("m", {"minimum": 1e-7, "maximum": 1e-3})  # of a wavelength
PARAMETERS: dict[str, tuple[str, dict[str, Any]]] = {
    "slant_range": ("m", {"minimum": 100, "maximum": 1e6}),
    "depression": ("degree", {"positive": True, "maximum": 60}),
    "aircraft_speed": ("m s-1", {"positive": True, "maximum": 1000}),
    "ship_speed": ("m s-1", {"minimum": 0, "maximum": 50}),
    **dict.fromkeys(("aircraft_heading", "ship_heading", "offset", "aircraft_track"), TURN),
    "pointing": TURN,
    "mirror_angle": ("degree", {"minimum": 1, "maximum": 80}),
    "ifov": ("rad", {"minimum": 1e-6, "maximum": 0.01}),
    "line_rate": ("Hz", {"minimum": 1, "maximum": 100_000}),
    "samples": ("1", {"whole": True, "minimum": 2, "maximum": 10_000}),
    "detectors": ("1", {"whole": True, "minimum": 1, "maximum": 1000}),
    "pulse_rate": ("Hz", {"positive": True, "maximum": 1e9}),
    "cnr": ("1", {"positive": True, "maximum": 1e9}),
    "pulse_width": ("s", {"minimum": 2e-9, "maximum": 1e-6}),
    "range_sigma": ("m", {"minimum": 0, "maximum": 100}),
    "range_gate": ("m", {"minimum": 10, "maximum": 1e5}),
    "threshold": ("1", {"minimum": 0, "maximum": 1e9}),
    **dict.fromkeys(("nedt", "contrast_at_zero", "clutter"), KELVIN),
    **dict.fromkeys(("band_start", "band_stop"), WAVE),
    "sea_temperature": ("K", {"minimum": 100, "maximum": 1000}),
    "band_extinction": ("dB m-1", {"minimum": 0, "maximum": 0.01}),
    "clutter_length": ("m", {"minimum": 0.01, "maximum": 1e5}),
    "jitter": ("rad", {"minimum": 0, "maximum": 0.01}),
    "jitter_time": ("s", {"positive": True, "maximum": 1000}),
}
"""Unit and bounds of each parameter of a flight."""

OPTIONAL_PARAMETERS = ("aircraft_track", "pointing")
"""Parameters that may be None."""


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Parameters of one pass of the aircraft by a ship.

    Time is 0 when the depression of the ship's origin equals that of the mirror's line of sight.
    Slant range, offset and aspect refer to this moment, the *snapshot*, whose view the corrections
    recover.

    Attributes
    ----------
    slant_range : float
        Aircraft to ship's origin [m].
    depression : float
        Depression of the mirror's line of sight, and of the ship's origin in the snapshot, gamma
        [deg].
    aircraft_speed, ship_speed : float
        Speeds over the sea, V_a and V_s [m/s].
    aircraft_heading, ship_heading : float
        Headings clockwise from north, beta_a and beta_s [deg].
    aircraft_track : float or None
        Direction of the aircraft's motion, clockwise from north [deg]; None: its heading.
    offset : float
        Azimuth of the ship from the aircraft's heading, theta, clockwise [deg].
    pointing : float or None
        Azimuth of the middle of the scan from the aircraft's heading [deg]; None: chosen so that
        the ship passes through the middle.
    mirror_angle : float
        Mirror pointing angle, psi [deg].
    ifov : float
        Side of the detector's instantaneous field of view, phi, and spacing of samples [rad].
    line_rate : float
        Lines per second [Hz].
    samples : int
        Samples of a line.
    pulse_rate : float
        Pulse-repetition frequency [Hz].
    cnr : float
        Carrier-to-noise ratio of an IFOV filled by a flat target, as a power ratio.
    pulse_width : float
        Full width of pulse and filter at 1/e^2 of the intensity [s].
    range_sigma : float
        Standard deviation of a measured range [m].
    range_gate : float
        Depth of the gate in which the receiver detects its peak, about the ship's origin [m].
    threshold : float
        Least reported peak, in noise powers; samples below it are dropouts.
    detectors : int
        Passive detectors along the scan.
    nedt : float
        Noise-equivalent temperature difference of one passive sample [K].
    band_start, band_stop : float
        Shortest and longest wavelength of the passive detectors [m].
    contrast_at_zero : float
        Temperature of the ship above the sea [K].
    sea_temperature : float
        Temperature of the sea [K].
    band_extinction : float
        One-way extinction of radiance in that band [dB/m].
    clutter : float
        Standard deviation of the sea's temperature in a passive sample [K].
    clutter_length : float
        Distance on the water at which the clutter's correlation has fallen to 1/e [m].
    jitter : float
        Standard deviation of the line of sight's attitude error, in azimuth and in elevation
        [rad].
    jitter_time : float
        Correlation time of the attitude error [s].

    Raises
    ------
    ValueError
        If a parameter is out of range, the pulse rate is too low for the scan, or the aircraft does
        not close on the ship.

    See Also
    --------
    fly : Simulate the pass.
    ship_heading : Heading that gives an aspect.

    Notes
    -----
    The article describes one active detector, twelve passive ones along the scan, 1 m range
    precision and a 45 deg mirror [1]_. It states no speeds, rates, gate, carrier-to-noise ratio or
    number of samples: the defaults are assumptions that lead to its 8 to 12 lines a pixel at 3 to 5
    km and its 0.8 m pixel at 4 km. Of the passive channel it states only the band, 8 to 12 um: the
    ship's temperature is that of its Table 1; noise, sea and air are assumptions.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'The Infrared Airborne Radar (IRAR) System'.

    Examples
    --------
    The flight of the article's measurements, 5 deg off the stern at 3.9 km:

    >>> flight = Flight(slant_range=3.9e3, ship_heading=ship_heading(aspect=175, sight=5))
    >>> print(f"{flight.pixel:.1f} m, {flight.lines_per_pixel:.0f} lines a pixel")
    0.8 m, 10 lines a pixel
    """

    slant_range: float
    ship_heading: float
    depression: float = 6.7
    aircraft_speed: float = 90.0
    ship_speed: float = 8.0
    aircraft_heading: float = 0.0
    aircraft_track: float | None = None
    offset: float = 5.0
    pointing: float | None = None
    mirror_angle: float = 45.0
    ifov: float = 205e-6
    line_rate: float = 119.0
    samples: int = 160
    pulse_rate: float = 20_000.0
    cnr: float = 100.0
    pulse_width: float = 30e-9
    range_sigma: float = 1.0
    range_gate: float = 300.0
    threshold: float = 4.0
    detectors: int = 12
    nedt: float = 0.4
    band_start: float = LONG_WAVE[0]
    band_stop: float = LONG_WAVE[1]
    contrast_at_zero: float = CONTRAST_AT_ZERO
    sea_temperature: float = SEA_TEMPERATURE
    band_extinction: float = LONG_WAVE_EXTINCTION
    clutter: float = 0.0
    clutter_length: float = 10.0
    jitter: float = 0.0
    jitter_time: float = 0.1

    def __post_init__(self) -> None:
        """Raise `ValueError` for invalid parameters."""
        for name, (_, limits) in PARAMETERS.items():
            if getattr(self, name) is not None or name not in OPTIONAL_PARAMETERS:
                require(name, getattr(self, name), **limits)
        for name in ("samples", "detectors"):  # 160.0 is accepted, but is no array length
            object.__setattr__(self, name, int(getattr(self, name)))
        if self.pulse_rate < self.line_rate * self.samples:
            raise ValueError(
                f"pulse_rate is {self.pulse_rate:g}, but must be at least "
                f"{self.line_rate * self.samples:g}, line_rate times samples"
            )
        if not self.band_start < self.band_stop:
            raise ValueError(
                f"band_start is {self.band_start:g}, but must be below "
                f"{self.band_stop:g}, band_stop"
            )
        if self.climb <= 0:
            raise ValueError(
                f"aircraft_speed is {self.aircraft_speed:g}, but must be high enough to close on "
                f"the ship, which now opens at {-self.closing_speed:g} m/s"
            )

    @property
    def track(self) -> float:
        """Direction of the aircraft's motion, clockwise from north [deg]."""
        return self.aircraft_heading if self.aircraft_track is None else self.aircraft_track

    @property
    def sight(self) -> float:
        """Azimuth of the ship's origin in the snapshot, clockwise from north [deg]."""
        return self.aircraft_heading + self.offset

    @property
    def aspect(self) -> float:
        """Aspect of the ship in the snapshot, 0 bow-on, 90 port beam [deg]."""
        return (self.ship_heading - self.sight + 180.0) % 360.0

    @property
    def pixel(self) -> float:
        """Side of an IFOV at the ship [m]."""
        return self.ifov * self.slant_range

    @property
    def contrast(self) -> float:
        """Apparent temperature of the ship above the sea in the passive band [K]."""
        return band_contrast(
            self.slant_range,
            band=(self.band_start, self.band_stop),
            contrast_at_zero=self.contrast_at_zero,
            sea_temperature=self.sea_temperature,
            extinction=self.band_extinction,
        )

    @property
    def velocity(self) -> Floats:
        """Velocity of the aircraft relative to the ship, (3,) east, north, up [m/s]."""
        aircraft = self.aircraft_speed * compass_directions(self.track, 0.0)
        ship: Floats = self.ship_speed * compass_directions(self.ship_heading, 0.0)
        return aircraft - ship

    @property
    def closing_speed(self) -> float:
        """Rate at which the horizontal distance to the ship decreases in the snapshot [m/s]."""
        return float(self.velocity @ compass_directions(self.sight, 0.0))

    @property
    def drift(self) -> float:
        """Velocity of the ship to the right across the line of sight, in the snapshot [m/s]."""
        return float(-self.velocity @ compass_directions(self.sight + 90.0, 0.0))

    @property
    def climb(self) -> float:
        """Speed at which the lines climb the ship in the snapshot [m/s]."""
        return self.closing_speed * math.sin(math.radians(self.depression))

    @property
    def lines_per_pixel(self) -> float:
        """Overscan N: lines in the time in which they climb one IFOV."""
        return self.line_rate * self.pixel / self.climb

    @property
    def pulse_length(self) -> float:
        """Length of the pulse in range, c T / 2 [m]."""
        return SPEED_OF_LIGHT * self.pulse_width / 2

    @property
    def to_ship(self) -> Floats:
        """Rotation (3, 3) from (east, north, up) to the ship's axes."""
        s, c = math.sin(math.radians(self.ship_heading)), math.cos(math.radians(self.ship_heading))
        return np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])

    @property
    def snapshot_axes(self) -> Floats:
        """Right, up and away of the snapshot in the ship's axes, (3, 3)."""
        away = compass_directions(self.sight, -self.depression)
        right = compass_directions(self.sight + 90.0, 0.0)
        return np.stack([right, np.cross(right, away), away]) @ self.to_ship.T

    def position(self, time: NDArray[np.floating]) -> Floats:
        """Return places of the aircraft in the ship's axes, (..., 3) [m], at (...) times [s]."""
        start = -self.slant_range * compass_directions(self.sight, -self.depression)
        return (start + np.asarray(time)[..., None] * self.velocity) @ self.to_ship.T

    @property
    def scanner_axes(self) -> Floats:
        """Axes along the scan, across it and ahead, in the ship's axes, (3, 3)."""
        pointing = self.offset if self.pointing is None else self.pointing
        axes = mirror_axes(
            azimuth=self.aircraft_heading + pointing,
            depression=self.depression,
            mirror_angle=self.mirror_angle,
        )
        return axes @ self.to_ship.T

    def directions(self, along: Floats, across: Floats) -> Floats:
        """Return directions of the beam, (..., 3) in the ship's axes.

        `along` are scan angles to the right, `across` angles above the scan plane, (...) [rad].
        """
        scanner = [np.cos(across) * np.sin(along), np.sin(across), np.cos(across) * np.cos(along)]
        return np.stack(np.broadcast_arrays(*scanner), axis=-1) @ self.scanner_axes

    def angles_to(self, points: Floats, time: NDArray[np.floating]) -> tuple[Floats, Floats]:
        """Return the angles, as for `directions`, of (..., 3) points at (...) times.

        Points are in the ship's axes [m], times after the snapshot [s].
        """
        scanner = (points - self.position(time)) @ self.scanner_axes.T
        along, across, ahead = np.moveaxis(scanner, -1, 0)
        return np.arctan2(along, ahead), np.arctan2(across, np.hypot(along, ahead))

    def scan_angles(self, columns: NDArray[np.integer]) -> Floats:
        """Return the scan angles of samples, (column,) [rad], also outside the line."""
        return (np.asarray(columns) - (self.samples - 1) / 2) * self.ifov


def ship_heading(*, aspect: float, sight: float) -> float:
    """Return the heading of a ship that is seen at a given aspect.

    Parameters
    ----------
    aspect : float
        Aspect of the ship, 0 bow-on, 90 port beam [deg].
    sight : float
        Azimuth of the line of sight from the aircraft, clockwise from north [deg].

    Returns
    -------
    float
        Heading clockwise from north, from 0 to below 360 [deg].

    Raises
    ------
    ValueError
        If an angle is out of range.

    See Also
    --------
    Flight : Parameters of a pass.

    Examples
    --------
    A ship seen 5 deg off its stern, in the direction 5 deg east of north, sails north:

    >>> ship_heading(aspect=175, sight=5)
    0.0
    """
    require("aspect", aspect, minimum=-360, maximum=360)
    require("sight", sight, minimum=-720, maximum=720)
    return (aspect + sight + 180.0) % 360.0
