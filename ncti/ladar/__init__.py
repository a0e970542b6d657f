"""Laser radar: range extents, link budget, expected profiles, sampled frames and their moments."""

from ncti.ladar.beam import Beam
from ncti.ladar.budget import carrier_to_noise, power_ratio
from ncti.ladar.expected import expected_profile
from ncti.ladar.extent import RangeExtent, bin_centres, no_return, range_extent
from ncti.ladar.frames import cumulative_average, frame_blocks, sample_frames
from ncti.ladar.moments import banded_frame_moments, frame_moments
from ncti.ladar.places import spread_place
from ncti.ladar.pulse import noise_floor
from ncti.ladar.tolerance import extent_within, lines_within

__all__ = [
    "Beam",
    "RangeExtent",
    "banded_frame_moments",
    "bin_centres",
    "carrier_to_noise",
    "cumulative_average",
    "expected_profile",
    "extent_within",
    "frame_blocks",
    "frame_moments",
    "lines_within",
    "no_return",
    "noise_floor",
    "power_ratio",
    "range_extent",
    "sample_frames",
    "spread_place",
]
