"""A flight past a ship: who moves how, and how the sensor scans meanwhile."""

from __future__ import annotations

import math
from dataclasses import dataclass

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
from ncti.irar.mirror import compass, mirror_axes
from ncti.ladar.pulse import SPEED_OF_LIGHT

Floats = NDArray[np.float64]

WAVELENGTH = 10.6e-6
"""Of the CO2 laser [m]."""


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Parameters of one pass.

    Time is 0 when the ship's origin is as far down as the mirror's line of sight: slant range,
    offset and aspect are those of that moment, whose view the corrections recover (the
    *snapshot*).

    Attributes
    ----------
    slant_range : float
        Aircraft to ship's origin [m].
    depression : float
        Of the mirror's line of sight, and of the ship's origin in the snapshot, gamma [deg].
    aircraft_speed, ship_speed : float
        Over the sea, V_a and V_s [m/s].
    aircraft_heading, ship_heading : float
        Clockwise from north, beta_a and beta_s [deg].
    aircraft_track : float or None
        Direction of the aircraft's motion, clockwise from north [deg]; None: its heading.
    offset : float
        Azimuth of the ship from the aircraft's heading, theta, clockwise [deg].
    pointing : float or None
        Azimuth of the middle of the scan from the aircraft's heading [deg]; None: so that the
        ship passes through it.
    mirror_angle : float
        Mirror pointing angle, psi [deg].
    ifov : float
        Side of the detector's instantaneous field of view, phi, and spacing of samples [rad].
    line_rate : float
        Lines a second [Hz].
    samples : int
        Of a line.
    pulse_rate : float
        Pulse-repetition frequency [Hz].
    cnr : float
        Carrier-to-noise ratio of an IFOV that a flat target fills, as a power ratio.
    pulse_width : float
        Full width of pulse and filter at 1/e^2 of the intensity [s].
    range_sigma : float
        Standard deviation of a measured range [m].
    range_gate : float
        Depth in which the receiver looks for its peak, about the range of the ship's origin [m].
    threshold : float
        Peaks below it, in noise powers, are not reported: dropouts.
    detectors : int
        Passive detectors along the scan.
    nedt : float
        Noise-equivalent temperature difference of one passive sample [K].
    band_start, band_stop : float
        Shortest and longest wavelength of the passive detectors [m].
    contrast_at_zero : float
        Temperature of the ship over the sea's [K].
    sea_temperature : float
        Of the sea [K].
    band_extinction : float
        Of radiance in that band, one way [dB/m].
    clutter : float
        Standard deviation of the sea's own temperature, as a passive sample sees it [K].
    clutter_length : float
        Distance on the water at which its correlation has fallen to 1/e [m].
    jitter : float
        Standard deviation of the line of sight's attitude error, in azimuth and in elevation
        [rad].
    jitter_time : float
        Correlation time of that error [s].

    Raises
    ------
    ValueError
        If a parameter is out of its range, the pulse rate too low for the scan, or the aircraft
        does not close on the ship.

    Notes
    -----
    Article, 'The Infrared Airborne Radar (IRAR) System': one active detector, twelve passive ones
    along the scan, 1 m range precision, 45 deg mirror. It gives no speeds, rates, gate, carrier-
    to-noise ratio or number of samples: the defaults are assumptions that lead to its 8 to 12
    lines a pixel at 3 to 5 km and its 0.8 m pixel at 4 km. Of the passive channel it gives the
    band, 8 to 12 um, and nothing else: the ship is as warm as that of its Table 1, noise, sea and
    air are assumptions.
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
        """Refuse what cannot be flown."""
        require("slant_range", self.slant_range, minimum=100, maximum=1e6)
        require("depression", self.depression, positive=True, maximum=60)
        require("aircraft_speed", self.aircraft_speed, positive=True, maximum=1000)
        require("ship_speed", self.ship_speed, minimum=0, maximum=50)
        for name in ("aircraft_heading", "ship_heading", "offset"):
            require(name, getattr(self, name), minimum=-360, maximum=360)
        if self.aircraft_track is not None:
            require("aircraft_track", self.aircraft_track, minimum=-360, maximum=360)
        if self.pointing is not None:
            require("pointing", self.pointing, minimum=-360, maximum=360)
        require("mirror_angle", self.mirror_angle, minimum=1, maximum=80)
        require("ifov", self.ifov, minimum=1e-6, maximum=0.01)
        require("line_rate", self.line_rate, minimum=1, maximum=100_000)
        require("samples", self.samples, whole=True, minimum=2, maximum=10_000)
        require("detectors", self.detectors, whole=True, minimum=1, maximum=1000)
        for name in ("samples", "detectors"):  # 160.0 counts, but is no length of an array
            object.__setattr__(self, name, int(getattr(self, name)))
        require("pulse_rate", self.pulse_rate, positive=True, maximum=1e9)
        if self.pulse_rate < self.line_rate * self.samples:
            raise ValueError(
                f"pulse_rate is {self.pulse_rate:g}, but must be at least "
                f"{self.line_rate * self.samples:g}, line_rate times samples"
            )
        require("cnr", self.cnr, positive=True, maximum=1e9)
        require("pulse_width", self.pulse_width, minimum=2e-9, maximum=1e-6)
        require("range_sigma", self.range_sigma, minimum=0, maximum=100)
        require("range_gate", self.range_gate, minimum=10, maximum=1e5)
        require("threshold", self.threshold, minimum=0, maximum=1e9)
        require("nedt", self.nedt, minimum=0, maximum=1000)
        for name in ("band_start", "band_stop"):
            require(name, getattr(self, name), minimum=1e-7, maximum=1e-3)
        if not self.band_start < self.band_stop:
            raise ValueError(
                f"band_start is {self.band_start:g}, but must be below "
                f"{self.band_stop:g}, band_stop"
            )
        require("contrast_at_zero", self.contrast_at_zero, minimum=0, maximum=1000)
        require("sea_temperature", self.sea_temperature, minimum=100, maximum=1000)
        require("band_extinction", self.band_extinction, minimum=0, maximum=0.01)
        require("clutter", self.clutter, minimum=0, maximum=1000)
        require("clutter_length", self.clutter_length, minimum=0.01, maximum=1e5)
        require("jitter", self.jitter, minimum=0, maximum=0.01)
        require("jitter_time", self.jitter_time, positive=True, maximum=1000)
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
        """Of the ship in the snapshot, 0 bow-on, 90 port beam [deg]."""
        return (self.ship_heading - self.sight + 180.0) % 360.0

    @property
    def pixel(self) -> float:
        """Side of an IFOV at the ship [m]."""
        return self.ifov * self.slant_range

    @property
    def contrast(self) -> float:
        """Apparent temperature of the ship over the sea's, in the passive band [K]."""
        return band_contrast(
            self.slant_range,
            band=(self.band_start, self.band_stop),
            contrast_at_zero=self.contrast_at_zero,
            sea_temperature=self.sea_temperature,
            extinction=self.band_extinction,
        )

    @property
    def velocity(self) -> Floats:
        """(3,): of the aircraft relative to the ship, east, north, up [m/s]."""
        aircraft = self.aircraft_speed * compass(self.track, 0.0)
        ship: Floats = self.ship_speed * compass(self.ship_heading, 0.0)
        return aircraft - ship

    @property
    def closing_speed(self) -> float:
        """Rate at which the horizontal distance to the ship falls, in the snapshot [m/s]."""
        return float(self.velocity @ compass(self.sight, 0.0))

    @property
    def drift(self) -> float:
        """Velocity of the ship to the right across the line of sight, in the snapshot [m/s]."""
        return float(-self.velocity @ compass(self.sight + 90.0, 0.0))

    @property
    def climb(self) -> float:
        """Speed at which the lines climb up the ship, in the snapshot [m/s]."""
        return self.closing_speed * math.sin(math.radians(self.depression))

    @property
    def lines_per_pixel(self) -> float:
        """Overscan, N: lines in the time that they climb one IFOV."""
        return self.line_rate * self.pixel / self.climb

    @property
    def pulse_length(self) -> float:
        """Of the pulse in range, c T / 2 [m]."""
        return SPEED_OF_LIGHT * self.pulse_width / 2

    @property
    def to_ship(self) -> Floats:
        """(3, 3): turns (east, north, up) into the ship's axes."""
        s, c = math.sin(math.radians(self.ship_heading)), math.cos(math.radians(self.ship_heading))
        return np.array([[s, c, 0.0], [-c, s, 0.0], [0.0, 0.0, 1.0]])

    @property
    def snapshot_axes(self) -> Floats:
        """(3, 3): right, up and away of the snapshot, in the ship's axes."""
        away = compass(self.sight, -self.depression)
        right = compass(self.sight + 90.0, 0.0)
        return np.stack([right, np.cross(right, away), away]) @ self.to_ship.T

    def position(self, time: NDArray[np.floating]) -> Floats:
        """(..., 3): where the aircraft is (...) seconds after the snapshot, in the ship's axes."""
        start = -self.slant_range * compass(self.sight, -self.depression)
        return (start + np.asarray(time)[..., None] * self.velocity) @ self.to_ship.T

    @property
    def scanner_axes(self) -> Floats:
        """(3, 3): along the scan, across it and ahead, in the ship's axes."""
        pointing = self.offset if self.pointing is None else self.pointing
        axes = mirror_axes(
            azimuth=self.aircraft_heading + pointing,
            depression=self.depression,
            mirror_angle=self.mirror_angle,
        )
        return axes @ self.to_ship.T

    def directions(self, along: Floats, across: Floats) -> Floats:
        """(..., 3): where the beam goes, in the ship's axes.

        Of (...) scan angles, to the right, and angles above the scan plane, both in the scanner
        [rad].
        """
        scanner = [np.cos(across) * np.sin(along), np.sin(across), np.cos(across) * np.cos(along)]
        return np.stack(np.broadcast_arrays(*scanner), axis=-1) @ self.scanner_axes

    def angles_to(self, points: Floats, time: NDArray[np.floating]) -> tuple[Floats, Floats]:
        """(...), (...): along and across, as for `directions`, of (..., 3) points at (...) times.

        Points are in the ship's axes [m], times after the snapshot [s].
        """
        scanner = (points - self.position(time)) @ self.scanner_axes.T
        along, across, ahead = np.moveaxis(scanner, -1, 0)
        return np.arctan2(along, ahead), np.arctan2(across, np.hypot(along, ahead))

    def scan_angles(self, columns: NDArray[np.integer]) -> Floats:
        """(column,): scan angle of samples, perhaps before the first or beyond the last [rad]."""
        return (np.asarray(columns) - (self.samples - 1) / 2) * self.ifov


def ship_heading(*, aspect: float, sight: float) -> float:
    """Heading of a ship that is seen at an aspect.

    Parameters
    ----------
    aspect : float
        0 bow-on, 90 port beam [deg].
    sight : float
        Azimuth of the line of sight from the aircraft, clockwise from north [deg].

    Returns
    -------
    float
        Clockwise from north, from 0 to below 360 [deg].
    """
    require("aspect", aspect, minimum=-360, maximum=360)
    require("sight", sight, minimum=-720, maximum=720)
    return (aspect + sight + 180.0) % 360.0
