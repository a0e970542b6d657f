"""Scores of classifiers by aspect bin, with confidence intervals, and category formation."""

from ncti.evaluate.agreement import (
    Posterior,
    Reach,
    binomial_variance,
    chi_square,
    posterior_weights,
    reached,
)
from ncti.evaluate.answers import tabulate_categories, tabulate_scores
from ncti.evaluate.categories import CategoryFormation, category_formation
from ncti.evaluate.comparison import Comparison, compare
from ncti.evaluate.learning import LearningCurve, learning_curve
from ncti.evaluate.open_set import OpenSetScores, open_set_scores, rejection_thresholds
from ncti.evaluate.rejection import tabulate_rejection
from ncti.evaluate.replicates import grouped_accuracy, paired_difference, replicated_accuracy
from ncti.evaluate.rows import Reliability, Scores, score
from ncti.evaluate.scores import AspectAccuracy, accuracy_by_aspect, aspect_bins, wilson_interval
from ncti.evaluate.sufficiency import cheapest, crossing, isotonic
from ncti.evaluate.summary import tabulate_differences, tabulate_rows

__all__ = [
    "AspectAccuracy",
    "CategoryFormation",
    "Comparison",
    "LearningCurve",
    "OpenSetScores",
    "Posterior",
    "Reach",
    "Reliability",
    "Scores",
    "accuracy_by_aspect",
    "aspect_bins",
    "binomial_variance",
    "category_formation",
    "cheapest",
    "chi_square",
    "compare",
    "crossing",
    "grouped_accuracy",
    "isotonic",
    "learning_curve",
    "open_set_scores",
    "paired_difference",
    "posterior_weights",
    "reached",
    "rejection_thresholds",
    "replicated_accuracy",
    "score",
    "tabulate_categories",
    "tabulate_differences",
    "tabulate_rejection",
    "tabulate_rows",
    "tabulate_scores",
    "wilson_interval",
]
