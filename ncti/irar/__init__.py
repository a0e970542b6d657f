"""Infrared airborne radar: a flight simulated, its images corrected, its range profiles."""

from ncti.irar.autofocus import autofocus
from ncti.irar.chain import Correction, correct, profile, segmented
from ncti.irar.clusters import histogram_cluster_average
from ncti.irar.flight import Flight, ship_heading
from ncti.irar.landmarks import (
    Landmarks,
    Peak,
    landmarks,
    profile_correlation,
)
from ncti.irar.looks import average, gather_looks, looks_of, median
from ncti.irar.materials import reflectivity
from ncti.irar.mirror import mirror_rotation
from ncti.irar.printed import correct_as_printed
from ncti.irar.profiling import range_profile
from ncti.irar.registration import (
    azimuth_shift,
    mirror_displacement,
    motion_displacement,
    raw_places,
    rotated,
    snapshot_places,
)
from ncti.irar.scan import Pass, Scan, fly
from ncti.irar.scene import Returns, ScanPlan, plan_scan, scan_scene
from ncti.irar.segmentation import noise_threshold, segment
from ncti.irar.signature import measured_extent
from ncti.irar.snapshot import Snapshot, Window, ship_window, true_snapshot
from ncti.irar.speckle import speckle_correlation
from ncti.irar.tilt import Tilt, tilts
from ncti.irar.time_delay import time_delay_integrate

__all__ = [
    "Correction",
    "Flight",
    "Landmarks",
    "Pass",
    "Peak",
    "Returns",
    "Scan",
    "ScanPlan",
    "Snapshot",
    "Tilt",
    "Window",
    "autofocus",
    "average",
    "azimuth_shift",
    "correct",
    "correct_as_printed",
    "fly",
    "gather_looks",
    "histogram_cluster_average",
    "landmarks",
    "looks_of",
    "measured_extent",
    "median",
    "mirror_displacement",
    "mirror_rotation",
    "motion_displacement",
    "noise_threshold",
    "plan_scan",
    "profile",
    "profile_correlation",
    "range_profile",
    "raw_places",
    "reflectivity",
    "rotated",
    "scan_scene",
    "segment",
    "segmented",
    "ship_heading",
    "ship_window",
    "snapshot_places",
    "speckle_correlation",
    "tilts",
    "time_delay_integrate",
    "true_snapshot",
]
