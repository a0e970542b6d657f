"""Data sets of simulated signatures, for training and comparing classifiers."""

from ncti.data.rows import dataset
from ncti.data.vectors import to_numpy

__all__ = ["dataset", "to_numpy"]
