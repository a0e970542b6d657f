"""Search of a field of regard: passive detection, laser-radar visits, and their schedule."""

from studies.scan.field import Box, Detection, Field, cue, detect, elevation, thermal_field
from studies.scan.imager import Imager, observe, places
from studies.scan.schedule import Schedule, imaging_time, max_pulse_rate, position_count, schedule
from studies.scan.targets import Survey, Target, box, owner
from studies.scan.visits import Laser, Rates, VisitTemplates, outcomes

__all__ = [
    "Box",
    "Detection",
    "Field",
    "Imager",
    "Laser",
    "Rates",
    "Schedule",
    "Survey",
    "Target",
    "VisitTemplates",
    "box",
    "cue",
    "detect",
    "elevation",
    "imaging_time",
    "max_pulse_rate",
    "observe",
    "outcomes",
    "owner",
    "places",
    "position_count",
    "schedule",
    "thermal_field",
]
