"""Figures of simulated tables: means over draws, and the variances of these means."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.evaluate import aspect_bins

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Simulated:
    """Figures of a table, as means over draws.

    Attributes
    ----------
    mean : (...) float64 ndarray
        Mean of each figure.
    spread : (...) float64 ndarray
        Standard deviation of a single draw.

    See Also
    --------
    reproduce : Returns such tables.

    Examples
    --------
    >>> from studies.reproduction import Simulated
    >>> scores = Simulated.of([[40.0, 60.0], [60.0, 60.0]])
    >>> scores.mean.tolist(), scores.spread.round(1).tolist()
    ([50.0, 60.0], [14.1, 0.0])
    """

    mean: Floats
    spread: Floats

    @classmethod
    def of(cls, draws: ArrayLike) -> Simulated:
        """Return the scores of (draw, ...) figures of at least two draws."""
        figures = np.asarray(draws, dtype=np.float64)
        return cls(figures.mean(axis=0), figures.std(axis=0, ddof=1))


def percent_by_bin(right: NDArray[np.bool_], aspect: Floats) -> Floats:
    """Return percent correct by aspect bin.

    Parameters
    ----------
    right : (..., view) bool ndarray
        True where an answer is right.
    aspect : (view,) float64 ndarray
        Aspects [deg].

    Returns
    -------
    (..., bin) float64 ndarray
        Percent correct in the bins of `ncti.evaluate.aspect_bins`.
    """
    labels, group = aspect_bins(aspect)
    member = group[:, None] == np.arange(len(labels))
    return 100.0 * (right.astype(np.float64) @ member) / member.sum(axis=0)
