"""Identification by optimal matching, quick enough for many settings of both sensors at once."""

from studies.operate.costs import relative_cost
from studies.operate.fleets import bootstrap_uniforms, fleet_order, fleet_shares, views_of_ships
from studies.operate.identify import (
    CHANNELS,
    Trial,
    identify,
    match_silhouettes,
    packed,
    planned_views,
)
from studies.operate.matching import log_evidence, ship_evidence
from studies.operate.profiles import ProfileMatch, Radar, signatures
from studies.operate.silhouettes import SilhouetteMatch, silhouettes
from studies.operate.survey import ViewExtents, draw_views, random_views, seen_views
from studies.operate.tables import frames_needed, tabulate_cheapest, tabulate_frames

__all__ = [
    "CHANNELS",
    "ProfileMatch",
    "Radar",
    "SilhouetteMatch",
    "Trial",
    "ViewExtents",
    "bootstrap_uniforms",
    "draw_views",
    "fleet_order",
    "fleet_shares",
    "frames_needed",
    "identify",
    "log_evidence",
    "match_silhouettes",
    "packed",
    "planned_views",
    "random_views",
    "relative_cost",
    "seen_views",
    "ship_evidence",
    "signatures",
    "silhouettes",
    "tabulate_cheapest",
    "tabulate_frames",
    "views_of_ships",
]
