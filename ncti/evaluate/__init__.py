"""Scores: plain functions of truth and prediction arrays, with confidence intervals."""

from ncti.evaluate.categories import CategoryFormation, category_formation, compression
from ncti.evaluate.replicates import replicated_accuracy
from ncti.evaluate.scores import AspectAccuracy, accuracy_by_aspect, aspect_bins, wilson_interval

__all__ = [
    "AspectAccuracy",
    "CategoryFormation",
    "accuracy_by_aspect",
    "aspect_bins",
    "category_formation",
    "compression",
    "replicated_accuracy",
    "wilson_interval",
]
