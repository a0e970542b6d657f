"""Search of a field of regard: passive detection, laser-radar visits, and their schedule."""

from ncti.search.field import Box, Detection, Field, cue, detect, elevation, thermal_field
from ncti.search.imager import Imager, observe, places
from ncti.search.schedule import Schedule, imaging_time, most_pulses, position_count, schedule
from ncti.search.targets import Survey, Target, box, owner
from ncti.search.visits import Laser, Rates, VisitTemplates, outcomes

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
    "most_pulses",
    "observe",
    "outcomes",
    "owner",
    "places",
    "position_count",
    "schedule",
    "thermal_field",
]
