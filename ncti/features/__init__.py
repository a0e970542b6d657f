"""Features: profile vectors, silhouettes and their log-polar maps, as input of classifiers.

Also distances between ships, measured by their profile vectors.
"""

from ncti.features.distance import ship_distance, sister
from ncti.features.log_polar import cyclic_similarity, log_polar
from ncti.features.map_vector import map_vector, silhouette_map
from ncti.features.profile import profile_vector
from ncti.features.segmentation import segment

__all__ = [
    "cyclic_similarity",
    "log_polar",
    "map_vector",
    "profile_vector",
    "segment",
    "ship_distance",
    "silhouette_map",
    "sister",
]
