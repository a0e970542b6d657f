"""Classifiers of profile vectors: scikit-learn estimators that see `(X, y)` and nothing else."""

from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork
from ncti.classify.gain_annealed import GainAnnealedNetwork
from ncti.classify.vigilance_sweep import Clustering, Similarities, cluster

__all__ = [
    "AdaptiveClusteringNetwork",
    "Clustering",
    "GainAnnealedNetwork",
    "Similarities",
    "cluster",
]
