"""Search of a field of regard: passive detection, visits by the laser radar, and their time."""

from ncti.search.field import Box, Detection, Field, cue, detect, elevation, thermal_field
from ncti.search.schedule import (
    Schedule,
    dwell,
    imaging_time,
    most_pulses,
    position_count,
    schedule,
)

__all__ = [
    "Box",
    "Detection",
    "Field",
    "Schedule",
    "cue",
    "detect",
    "dwell",
    "elevation",
    "imaging_time",
    "most_pulses",
    "position_count",
    "schedule",
    "thermal_field",
]
