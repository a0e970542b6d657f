"""Settings fitted to some of the article's tables, and judged by the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ncti.article import Figure
from studies.reproduction.agreement import (
    Posterior,
    Reach,
    binomial_variance,
    chi_square,
    measure_reach,
    posterior_weights,
)
from studies.reproduction.assumptions import PRIORS

FITS: dict[str, tuple[int, ...]] = {
    "none": (),
    "2, 3": (2, 3),
    "4, 5": (4, 5),
    "2, 3, 5": (2, 3, 5),
    "all": (2, 3, 4, 5),
}
"""Tables of the article that settings are fitted to, by name; `none` is the prior."""

EFFECTIVE = 50.0
"""Least effective number of settings of a posterior."""

CATEGORY_SIGMA = 1.0
"""Standard deviation of a number of categories, in addition to that over orders of presentation."""

SIGN_CORRELATION_SHARE = 0.75
"""Correlation of the answers to two averages, relative to that of the signs of the averages."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Agreement:
    """Simulated figures of many settings, compared with those of the article's Tables 2 to 5.

    `mean` and `spread` (setting, figure) are the mean over `draws` and the standard deviation of
    one draw; `value` (setting, parameter) holds the numbers that stand for the values of `PRIORS`.
    """

    figures: tuple[Figure, ...]
    mean: Floats
    spread: Floats
    value: Floats
    draws: int

    @cached_property
    def article(self) -> Floats:
        """The article's figures, (figure,)."""
        return np.array([figure.value for figure in self.figures])

    @cached_property
    def variance(self) -> Floats:
        """Variances (setting, figure) of the article's figures about each setting's.

        Percentages have the binomial variance for the article's number of views. Numbers of
        categories have the variance over orders of presentation plus that of one category. The
        variance of the simulated mean is added to both.
        """
        trials = np.array([figure.trials for figure in self.figures])
        share = trials > 0
        variance: Floats = self.spread**2 + CATEGORY_SIGMA**2
        variance[:, share] = binomial_variance(self.mean[:, share], trials[share])
        return variance + self.spread**2 / self.draws

    @cached_property
    def correlation(self) -> Floats:
        """Correlation of figures, (figure, figure), of averages that share their first frames.

        Averages over n and N of the same frames correlate by sqrt(n / N), and their signs by 2
        asin(sqrt(n / N)) / pi. Figures of several ships and thresholds have some 0.75 of that,
        0.38, 0.25 and 0.17 for N / n = 2, 4 and 8; 60 draws of six settings gave 0.35 to 0.41, 0.22
        to 0.24 and 0.15 to 0.20 with both networks.
        """
        frames = np.array([figure.frames for figure in self.figures])
        columns = [(figure.table, figure.name.rpartition(", ")[2]) for figure in self.figures]
        same_column = np.array([[column == other for other in columns] for column in columns])
        same_column &= np.minimum.outer(frames, frames) > 0
        most = np.maximum.outer(frames, frames)
        ratio = np.minimum.outer(frames, frames) / np.maximum(most, 1)
        correlation: Floats = np.where(
            same_column, SIGN_CORRELATION_SHARE * 2 / np.pi * np.arcsin(np.sqrt(ratio)), 0.0
        )
        np.fill_diagonal(correlation, 1.0)
        return correlation

    def table_mask(self, tables: Sequence[int]) -> NDArray[np.bool_]:
        """Return the mask (figure,) of some tables' figures."""
        return np.isin([figure.table for figure in self.figures], tables)

    def distance(self, tables: Sequence[int]) -> Floats:
        """Return the (setting,) chi-square of the figures of some tables; 0 of none."""
        mask = self.table_mask(tables)
        correlation = self.correlation[np.ix_(mask, mask)]
        return chi_square(
            *(self.mean[:, mask], self.article[mask], self.variance[:, mask]),
            correlation=correlation,
        )

    @cached_property
    def fits(self) -> dict[str, Posterior]:
        """Posteriors by `FITS`, of `EFFECTIVE` settings or more (half of them all, if fewer)."""
        effective = max(min(EFFECTIVE, len(self.mean) / 2), 1)
        return {
            name: posterior_weights(self.distance(tables), effective=effective)
            for name, tables in FITS.items()
        }

    @cached_property
    def reach(self) -> Reach:
        """Range of each figure, and the share of settings that agree with the article's."""
        return measure_reach(self.mean, self.article, self.variance)

    def information(self, posterior: Posterior) -> Floats:
        """Return the information (parameter,) of a posterior on each parameter [bit].

        It is the relative entropy to the settings that were drawn, over words, or equally probable
        classes of numbers. By chance it is (classes - 1) / (2 n ln 2) for n effective settings.
        """
        bits = []
        for prior, column in zip(PRIORS.values(), self.value.T, strict=True):
            classes = prior.classes(column)
            share, drawn = np.bincount(classes, posterior.weight), np.bincount(classes)
            probable = share > 0
            odds = share[probable] / drawn[probable] * len(classes)
            bits.append(float(share[probable] @ np.log2(odds)))
        return np.array(bits)
