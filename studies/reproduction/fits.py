"""Settings fitted to some of the article's tables, and judged by the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ncti.article import Figure
from ncti.evaluate import (
    Posterior,
    Reach,
    binomial_variance,
    chi_square,
    posterior_weights,
    reached,
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

CATEGORY = 1.0
"""Standard deviation of a number of categories besides that over orders of presentation."""

SHARED = 0.75
"""Share of the correlation of the signs of two averages that the answers to them have."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Agreement:
    """Compare simulated figures of many settings with those of the article [1]_.

    Attributes
    ----------
    figures : tuple of Figure
        The article's figures.
    mean : (setting, figure) float64 ndarray
        Simulated figures, means over draws.
    spread : (setting, figure) float64 ndarray
        Standard deviations of a single draw.
    value : (setting, parameter) float64 ndarray
        Numbers of the values in `PRIORS`.
    draws : int
        Draws of which a figure is the mean.

    See Also
    --------
    reproduce : The figures of a setting.
    ncti.evaluate.posterior_weights : Weights of settings.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Tables 2 to 5.

    Examples
    --------
    Two settings, of which one has the article's figures:

    >>> import numpy as np
    >>> from ncti.article import figures
    >>> from studies.reproduction import PRIORS, Agreement
    >>> article = np.array([figure.value for figure in figures()])
    >>> mean, value = np.array([article, 0.8 * article]), np.zeros((2, len(PRIORS)))
    >>> agreement = Agreement(figures(), mean, np.zeros_like(mean), value, draws=4)
    >>> agreement.distance((2, 3)).round(0).tolist()
    [0.0, 80.0]
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
        """Variances of the article's figures about each setting's, (setting, figure).

        Of percentages the binomial variance of as many views as the article's, of numbers of
        categories that over orders of presentation and that of one category; and that of our mean.
        """
        trials = np.array([figure.trials for figure in self.figures])
        share = trials > 0
        variance: Floats = self.spread**2 + CATEGORY**2
        variance[:, share] = binomial_variance(self.mean[:, share], trials[share])
        return variance + self.spread**2 / self.draws

    @cached_property
    def correlation(self) -> Floats:
        """Correlation of figures, (figure, figure), of averages that share their first frames.

        Averages over n and N of the same frames have covariance var / N, so correlation
        sqrt(n / N), and their signs 2 asin(sqrt(n / N)) / pi. Figures of several ships and
        thresholds have some 0.75 of that: 0.38, 0.25 and 0.17 where N is 2, 4 and 8 times n. Of 60
        draws of each of six settings of `PRIORS` both networks had 0.35 to 0.41, 0.22 to 0.24, and
        0.15 to 0.20.
        """
        frames = np.array([figure.frames for figure in self.figures])
        columns = [(figure.table, figure.name.rpartition(", ")[2]) for figure in self.figures]
        alike = np.array([[one == other for other in columns] for one in columns])
        alike &= np.minimum.outer(frames, frames) > 0
        most = np.maximum.outer(frames, frames)
        ratio = np.minimum.outer(frames, frames) / np.maximum(most, 1)
        correlation: Floats = np.where(alike, SHARED * 2 / np.pi * np.arcsin(np.sqrt(ratio)), 0.0)
        np.fill_diagonal(correlation, 1.0)
        return correlation

    def of(self, tables: Sequence[int]) -> NDArray[np.bool_]:
        """Return the (figure,) mask of figures of some tables."""
        return np.isin([figure.table for figure in self.figures], tables)

    def distance(self, tables: Sequence[int]) -> Floats:
        """Return the (setting,) chi-square of the figures of some tables; 0 of none."""
        of = self.of(tables)
        correlation = self.correlation[np.ix_(of, of)]
        return chi_square(
            *(self.mean[:, of], self.article[of], self.variance[:, of]), correlation=correlation
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
        """Which figures some setting agrees with."""
        return reached(self.mean, self.article, self.variance)

    def information(self, posterior: Posterior) -> Floats:
        """Return how much a posterior says of each (parameter,) [bit].

        Its relative entropy to the settings that were drawn, over words, or equally probable
        classes of numbers. One that says nothing has, by chance, (classes - 1) / (2 n ln 2) for n
        effective settings.
        """
        bits = []
        for prior, column in zip(PRIORS.values(), self.value.T, strict=True):
            classes = prior.classes(column)
            share, drawn = np.bincount(classes, posterior.weight), np.bincount(classes)
            some = share > 0
            odds = share[some] / drawn[some] * len(classes)
            bits.append(float(share[some] @ np.log2(odds)))
        return np.array(bits)
