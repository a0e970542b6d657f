"""Classifiers of feature vectors, as scikit-learn estimators, and fusion of their scores."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork
    from ncti.classify.baselines import CorrelationNeighbour
    from ncti.classify.clustering import Clustering, Similarities, cluster
    from ncti.classify.fusion import fuse, label_posterior
    from ncti.classify.gain_annealed import GainAnnealedNetwork
    from ncti.classify.likelihood import GaussianTemplates
    from ncti.classify.track import aspect_prior

__all__ = [
    "AdaptiveClusteringNetwork",
    "Clustering",
    "CorrelationNeighbour",
    "GainAnnealedNetwork",
    "GaussianTemplates",
    "Similarities",
    "aspect_prior",
    "cluster",
    "fuse",
    "label_posterior",
]

_DEFINED_IN = {
    "AdaptiveClusteringNetwork": "adaptive_clustering",
    "Clustering": "clustering",
    "CorrelationNeighbour": "baselines",
    "GainAnnealedNetwork": "gain_annealed",
    "GaussianTemplates": "likelihood",
    "Similarities": "clustering",
    "aspect_prior": "track",
    "cluster": "clustering",
    "fuse": "fusion",
    "label_posterior": "fusion",
}


def __getattr__(name: str) -> Any:
    if name not in _DEFINED_IN:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_DEFINED_IN[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
