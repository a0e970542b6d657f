"""Laser radar: range extent, pulse, expected profile, sampled frames, receivers."""

from ncti.ladar.budget import carrier_to_noise
from ncti.ladar.expected import expected_profile
from ncti.ladar.extent import RangeExtent, range_extent
from ncti.ladar.frames import cumulative_average, frame_blocks, sample_frames
from ncti.ladar.moments import banded_frame_moments, frame_moments, magnitude_covariance
from ncti.ladar.pulse import noise_covariance, noise_floor, shortest_pulse, target_kernel
from ncti.ladar.receivers import RECEIVERS
from ncti.ladar.tolerance import lines_within

__all__ = [
    "RECEIVERS",
    "RangeExtent",
    "banded_frame_moments",
    "carrier_to_noise",
    "cumulative_average",
    "expected_profile",
    "frame_blocks",
    "frame_moments",
    "lines_within",
    "magnitude_covariance",
    "noise_covariance",
    "noise_floor",
    "range_extent",
    "sample_frames",
    "shortest_pulse",
    "target_kernel",
]
