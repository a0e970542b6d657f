"""Search of a field of regard: passive detection, laser-radar visits, and their schedule."""

from ncti.search.field import Box, Detection, Field, cue, detect, elevation, thermal_field
from ncti.search.schedule import Schedule, imaging_time, most_pulses, position_count, schedule

__all__ = [
    "Box",
    "Detection",
    "Field",
    "Schedule",
    "cue",
    "detect",
    "elevation",
    "imaging_time",
    "most_pulses",
    "position_count",
    "schedule",
    "thermal_field",
]
