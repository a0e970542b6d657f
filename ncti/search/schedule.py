"""Time that a field of regard takes, by the imager, by visits, and by the laser radar alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ncti.checks import require
from ncti.ladar.pulse import SPEED_OF_LIGHT

DETECTOR = 2
"""Elements of the laser radar's detector along either side; article, 'NCTI Sensor Suite'."""

_ROUNDING = 1e-9  # of an element: what fits but for rounding needs no further position


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """What a search takes, part by part [s].

    Attributes
    ----------
    imaging : float
        Frames of the imager over the whole field, and its moves.
    slewing : float
        Moves of the laser radar to its visits.
    dwelling : float
        Frames of the laser radar on its visits.
    alone : float
        Frames of the laser radar over the whole field, which visits make unnecessary.
    """

    imaging: float
    slewing: float
    dwelling: float
    alone: float

    @property
    def total(self) -> float:
        """Time of the whole search [s]."""
        return self.imaging + self.slewing + self.dwelling

    @property
    def gain(self) -> float:
        """How many times longer the laser radar alone takes."""
        return self.alone / self.total


def position_count(width: float, height: float, *, element: float, detector: int = DETECTOR) -> int:
    """Return how many places of a square detector cover a rectangle.

    Parameters
    ----------
    width, height : float
        Sides of the rectangle, in the unit of `element`; above 0.
    element : float
        Side of what one detector element sees.
    detector : int
        Elements along either side of the detector.

    Returns
    -------
    int
        ceil(width / (detector element)) ceil(height / (detector element)).

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Notes
    -----
    The article's detector has 2 x 2 elements of 150 urad, and its field 2 x 3 deg: 117 x 175
    positions.

    Examples
    --------
    >>> from math import radians
    >>> from ncti.search import position_count
    >>> position_count(radians(2), radians(3), element=150e-6)
    20475
    """
    require("width", width, positive=True)
    require("height", height, positive=True)
    require("element", element, positive=True)
    require("detector", detector, minimum=1, whole=True)
    columns, rows = (math.ceil(side / (detector * element) - _ROUNDING) for side in (width, height))
    return max(columns, 1) * max(rows, 1)


def dwell(positions: int, *, frame_count: int, pulse_rate: float) -> float:
    """Return the time of some frames at each of some positions.

    Parameters
    ----------
    positions : int
        Places of the detector.
    frame_count : int
        Frames at each; a frame is one pulse.
    pulse_rate : float
        Pulses a second [Hz].

    Returns
    -------
    float
        positions frame_count / pulse_rate [s].

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """
    require("positions", positions, minimum=0, whole=True)
    require("frame_count", frame_count, minimum=1, whole=True)
    require("pulse_rate", pulse_rate, positive=True)
    return positions * frame_count / pulse_rate


def most_pulses(slant_range: float) -> float:
    """Return the pulse rate at which a pulse is back when the next one leaves.

    Parameters
    ----------
    slant_range : float
        Sensor to the farthest target [m].

    Returns
    -------
    float
        c / (2 slant_range) [Hz]: 1,499 Hz at 100 km. Faster pulses leave a range ambiguous.

    Raises
    ------
    ValueError
        If the range is not positive and finite.
    """
    require("slant_range", slant_range, positive=True)
    return SPEED_OF_LIGHT / (2 * slant_range)


def imaging_time(
    width: float,
    height: float,
    *,
    ifov: float,
    pixels: int,
    frame_count: int,
    frame_rate: float,
    slew_time: float,
) -> float:
    """Return the time in which a staring imager steps over a field.

    Parameters
    ----------
    width, height : float
        Sides of the field [rad].
    ifov : float
        Field of view of a pixel [rad].
    pixels : int
        Pixels along either side of its array.
    frame_count : int
        Frames at each place.
    frame_rate : float
        Frames a second [Hz].
    slew_time : float
        Time of a move between places [s].

    Returns
    -------
    float
        places frame_count / frame_rate + (places - 1) slew_time [s].

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """
    require("frame_rate", frame_rate, positive=True)
    require("slew_time", slew_time, minimum=0.0)
    places = position_count(width, height, element=ifov, detector=pixels)
    staring = dwell(places, frame_count=frame_count, pulse_rate=frame_rate)
    return staring + (places - 1) * slew_time


def schedule(
    visits: Sequence[int],
    *,
    imaging: float,
    whole: int,
    frame_count: int,
    pulse_rate: float,
    slew_time: float,
) -> Schedule:
    """Return the time of a search with some visits, beside that of a scan of the whole field.

    Parameters
    ----------
    visits : sequence of int
        Positions of the detector on each visit.
    imaging : float
        Time of the imager [s]; see `imaging_time`.
    whole : int
        Positions of the detector over the whole field.
    frame_count : int
        Frames at each position.
    pulse_rate : float
        Pulses a second [Hz].
    slew_time : float
        Time of a move to a visit [s]; steps within a visit take none.

    Returns
    -------
    Schedule
        Time by part.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """
    require("imaging", imaging, minimum=0.0)
    require("slew_time", slew_time, minimum=0.0)
    return Schedule(
        imaging=imaging,
        slewing=len(visits) * slew_time,
        dwelling=dwell(sum(visits), frame_count=frame_count, pulse_rate=pulse_rate),
        alone=dwell(whole, frame_count=frame_count, pulse_rate=pulse_rate),
    )
