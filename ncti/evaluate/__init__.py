"""Scores of classifiers by aspect bin, with confidence intervals, and category formation."""

from ncti.evaluate.answers import tabulate_categories, tabulate_scores
from ncti.evaluate.categories import CategoryFormation, category_formation
from ncti.evaluate.comparison import Comparison, compare
from ncti.evaluate.learning import LearningCurve, learning_curve
from ncti.evaluate.open_set import OpenSetScores, open_set_scores, rejection_thresholds
from ncti.evaluate.rejection import tabulate_rejection
from ncti.evaluate.replicates import grouped_accuracy, paired_difference, replicated_accuracy
from ncti.evaluate.rows import Reliability, Scores, score
from ncti.evaluate.scores import AspectAccuracy, accuracy_by_aspect, aspect_bins, wilson_interval

__all__ = [
    "AspectAccuracy",
    "CategoryFormation",
    "Comparison",
    "LearningCurve",
    "OpenSetScores",
    "Reliability",
    "Scores",
    "accuracy_by_aspect",
    "aspect_bins",
    "category_formation",
    "compare",
    "grouped_accuracy",
    "learning_curve",
    "open_set_scores",
    "paired_difference",
    "rejection_thresholds",
    "replicated_accuracy",
    "score",
    "tabulate_categories",
    "tabulate_rejection",
    "tabulate_scores",
    "wilson_interval",
]
