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

    `imaging` the whole field includes moves of the imager, `slewing` is moving the laser radar to
    its visits, `dwelling` its frames there, and `exhaustive` its frames over the whole field
    instead.
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

    `element` is the field of view of one detector element, in the unit of the sides. The 2 x 2
    elements of 150 urad in the article's 'NCTI Sensor Suite' cover its field, 2 x 3 deg, in 117 x
    175 positions.
    """
    require("width", width, positive=True)
    require("height", height, positive=True)
    require("element", element, positive=True)
    require("detector", detector, minimum=1, whole=True)
    columns, rows = (math.ceil(side / (detector * element) - _ROUNDING) for side in (width, height))
    return max(columns, 1) * max(rows, 1)


def dwell(positions: int, *, frame_count: int, pulse_rate: float) -> float:
    """Return the duration [s] of `frame_count` pulses at each position, at `pulse_rate` [Hz]."""
    require("positions", positions, minimum=0, whole=True)
    require("frame_count", frame_count, minimum=1, whole=True)
    require("pulse_rate", pulse_rate, positive=True)
    return positions * frame_count / pulse_rate


def max_pulse_rate(slant_range: float) -> float:
    """Return the highest pulse rate without range ambiguity, c / (2 slant_range) [Hz]."""
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
    """Return the duration of a staring imager's scan of a field [s], its moves included.

    `width` and `height` are the field's and `ifov` a pixel's [rad], of an array of `pixels` along
    either side; each position takes `frame_count` frames at `frame_rate` [Hz], each move
    `slew_time` [s].
    """
    require("frame_rate", frame_rate, positive=True)
    require("slew_time", slew_time, minimum=0.0)
    positions = position_count(width, height, element=ifov, detector=pixels)
    staring = dwell(positions, frame_count=frame_count, pulse_rate=frame_rate)
    return staring + (positions - 1) * slew_time


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

    `visits` count positions of the detector, `whole` those over the field; `imaging` takes the time
    of `imaging_time`, a move to a visit `slew_time` [s], a step within one none; `pulse_rate` [Hz].
    """
    require("imaging", imaging, minimum=0.0)
    require("slew_time", slew_time, minimum=0.0)
    return Schedule(
        imaging=imaging,
        slewing=len(visits) * slew_time,
        dwelling=dwell(sum(visits), frame_count=frame_count, pulse_rate=pulse_rate),
        exhaustive=dwell(whole, frame_count=frame_count, pulse_rate=pulse_rate),
    )
