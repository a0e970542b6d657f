"""Features: what a classifier is given of a signature."""

from ncti.features.log_polar import cyclic_similarity, log_polar
from ncti.features.profile import estimated_floor, profile_vector
from ncti.features.segmentation import METHODS as SEGMENTATION_METHODS
from ncti.features.segmentation import segment

__all__ = [
    "SEGMENTATION_METHODS",
    "cyclic_similarity",
    "estimated_floor",
    "log_polar",
    "profile_vector",
    "segment",
]
