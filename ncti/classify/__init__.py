"""Classifiers of profile vectors: scikit-learn estimators that see `(X, y)` and nothing else."""

from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork

__all__ = ["AdaptiveClusteringNetwork"]
