"""Classifiers of profile vectors: scikit-learn estimators that see `(X, y)` and nothing else."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ncti.classify.adaptive_clustering import AdaptiveClusteringNetwork
    from ncti.classify.bands import lower_band
    from ncti.classify.baselines import CorrelationNeighbour
    from ncti.classify.calibration import fit_doubt
    from ncti.classify.fusion import (
        doubted,
        fit_sharpness,
        fuse,
        label_posterior,
        least_sharpness,
    )
    from ncti.classify.gain_annealed import GainAnnealedNetwork
    from ncti.classify.likelihood import GaussianTemplates
    from ncti.classify.vigilance_sweep import Clustering, Similarities, cluster

__all__ = [
    "AdaptiveClusteringNetwork",
    "Clustering",
    "CorrelationNeighbour",
    "GainAnnealedNetwork",
    "GaussianTemplates",
    "Similarities",
    "cluster",
    "doubted",
    "fit_doubt",
    "fit_sharpness",
    "fuse",
    "label_posterior",
    "least_sharpness",
    "lower_band",
]

_DEFINED_IN = {
    "AdaptiveClusteringNetwork": "adaptive_clustering",
    "Clustering": "vigilance_sweep",
    "CorrelationNeighbour": "baselines",
    "GainAnnealedNetwork": "gain_annealed",
    "GaussianTemplates": "likelihood",
    "Similarities": "vigilance_sweep",
    "cluster": "vigilance_sweep",
    "doubted": "fusion",
    "fit_doubt": "calibration",
    "fit_sharpness": "fusion",
    "fuse": "fusion",
    "label_posterior": "fusion",
    "least_sharpness": "fusion",
    "lower_band": "bands",
}


def __getattr__(name: str) -> Any:
    # Imported when it is first asked for: the estimators need scikit-learn, which takes a second.
    if name not in _DEFINED_IN:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_DEFINED_IN[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
