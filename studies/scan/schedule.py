"""Duration of a search, by imager and visits, or by the laser radar alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ncti.checks import require
from ncti.ladar.pulse import SPEED_OF_LIGHT

DETECTOR = 2
"""Elements of the laser radar's detector along either side; article, 'NCTI Sensor Suite'."""

_ROUNDING = 1e-9  # of an element: rounding makes no further position


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Durations of the parts of a search [s].

    Attributes
    ----------
    imaging : float
        Frames of the imager over the whole field, and its moves.
    slewing : float
        Moves of the laser radar to its visits.
    dwelling : float
        Frames of the laser radar on its visits.
    exhaustive : float
        Frames of the laser radar over the whole field, without an imager.

    See Also
    --------
    schedule : Returns one.

    Examples
    --------
    >>> from studies.scan import Schedule
    >>> search = Schedule(imaging=1.0, slewing=0.5, dwelling=0.5, exhaustive=200.0)
    >>> search.total, search.gain
    (2.0, 100.0)
    """

    imaging: float
    slewing: float
    dwelling: float
    exhaustive: float

    @property
    def total(self) -> float:
        """Duration of the whole search [s]."""
        return self.imaging + self.slewing + self.dwelling

    @property
    def gain(self) -> float:
        """Duration by the laser radar alone, over that of the search."""
        return self.exhaustive / self.total


def position_count(width: float, height: float, *, element: float, detector: int = DETECTOR) -> int:
    """Return the number of positions of a square detector that cover a rectangle.

    Parameters
    ----------
    width, height : float
        Sides of the rectangle, in the unit of `element`; above 0.
    element : float
        Side of the field of view of one detector element.
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

    See Also
    --------
    schedule : Duration of a search.

    Notes
    -----
    The detector of [1]_ has 2 x 2 elements of 150 urad and its field is 2 x 3 deg: 117 x 175
    positions.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, MIT Lincoln Laboratory, 'NCTI Sensor Suite'.

    Examples
    --------
    >>> from math import radians
    >>> from studies.scan import position_count
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
    """Return the duration of frames at positions of the detector.

    Parameters
    ----------
    positions : int
        Number of positions.
    frame_count : int
        Frames at each position; a frame is one pulse.
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
    """Return the highest pulse rate without range ambiguity.

    Parameters
    ----------
    slant_range : float
        Sensor to the farthest target [m].

    Returns
    -------
    float
        c / (2 slant_range) [Hz], at which a pulse returns when the next one leaves.

    Raises
    ------
    ValueError
        If the range is not positive and finite.

    See Also
    --------
    schedule : Duration of a search.

    Examples
    --------
    >>> from studies.scan import most_pulses
    >>> round(most_pulses(100e3))
    1499
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
    """Return the duration of a scan of a field by a staring imager.

    Parameters
    ----------
    width, height : float
        Sides of the field [rad].
    ifov : float
        Field of view of a pixel [rad].
    pixels : int
        Pixels along either side of its array.
    frame_count : int
        Frames at each position.
    frame_rate : float
        Frames a second [Hz].
    slew_time : float
        Duration of a move between positions [s].

    Returns
    -------
    float
        positions frame_count / frame_rate + (positions - 1) slew_time [s].

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    schedule : Duration of a search.

    Examples
    --------
    An array of 256 x 256 pixels covers 0.03 x 0.03 rad in one position:

    >>> from studies.scan import imaging_time
    >>> field = {"width": 0.03, "height": 0.03, "ifov": 150e-6, "pixels": 256}
    >>> imaging_time(**field, frame_count=16, frame_rate=64.0, slew_time=0.5)
    0.25
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
    """Return the durations of a search with visits, and of a scan of the whole field.

    Parameters
    ----------
    visits : sequence of int
        Number of positions of the detector on each visit.
    imaging : float
        Duration of the imager's scan [s]; see `imaging_time`.
    whole : int
        Number of positions of the detector over the whole field.
    frame_count : int
        Frames at each position.
    pulse_rate : float
        Pulses a second [Hz].
    slew_time : float
        Duration of a move to a visit [s]; steps within a visit take no time.

    Returns
    -------
    Schedule
        Durations of the parts.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    imaging_time, position_count, most_pulses

    Examples
    --------
    Two visits of 40 positions each in a field of 20,475:

    >>> from studies.scan import schedule
    >>> pulses = {"frame_count": 16, "pulse_rate": 1000.0}
    >>> found = schedule([40, 40], imaging=2.0, whole=20_475, slew_time=0.5, **pulses)
    >>> found.total, found.exhaustive
    (4.28, 327.6)
    """
    require("imaging", imaging, minimum=0.0)
    require("slew_time", slew_time, minimum=0.0)
    return Schedule(
        imaging=imaging,
        slewing=len(visits) * slew_time,
        dwelling=dwell(sum(visits), frame_count=frame_count, pulse_rate=pulse_rate),
        exhaustive=dwell(whole, frame_count=frame_count, pulse_rate=pulse_rate),
    )
