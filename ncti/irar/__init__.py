"""Infrared airborne radar: a flight simulated, its images corrected, its range profiles."""

from ncti.irar.clusters import histogram_cluster_average
from ncti.irar.looks import average, gather_looks, looks_of, median
from ncti.irar.profiling import range_profile
from ncti.irar.segmentation import noise_threshold, segment
from ncti.irar.time_delay import time_delay_integrate

__all__ = [
    "average",
    "gather_looks",
    "histogram_cluster_average",
    "looks_of",
    "median",
    "noise_threshold",
    "range_profile",
    "segment",
    "time_delay_integrate",
]
