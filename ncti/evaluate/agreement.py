"""Agreement of simulated figures with given ones, and the posterior of their settings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_shape

Floats = NDArray[np.float64]

COOLEST, HOTTEST = 1.0, 1e12  # temperatures of `posterior_weights`
HALVINGS = 100  # of the interval in which a temperature is sought


def binomial_variance(percent: ArrayLike, trials: ArrayLike) -> Floats:
    """Return the variance of a percentage of trials, from its expectation.

    Parameters
    ----------
    percent : (...) array_like
        Expected percentages.
    trials : (...) array_like
        Numbers of trials, at least 1.

    Returns
    -------
    (...) float64 ndarray
        p (1 - p) / n [points squared], with p by Laplace's rule of succession, (n p + 1) / (n + 2):
        an expectation of 0 or 100 %, which is itself simulated, does not exclude anything else.

    Raises
    ------
    ValueError
        If a percentage is not within 0 and 100, or a number of trials below 1.

    See Also
    --------
    chi_square : Distances in such variances.

    Examples
    --------
    Half of 100 views are uncertain by five points, and all of them by one:

    >>> from ncti.evaluate import binomial_variance
    >>> (binomial_variance([50, 100], 100) ** 0.5).round(1)
    array([5., 1.])
    """
    share = require_all("percent", percent, minimum=0.0, maximum=100.0) / 100.0
    count = require_all("trials", trials, minimum=1.0)
    smoothed = (count * share + 1.0) / (count + 2.0)
    variance: Floats = 1e4 * smoothed * (1.0 - smoothed) / count
    return variance


def chi_square(
    simulated: ArrayLike,
    given: ArrayLike,
    variance: ArrayLike,
    *,
    correlation: ArrayLike | None = None,
) -> Floats:
    """Return the squared distance of simulated figures to given ones, in variances.

    Parameters
    ----------
    simulated : (..., figure) array_like
        Simulated figures.
    given : (figure,) array_like
        Given figures.
    variance : (..., figure) array_like
        Variances of their differences, above 0: of the given figure about its expectation, and of
        the simulated mean.
    correlation : (figure, figure) array_like, optional
        Correlation of their differences; none when not given.

    Returns
    -------
    (...) float64 ndarray
        z C^-1 z with z = (simulated - given) / sqrt(variance): the sum of squares of independent
        figures.

    Raises
    ------
    ValueError
        If a number is not finite, a variance not positive, or the correlation not positive
        definite.

    See Also
    --------
    posterior_weights : Weights of settings by this distance.

    Examples
    --------
    >>> from ncti.evaluate import chi_square
    >>> chi_square([[50, 60], [55, 70]], [50, 70], [25, 25]).tolist()
    [4.0, 1.0]

    Two figures that are too high count for less if they vary together:

    >>> chi_square([60, 60], [50, 50], [25, 25], correlation=[[1.0, 0.6], [0.6, 1.0]]).round(1)
    np.float64(5.0)
    """
    apart = require_all("simulated", simulated) - require_all("given", given)
    off = apart / np.sqrt(require_all("variance", variance, positive=True))
    if correlation is not None:
        try:
            root = np.linalg.cholesky(require_all("correlation", correlation))
        except np.linalg.LinAlgError as error:
            raise ValueError("correlation is a matrix that is not positive definite") from error
        off = np.linalg.solve(root, off[..., None])[..., 0]
    squares: Floats = (off**2).sum(axis=-1)
    return squares


@dataclass(frozen=True, eq=False)
class Posterior:
    """Weights of settings.

    Attributes
    ----------
    weight : (setting,) float64 ndarray
        Weights, of sum 1.
    temperature : float
        Factor by which all variances were widened, at least 1.

    See Also
    --------
    posterior_weights : Returns it.

    Examples
    --------
    >>> import numpy as np
    >>> from ncti.evaluate import Posterior
    >>> Posterior(np.array([0.5, 0.5, 0.0]), 1.0).effective
    2.0
    """

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
        several = np.asarray(values, dtype=np.float64)
        weights = np.broadcast_to(
            self.weight.reshape(-1, *(1,) * (several.ndim - 1)), several.shape
        )
        at = np.asarray(shares, dtype=np.float64)
        quantiles: Floats = np.quantile(several, at, axis=0, weights=weights, method="inverted_cdf")
        return quantiles


def posterior_weights(chi_square: ArrayLike, *, effective: float = 1.0) -> Posterior:
    """Return the posterior weights of settings that were drawn from their prior.

    Parameters
    ----------
    chi_square : (setting,) array_like
        Distances of `chi_square` to the given figures.
    effective : float
        Least effective number of settings, from 1 to their number.

    Returns
    -------
    Posterior
        Weights proportional to exp(-chi^2 / (2 T)). The temperature T is 1 if that leaves at least
        the effective number of settings, and otherwise as high as it takes.

    Raises
    ------
    ValueError
        If a distance is negative or not finite, or the number out of range.

    See Also
    --------
    chi_square : The distance.
    reached : Figures that no setting reaches.

    Notes
    -----
    Importance sampling from the prior with a Gaussian likelihood of the figures, approximate
    Bayesian computation with a Gaussian kernel [1]_. A temperature above 1 widens all variances by
    that factor: either the model is wrong by more than they say, or the settings are too few to
    resolve the posterior, which is then too wide.

    References
    ----------
    .. [1] R. D. Wilkinson, "Approximate Bayesian computation (ABC) gives exact results under the
       assumption of model error", Statistical Applications in Genetics and Molecular Biology 12,
       129-141 (2013), doi:10.1515/sagmb-2013-0010.

    Examples
    --------
    Simulated figures equal to a parameter, uniform from -10 to 10, and a given one of 0 +- 1: the
    posterior is a normal distribution.

    >>> import numpy as np
    >>> from ncti.evaluate import posterior_weights
    >>> parameter = np.linspace(-10, 10, 2001)
    >>> posterior = posterior_weights(parameter**2)
    >>> posterior.quantiles(parameter, [0.159, 0.5, 0.841]).round(2)
    array([-1.,  0.,  1.])
    """
    distance = require_all("chi_square", chi_square, minimum=0.0)
    if distance.ndim != 1 or not distance.size:
        raise ValueError(f"chi_square has shape {distance.shape}, but must be (setting,)")
    require("effective", effective, minimum=1.0, maximum=distance.size)
    excess = distance - distance.min()

    def at(temperature: float) -> Posterior:
        weight = np.exp(-excess / (2.0 * temperature))
        return Posterior(weight / weight.sum(), temperature)

    # The effective number rises with the temperature: bisection of its logarithm.
    low, high = COOLEST, HOTTEST
    if at(low).effective >= effective:
        return at(low)
    for _ in range(HALVINGS):
        middle = (low * high) ** 0.5
        low, high = (low, middle) if at(middle).effective >= effective else (middle, high)
    return at(high)


@dataclass(frozen=True, eq=False)
class Reach:
    """Range of each figure over settings, and its agreement with a given one.

    Attributes
    ----------
    low, high : (figure,) float64 ndarray
        Least and largest simulated figure.
    share : (figure,) float64 ndarray
        Share of settings that agree with the given figure.
    nearest : (figure,) float64 ndarray
        Least distance of a setting to it [standard deviations].
    together : (setting,) intp ndarray
        Number of figures that each setting agrees with.

    See Also
    --------
    reached : Returns it.

    Examples
    --------
    >>> from ncti.evaluate import reached
    >>> reached([[10.0], [30.0]], [25.0], [[25.0], [25.0]]).high.tolist()
    [30.0]
    """

    low: Floats
    high: Floats
    share: Floats
    nearest: Floats
    together: NDArray[np.intp]


def reached(
    simulated: ArrayLike, given: ArrayLike, variance: ArrayLike, *, level: float = 2.0
) -> Reach:
    """Return which given figures some setting agrees with.

    Parameters
    ----------
    simulated : (setting, figure) array_like
        Simulated figures.
    given : (figure,) array_like
        Given figures.
    variance : (setting, figure) array_like
        Variances of their differences, as of `chi_square`.
    level : float
        Standard deviations within which figures agree.

    Returns
    -------
    Reach
        A figure whose `share` is 0 is reached by no setting. Each figure is taken by itself, except
        in `together`.

    Raises
    ------
    ValueError
        If shapes do not match, a number is not finite, or a variance or the level not positive.

    See Also
    --------
    posterior_weights : Settings that agree with all figures together.

    Examples
    --------
    >>> from ncti.evaluate import reached
    >>> reach = reached([[10.0, 50.0], [30.0, 60.0]], [25.0, 90.0], [[25.0, 25.0]] * 2)
    >>> reach.share.tolist(), reach.nearest.tolist()
    ([0.5, 0.0], [1.0, 6.0])
    """
    figures, fixed = require_all("simulated", simulated), require_all("given", given)
    if figures.ndim != 2 or not figures.size:
        raise ValueError(f"simulated has shape {figures.shape}, but must be (setting, figure)")
    require_shape("given", fixed, figures.shape[1:])
    spread = require_all("variance", variance, positive=True) ** 0.5
    require_shape("variance", spread, figures.shape)
    require("level", level, positive=True)
    apart = np.abs(figures - fixed) / spread
    agrees = apart <= level
    ends = figures.min(axis=0), figures.max(axis=0)
    return Reach(*ends, agrees.mean(axis=0), apart.min(axis=0), agrees.sum(axis=1))
