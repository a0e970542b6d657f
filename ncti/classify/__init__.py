"""Classifiers of profile vectors: scikit-learn estimators that see `(X, y)` and nothing else."""

from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork
from ncti.classify.baselines import CorrelationNeighbour
from ncti.classify.fusion import fit_sharpness, fuse, label_posterior
from ncti.classify.gain_annealed import GainAnnealedNetwork
from ncti.classify.likelihood import GaussianTemplates, lower_band
from ncti.classify.vigilance_sweep import Clustering, Similarities, cluster

__all__ = [
    "AdaptiveClusteringNetwork",
    "Clustering",
    "CorrelationNeighbour",
    "GainAnnealedNetwork",
    "GaussianTemplates",
    "Similarities",
    "cluster",
    "fit_sharpness",
    "fuse",
    "label_posterior",
    "lower_band",
]
