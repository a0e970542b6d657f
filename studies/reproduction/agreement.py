"""Agreement of simulated figures with given ones, and the posterior of their settings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

MIN_TEMPERATURE, MAX_TEMPERATURE = 1.0, 1e12  # temperatures of `posterior_weights`
HALVINGS = 100  # of the interval in which a temperature is sought
LEVEL = 2.0  # standard deviations within which figures agree


def binomial_variance(percent: ArrayLike, trials: ArrayLike) -> Floats:
    """Return the variance (...) [points squared] of percentages (...) of numbers of trials (...).

    It is p (1 - p) / n, with p by Laplace's rule of succession, (n p + 1) / (n + 2): an expectation
    of 0 or 100 %, which is itself simulated, does not exclude anything else.
    """
    share, count = np.asarray(percent) / 100.0, np.asarray(trials, dtype=np.float64)
    smoothed = (count * share + 1.0) / (count + 2.0)
    variance: Floats = 1e4 * smoothed * (1.0 - smoothed) / count
    return variance


def chi_square(
    simulated: Floats, given: Floats, variance: Floats, *, correlation: Floats | None = None
) -> Floats:
    """Return the squared distance (...) of figures (..., figure) to given ones, in variances.

    It is z C^-1 z with z = (simulated - given) / sqrt(variance) and the `correlation` C (figure,
    figure) of these differences: without it the sum of squares.
    """
    off = (simulated - given) / np.sqrt(variance)
    if correlation is not None:
        off = np.linalg.solve(np.linalg.cholesky(correlation), off[..., None])[..., 0]
    squares: Floats = (off**2).sum(axis=-1)
    return squares


@dataclass(frozen=True, eq=False)
class Posterior:
    """Weights (setting,), of sum 1; `temperature` is the factor by which variances were widened."""

    weight: Floats
    temperature: float

    @property
    def effective(self) -> float:
        """Effective number of settings, 1 / sum of squared weights (Kish)."""
        return float(1.0 / (self.weight**2).sum())

    def mean(self, values: ArrayLike) -> Floats:
        """Return the weighted mean of (setting, ...) values."""
        mean: Floats = np.tensordot(self.weight, np.asarray(values, dtype=np.float64), axes=1)
        return mean

    def quantiles(self, values: ArrayLike, shares: ArrayLike) -> Floats:
        """Return (share, ...) weighted quantiles of (setting, ...) values."""
        samples = np.asarray(values, dtype=np.float64)
        weights = np.broadcast_to(
            self.weight.reshape(-1, *(1,) * (samples.ndim - 1)), samples.shape
        )
        probabilities = np.asarray(shares, dtype=np.float64)
        quantiles: Floats = np.quantile(
            samples, probabilities, axis=0, weights=weights, method="inverted_cdf"
        )
        return quantiles


def posterior_weights(chi_square: Floats, *, effective: float = 1.0) -> Posterior:
    """Return the posterior weights of settings that were drawn from their prior.

    Weights are proportional to exp(-chi^2 / (2 T)) of the distances (setting,). The temperature T
    is 1 if the effective number of settings is then at least `effective`, and otherwise the lowest
    that reaches it.

    This is importance sampling from the prior with a Gaussian likelihood of the figures,
    approximate Bayesian computation with a Gaussian kernel (R. D. Wilkinson, Statistical
    Applications in Genetics and Molecular Biology 12, 129-141 (2013),
    doi:10.1515/sagmb-2013-0010). A temperature above 1 widens all variances by that factor: either
    the model is wrong by more than they say, or the settings are too few to resolve the posterior,
    which is then too wide.
    """
    excess = chi_square - chi_square.min()

    def posterior_at(temperature: float) -> Posterior:
        weight = np.exp(-excess / (2.0 * temperature))
        return Posterior(weight / weight.sum(), temperature)

    # The effective number rises with the temperature: bisection of its logarithm.
    low, high = MIN_TEMPERATURE, MAX_TEMPERATURE
    if posterior_at(low).effective >= effective:
        return posterior_at(low)
    for _ in range(HALVINGS):
        middle = (low * high) ** 0.5
        low, high = (low, middle) if posterior_at(middle).effective >= effective else (middle, high)
    return posterior_at(high)


@dataclass(frozen=True, eq=False)
class Reach:
    """Range of each figure over settings, and its agreement with a given one.

    `low` and `high` (figure,) are the least and largest simulated figure, `share` (figure,) that of
    settings that agree with the given one, `nearest` (figure,) the least distance of a setting to
    it [standard deviations], and `together` (setting,) how many figures each setting agrees with.
    """

    low: Floats
    high: Floats
    share: Floats
    nearest: Floats
    together: NDArray[np.intp]


def measure_reach(simulated: Floats, given: Floats, variance: Floats) -> Reach:
    """Return the range of each figure over settings, and its agreement with the given (figure,).

    `simulated` and `variance` (setting, figure) are as of `chi_square`.
    """
    deviation = np.abs(simulated - given) / variance**0.5
    agrees = deviation <= LEVEL
    ends = simulated.min(axis=0), simulated.max(axis=0)
    return Reach(*ends, agrees.mean(axis=0), deviation.min(axis=0), agrees.sum(axis=1))
