"""Data sets of simulated signatures, for training and comparing classifiers."""

from ncti.data.rows import dataset
from ncti.data.stored import load_xy, open_rows
from ncti.data.vectors import to_numpy

__all__ = ["dataset", "load_xy", "open_rows", "to_numpy"]
