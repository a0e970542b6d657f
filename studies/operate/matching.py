"""Evidence for templates and ships, of what is measured with Gaussian noise and unknown gain."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all

Singles = NDArray[np.float32]
Densities = tuple[Singles, Singles]

LEAST_DENSITY = np.float32(1e-30)
"""Density of a template over that of the best of its ship that a sensor allows at least."""

STEP = 0.5**0.5  # between the inverse temperatures tried


def log_evidence(product: ArrayLike, energy: ArrayLike, *, gain_sigma: float = 1.0) -> Singles:
    """Return the log density of measurements under templates of unknown gain.

    Parameters
    ----------
    product : (sample, template) array_like
        Scalar product of each measurement and each template, both whitened.
    energy : (template,) array_like
        Squared length of each whitened template.
    gain_sigma : float
        Prior standard deviation of the gain about 1; 0 if it is known.

    Returns
    -------
    (sample, template) float32 ndarray
        Natural logarithm, up to a constant for each sample.

    Raises
    ------
    ValueError
        If an energy or the deviation is negative, or a number is not finite.

    See Also
    --------
    ship_evidence : Evidence for ships, each of several templates.
    ncti.classify.GaussianTemplates : Templates with a covariance of their own each.

    Notes
    -----
    A measurement x = g s + n with white unit noise n and g ~ N(1, sigma^2) has the covariance
    1 + sigma^2 s s', so that up to a term of x alone

        2 log p = [2 (x.s) - (s.s) + sigma^2 (x.s)^2] / (1 + sigma^2 s.s) - log(1 + sigma^2 s.s).

    Examples
    --------
    Half of a template is as good as the template itself where the gain is unknown, and less so
    where it is known; a measurement across the template is evidence against it:

    >>> from studies.operate import log_evidence
    >>> x_s, s_s = [[100.0], [50.0], [0.0]], [100.0]
    >>> log_evidence(x_s, s_s, gain_sigma=0.0).ravel().round(1).tolist()
    [50.0, 0.0, -50.0]
    >>> log_evidence(x_s, s_s, gain_sigma=10.0).ravel().round(1).tolist()
    [45.4, 7.9, -4.6]
    """
    x_s = np.asarray(product, dtype=np.float32)
    s_s = require_all("energy", energy, minimum=0.0)
    require("gain_sigma", gain_sigma, minimum=0.0)
    spread = 1.0 + gain_sigma**2 * s_s
    linear = (1.0 / spread).astype(np.float32)
    square = (0.5 * gain_sigma**2 / spread).astype(np.float32)
    constant = (-0.5 * s_s / spread - 0.5 * np.log(spread)).astype(np.float32)
    evidence: Singles = x_s * square
    evidence += linear
    evidence *= x_s
    evidence += constant
    return evidence


def relative_densities(evidence: NDArray[np.floating], ships: int) -> Densities:
    """Return the density of measurements under templates, relative to the best of each ship.

    Parameters
    ----------
    evidence : (sample, template) ndarray
        Log density under each template, those of a ship in a row, as many for each.
    ships : int
        Number of ships.

    Returns
    -------
    best : (sample, ship) float32 ndarray
        Largest log density among the templates of each ship.
    density : (sample, ship, template) float32 ndarray
        Densities over the exponential of it, 1 at most.

    Raises
    ------
    ValueError
        If the number of templates is no multiple of the number of ships.

    See Also
    --------
    joint_evidence : Takes those of several sensors.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.operate.matching import relative_densities
    >>> relative_densities(np.log([[0.5, 0.1, 0.2, 0.2]]), 2)[1].round(2).tolist()
    [[[1.0, 0.20000000298023224], [1.0, 1.0]]]
    """
    samples, templates = evidence.shape
    if ships < 1 or templates % ships:
        raise ValueError(f"ships is {ships}, but must divide the number of templates, {templates}")
    each = np.asarray(evidence, dtype=np.float32).reshape(samples, ships, -1)
    best = each.max(axis=2)
    density = each - best[:, :, None]
    np.exp(density, out=density)
    return best, density


def ship_evidence(evidence: NDArray[np.floating], ships: int) -> Singles:
    """Return the log density of measurements under ships, each the mean over its templates.

    Parameters
    ----------
    evidence : (sample, template) ndarray
        Log density under each template, those of a ship in a row, as many for each.
    ships : int
        Number of ships.

    Returns
    -------
    (sample, ship) float32 ndarray
        Natural logarithm.

    Raises
    ------
    ValueError
        If the number of templates is no multiple of the number of ships.

    See Also
    --------
    log_evidence : The evidence for templates.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.operate import ship_evidence
    >>> np.exp(ship_evidence(np.log([[0.5, 0.1, 0.2, 0.2]]), 2)).round(2).tolist()
    [[0.30000001192092896, 0.20000000298023224]]
    """
    return joint_evidence(relative_densities(evidence, ships))


def over_places(density: Singles, places: int) -> Singles:
    """Return the mean density under neighbouring templates, which have all places on the IFOVs.

    Parameters
    ----------
    density : (sample, ship, template) float32 ndarray
        As of `relative_densities`, in the order of aspects, with the places in turn.
    places : int
        Number of places.

    Returns
    -------
    (sample, ship, template) float32 ndarray
        Means over as many templates in a row as there are places: over the two such runs that are
        centred best on each template, and over the first or the last run at the ends. At least
        1e-30.

    See Also
    --------
    joint_evidence : Takes them.

    Notes
    -----
    A template has one place only. If another sensor has found the aspect, few templates remain, and
    where a silhouette depends on the place more than on a step in aspect, those of the right ship
    may all be unlike it.

    Examples
    --------
    Two places in turn. The view is like the fourth template, and its aspect that of the third:

    >>> import numpy as np
    >>> from studies.operate.matching import over_places
    >>> over_places(np.array([[[0, 0, 0, 1, 0, 0]]], dtype=np.float32), 2).round(2).tolist()
    [[[0.0, 0.0, 0.25, 0.5, 0.25, 0.0]]]
    """
    rows = np.maximum(density, LEAST_DENSITY).reshape(-1, density.shape[2])
    return (rows @ _runs(density.shape[2], places)).reshape(density.shape)


@lru_cache(maxsize=8)
def _runs(templates: int, places: int) -> Singles:
    """Return the weights of means over places, (template, template), those of one in a column."""
    length = min(places, templates)
    column = np.arange(templates)
    weights = np.zeros((templates, templates), np.float32)
    for before in (length // 2, (length - 1) // 2):
        first = np.clip(column - before, 0, templates - length)
        for k in range(length):
            weights[first + k, column] += np.float32(0.5 / length)
    return weights


def joint_evidence(*sensors: Densities) -> Singles:
    """Return the log density of the measurements of several sensors under ships.

    Parameters
    ----------
    *sensors : tuple
        `relative_densities` of each sensor, of the same templates.

    Returns
    -------
    (sample, ship) float32 ndarray
        Natural logarithm of the mean over the templates of a ship, since all sensors see one view.

    See Also
    --------
    ship_evidence : That of one sensor.

    Examples
    --------
    Each sensor is sure of an aspect of the first ship, but not of the same one:

    >>> import numpy as np
    >>> from studies.operate.matching import joint_evidence, relative_densities
    >>> profile, silhouette = np.log([[0.9, 0.1, 0.6, 0.1]]), np.log([[0.1, 0.9, 0.6, 0.1]])
    >>> both = joint_evidence(relative_densities(profile, 2), relative_densities(silhouette, 2))
    >>> np.exp(both).round(3).tolist()
    [[0.09000000357627869, 0.1850000023841858]]
    """
    best = np.sum([best for best, _ in sensors], axis=0)
    densities = [density for _, density in sensors]
    joint = np.einsum(",".join(["sft"] * len(densities)) + "->sf", *densities)
    return np.asarray(best + np.log(joint / np.float32(densities[0].shape[2])), dtype=np.float32)


def fit_inverse_temperature(
    evidence: Singles, ships: int, truth: ArrayLike, *, least: float
) -> float:
    """Return the factor of log densities, at most 1, of the least log loss.

    Parameters
    ----------
    evidence : (sample, template) float32 ndarray
        Log density under each template, of views that are neither learned nor tested.
    ships : int
        Number of ships.
    truth : (sample,) array_like of int
        Number of the ship of each view.
    least : float
        Least factor that can be right.

    Returns
    -------
    float
        A power of sqrt(1/2): from 1 down to the first minimum, since the noise of the sensor is
        known and errors of templates add to it.

    See Also
    --------
    ncti.classify.calibration.fit_temperature_and_outliers : The same for any scores.

    Examples
    --------
    Each measurement is counted four times:

    >>> import numpy as np
    >>> from studies.operate.matching import fit_inverse_temperature
    >>> rng = np.random.default_rng(0)
    >>> truth = rng.integers(2, size=4000)
    >>> seen = truth + rng.standard_normal(4000)
    >>> logs = -np.square(seen[:, None] - np.arange(2)) / 2
    >>> round(fit_inverse_temperature((4 * logs).astype(np.float32), 2, truth, least=0.01), 2)
    0.25
    """
    own = np.arange(len(evidence)), np.asarray(truth)

    def loss(factor: float) -> float:
        of_ships = ship_evidence(evidence * np.float32(factor), ships).astype(np.float64)
        return float((np.logaddexp.reduce(of_ships, axis=1) - of_ships[own]).mean())

    factor, now = 1.0, loss(1.0)
    while factor * STEP >= least and (lower := loss(factor * STEP)) < now:
        factor, now = factor * STEP, lower
    return factor
