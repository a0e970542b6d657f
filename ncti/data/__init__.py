"""Data sets of simulated signatures, for training and comparing classifiers."""

from ncti.data.card import card, save
from ncti.data.moments import moments
from ncti.data.rows import dataset
from ncti.data.splits import SPLITS, Split, split
from ncti.data.stored import load_xy, open_rows
from ncti.data.vectors import to_numpy

__all__ = [
    "SPLITS",
    "Split",
    "card",
    "dataset",
    "load_xy",
    "moments",
    "open_rows",
    "save",
    "split",
    "to_numpy",
]
