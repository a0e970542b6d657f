"""Motion and mirror taken out of a scan: the place of every sample in the snapshot.

Each step gives what to add to a sample's place or range; none of them resamples an image, so that
steps do not blur one another and looks stay apart until they are averaged (`looks`). Rows and
columns are counted in pixels, IFOVs of the snapshot, from the line of sight to the ship's origin,
upwards and to the right.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.irar.flight import Flight
from ncti.irar.mirror import MIRROR_FORMS, mirror_rotation

Floats = NDArray[np.float64]

MOTION_METHODS = ("pixel", "line", "constant")


def azimuth_shift(
    *,
    aircraft_speed: float,
    aircraft_heading: float,
    ship_speed: float,
    ship_heading: float,
    offset: float,
    slant_range: float,
    ifov: float,
    rate: float,
    scans: float = 1.0,
) -> float:
    """Shift of the ship's image across the scan, in pixels, from one scan or row to the next.

    Parameters
    ----------
    aircraft_speed, ship_speed : float
        V_a and V_s [m/s].
    aircraft_heading, ship_heading : float
        beta_a and beta_s, clockwise from north [deg].
    offset : float
        Azimuth of the line of sight from the aircraft's heading, theta [deg].
    slant_range : float
        R [m].
    ifov : float
        phi [rad].
    rate : float
        f [Hz].
    scans : float
        N, scans that pass between the two.

    Returns
    -------
    float
        N (V_a sin(theta) - V_s cos(beta_a + theta + 270 deg - beta_s)) / (R phi f), positive to
        the right.

    Raises
    ------
    ValueError
        If a speed is negative, an angle not finite, or range, IFOV, rate or scans not positive.

    Notes
    -----
    Article, 'Data Processing', the equation for the azimuthal shift. The bracket is the velocity
    across the line of sight, to the right, of the ship as the aircraft sees it: cos(x + 270 deg)
    is sin(x), and the ship's part, V_s sin(beta_s - beta_a - theta), has a plus. The article
    calls f the pulse-repetition frequency; the equation is a shift per scan only with the line
    rate, and with N = 1. N lines make a row, so N gives the shift per row. With the
    pulse-repetition frequency it is smaller by the number of samples of a line.
    """
    for name, value in (("aircraft_speed", aircraft_speed), ("ship_speed", ship_speed)):
        require(name, value, minimum=0)
    require("aircraft_heading", aircraft_heading)
    require("ship_heading", ship_heading)
    require("offset", offset)
    for name, value in (
        ("slant_range", slant_range),
        ("ifov", ifov),
        ("rate", rate),
        ("scans", scans),
    ):
        require(name, value, positive=True)
    theta = math.radians(offset)
    ship = math.radians(aircraft_heading + offset + 270.0 - ship_heading)
    bracket = aircraft_speed * math.sin(theta) - ship_speed * math.cos(ship)
    return scans * bracket / (slant_range * ifov * rate)


def snapshot_places(flight: Flight, time: Floats, ranges: Floats) -> tuple[Floats, Floats, Floats]:
    """Row, column and range in the snapshot of what each sample sees, by dead reckoning.

    Parameters
    ----------
    flight : Flight
        The pass, as it is believed to be.
    time : (line, sample) float64 ndarray
        When each sample is taken [s].
    ranges : (line, sample) float64 ndarray
        Measured [m]; where NaN, that of the ship's origin is taken.

    Returns
    -------
    row, column : (line, sample) float64 ndarray
        [pixel].
    range : (line, sample) float64 ndarray
        Distance to the snapshot's place of the aircraft [m]; NaN where `ranges` is.

    Notes
    -----
    The exact geometry, all corrections at once: a sample's direction and range put a point on the
    ship, and the point's place is where the aircraft of the snapshot would have seen it.
    """
    now = flight.position(time)
    nominal = np.linalg.norm(now, axis=-1)
    reach = np.where(np.isnan(ranges), nominal, ranges)
    point = now + reach[..., None] * _beams(flight, time.shape)
    seen = point - flight.position(np.zeros(()))
    row, column = _image(flight, seen)
    there = np.linalg.norm(seen, axis=-1)
    return row, column, np.where(np.isnan(ranges), np.nan, there)


def raw_places(flight: Flight, samples: NDArray[np.integer]) -> tuple[Floats, Floats]:
    """Rows and columns of samples as if the scan were level and nothing moved.

    Parameters
    ----------
    flight : Flight
        The pass.
    samples : (sample,) int ndarray
        Their numbers.

    Returns
    -------
    row, column : (sample,) float64 ndarray
        One column a sample, about where the scan points [pixel].
    """
    row, column = _image(flight, flight.directions(np.zeros(()), np.zeros(())))
    along: Floats = np.asarray(samples) - (flight.samples - 1) / 2
    return np.full_like(along, row), along + column


def mirror_displacement(
    flight: Flight, samples: NDArray[np.integer], *, form: str = "exact"
) -> tuple[Floats, Floats]:
    """Rows and columns by which the mirror's lean moves samples of a line.

    Parameters
    ----------
    flight : Flight
        The pass.
    samples : (sample,) int ndarray
        Their numbers.
    form : str
        `exact`: every sample's beam by reflection. `printed`: a shear by the article's
        small-angle form of the lean.

    Returns
    -------
    row, column : (sample,) float64 ndarray
        To add to `raw_places` [pixel].

    Raises
    ------
    ValueError
        If the form is unknown.

    Notes
    -----
    Article, 'Data Processing', which asks for a rotation (`rotated`). With one scanned detector
    the lines lean and the rows still climb straight up with the aircraft: a shear. The rotation
    levels the waterline too, and leans the mast by as much.

    A sample of a line that leans by L is sin(L) higher than the one before it, and cos(L) to its
    right. At psi = 45 deg the printed tangent is that sine exactly, by chance, so that the printed
    shear levels the waterline; only its columns stay 1 - cos(L) too wide.
    """
    if form not in MIRROR_FORMS:
        raise ValueError(f"form is {form!r}, but must be one of {', '.join(MIRROR_FORMS)}")
    level_row, level_column = raw_places(flight, samples)
    angles = flight.scan_angles(samples)
    if form == "exact":
        row, column = _image(flight, flight.directions(angles, np.zeros_like(angles)))
        return row - level_row, column - level_column
    lean = mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle, form=form)
    return math.tan(math.radians(lean)) * angles / flight.ifov, np.zeros_like(angles)


def rotated(row: Floats, column: Floats, *, clockwise: float) -> tuple[Floats, Floats]:
    """Places turned about the ship's origin, the article's correction for the mirror.

    Parameters
    ----------
    row, column : (...) float64 ndarray
        Places [pixel].
    clockwise : float
        Angle [deg]: -`mirror_rotation` undoes what that gives.

    Returns
    -------
    row, column : (...) float64 ndarray
    """
    c, s = math.cos(math.radians(clockwise)), math.sin(math.radians(clockwise))
    return c * row - s * column, s * row + c * column


def motion_displacement(
    flight: Flight, time: Floats, ranges: Floats, *, method: str = "pixel"
) -> tuple[Floats, Floats, Floats]:
    """Rows, columns and range between a sample's time and the snapshot.

    Parameters
    ----------
    flight : Flight
        The pass, as it is believed to be.
    time, ranges
        As for `snapshot_places`.
    method : str
        `pixel`: every sample by its own range and direction. `line`: as the ship's origin moves,
        with range and offset of each line. `constant`: as it moves at time 0, one shift for all
        lines, `azimuth_shift` for the columns.

    Returns
    -------
    row, column : (line, sample) float64 ndarray
        To add to a sample's place [pixel].
    range : (line, sample) float64 ndarray
        To add to its range [m].

    Raises
    ------
    ValueError
        If the method is unknown.

    Notes
    -----
    Article, 'Data Processing': "computed at each pixel location and propagated through every
    scanline". At 5 deg off the bow of the aircraft a mast leans by nearly 40 deg without it, by
    some degrees with one shift, by one with each line's, and not at all with each pixel's.
    """
    if method not in MOTION_METHODS:
        raise ValueError(f"method is {method!r}, but must be one of {', '.join(MOTION_METHODS)}")
    if method == "constant":
        row = flight.climb * time / flight.pixel
        shift = flight.line_rate * azimuth_shift(
            aircraft_speed=flight.aircraft_speed,
            # The equation takes the aircraft to move along its heading.
            aircraft_heading=flight.track,
            ship_speed=flight.ship_speed,
            ship_heading=flight.ship_heading,
            offset=flight.sight - flight.track,
            slant_range=flight.slant_range,
            ifov=flight.ifov,
            rate=flight.line_rate,
        )
        towards = flight.closing_speed * math.cos(math.radians(flight.depression))
        return row, -shift * time, towards * time
    now, then = flight.position(time), flight.position(np.zeros(()))
    if method == "line":
        row, column = _image(flight, -now)
        nominal = np.linalg.norm(now, axis=-1)
        return -row, -column, flight.slant_range - nominal
    row, column, there = snapshot_places(flight, time, ranges)
    row_now, column_now = _image(flight, _beams(flight, time.shape))
    nominal = np.linalg.norm(now, axis=-1)
    closer = np.where(np.isnan(ranges), np.linalg.norm(then) - nominal, there - ranges)
    return row - row_now, column - column_now, closer


def _beams(flight: Flight, shape: tuple[int, ...]) -> Floats:
    angles = flight.scan_angles(np.arange(shape[-1]))
    return np.broadcast_to(flight.directions(angles, np.zeros_like(angles)), (*shape, 3))


def _image(flight: Flight, directions: Floats) -> tuple[Floats, Floats]:
    """Rows and columns of directions in the snapshot [pixel]."""
    right, up, away = np.moveaxis(directions @ flight.snapshot_axes.T, -1, 0)
    return up / away / flight.ifov, right / away / flight.ifov
