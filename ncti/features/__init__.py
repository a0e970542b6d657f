"""Features: what a classifier is given of a signature."""

from ncti.features.profile import profile_vector

__all__ = ["profile_vector"]
