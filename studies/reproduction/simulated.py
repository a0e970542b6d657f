"""Figures of simulated tables: means over draws, and the variances of these means."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.evaluate import aspect_bins

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Simulated:
    """Figures of a table: `mean` over draws, and `spread`, the standard deviation of one draw."""

    mean: Floats
    spread: Floats

    @classmethod
    def of(cls, draws: ArrayLike) -> Simulated:
        """Return the mean and spread of (draw, ...) figures, for at least two draws."""
        figures = np.asarray(draws, dtype=np.float64)
        return cls(figures.mean(axis=0), figures.std(axis=0, ddof=1))


def percent_by_bin(right: NDArray[np.bool_], aspect: Floats) -> Floats:
    """Return (..., bin) percent correct in the bins of `ncti.evaluate.aspect_bins`.

    `right` (..., view) is true where an answer is right, at `aspect` (view,) [deg].
    """
    labels, group = aspect_bins(aspect)
    member = group[:, None] == np.arange(len(labels))
    return 100.0 * (right.astype(np.float64) @ member) / member.sum(axis=0)
