"""Infrared airborne radar: simulated flights, corrected images and their range profiles."""

from ncti.irar.autofocus import autofocus
from ncti.irar.chain import Correction, correct, profile, segmented
from ncti.irar.corrected import Chain
from ncti.irar.flight import Flight, ship_heading
from ncti.irar.landmarks import Landmarks, Peak, landmarks, profile_correlation
from ncti.irar.materials import reflectivity
from ncti.irar.mirror import mirror_rotation
from ncti.irar.printed import correct_as_printed
from ncti.irar.registration import azimuth_shift
from ncti.irar.scan import Pass, Scan, fly
from ncti.irar.signature import measured_extent
from ncti.irar.snapshot import ShipPixels, Snapshot, Window, ship_window, true_snapshot
from ncti.irar.tilt import Tilt, tilts
from ncti.irar.time_delay import time_delay_integrate

__all__ = [
    "Chain",
    "Correction",
    "Flight",
    "Landmarks",
    "Pass",
    "Peak",
    "Scan",
    "ShipPixels",
    "Snapshot",
    "Tilt",
    "Window",
    "autofocus",
    "azimuth_shift",
    "correct",
    "correct_as_printed",
    "fly",
    "landmarks",
    "measured_extent",
    "mirror_rotation",
    "profile",
    "profile_correlation",
    "reflectivity",
    "segmented",
    "ship_heading",
    "ship_window",
    "tilts",
    "time_delay_integrate",
    "true_snapshot",
]
