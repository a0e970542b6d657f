"""Scores of classifiers by aspect bin, with confidence intervals, and category formation."""

from ncti.evaluate.categories import CategoryFormation, category_formation
from ncti.evaluate.replicates import replicated_accuracy
from ncti.evaluate.scores import AspectAccuracy, accuracy_by_aspect, aspect_bins, wilson_interval

__all__ = [
    "AspectAccuracy",
    "CategoryFormation",
    "accuracy_by_aspect",
    "aspect_bins",
    "category_formation",
    "replicated_accuracy",
    "wilson_interval",
]
