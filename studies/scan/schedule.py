"""Duration of a search, by imager and visits, or by the laser radar alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ncti.ladar.pulse import SPEED_OF_LIGHT
from studies.scan.field import Box, Field

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


def position_count(width: float, height: float, *, element: float, detector: int = DETECTOR) -> int:
    """Return the number of positions of a square detector that cover a rectangle.

    `element` is the field of view of one detector element, in the unit of the sides. The 2 x 2
    elements of 150 urad in the article's 'NCTI Sensor Suite' cover its field, 2 x 3 deg, in 117 x
    175 positions.
    """
    columns, rows = (math.ceil(side / (detector * element) - _ROUNDING) for side in (width, height))
    return max(columns, 1) * max(rows, 1)


def dwell(positions: int, *, frame_count: int, pulse_rate: float) -> float:
    """Return the duration [s] of `frame_count` pulses at each position, at `pulse_rate` [Hz]."""
    return positions * frame_count / pulse_rate


def max_pulse_rate(slant_range: float) -> float:
    """Return the highest pulse rate without range ambiguity, c / (2 slant_range) [Hz]."""
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
    positions = position_count(width, height, element=ifov, detector=pixels)
    staring = dwell(positions, frame_count=frame_count, pulse_rate=frame_rate)
    return staring + (positions - 1) * slew_time


@dataclass(frozen=True)
class Rates:
    """Rates of both sensors, and the time that a move takes.

    `detector` and `imager_pixels` count elements along a side; the laser radar takes one frame a
    pulse, at `pulse_rate` [Hz], the imager `imager_frames` at `frame_rate` [Hz]; either moves in
    `slew_time` [s], and a step within a visit takes no time.
    """

    detector: int
    pulse_rate: float
    imager_pixels: int
    imager_frames: int
    frame_rate: float
    slew_time: float

    def schedule(self, field: Field, visits: Sequence[Box], frame_count: int) -> Schedule:
        """Return the times of a search with given visits and frames at each position."""
        positions = [visit.size[0] * visit.size[1] // self.detector**2 for visit in visits]
        whole = position_count(
            field.width, field.height, element=field.ifov, detector=self.detector
        )
        pulses: dict[str, Any] = {"frame_count": frame_count, "pulse_rate": self.pulse_rate}
        return Schedule(
            imaging=imaging_time(
                field.width,
                field.height,
                ifov=field.ifov,
                pixels=self.imager_pixels,
                frame_count=self.imager_frames,
                frame_rate=self.frame_rate,
                slew_time=self.slew_time,
            ),
            slewing=len(visits) * self.slew_time,
            dwelling=dwell(sum(positions), **pulses),
            exhaustive=dwell(whole, **pulses),
        )
