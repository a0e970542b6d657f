"""Evidence for templates and ships from measurements with Gaussian noise and unknown gain."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Singles = NDArray[np.float32]
Densities = tuple[Singles, Singles]

MIN_DENSITY = np.float32(1e-30)
"""Lower bound on the density of a template relative to the best template of its ship."""

STEP = 0.5**0.5  # between the inverse temperatures tried


def log_evidence(product: ArrayLike, energy: ArrayLike, *, gain_sigma: float = 1.0) -> Singles:
    """Return the (sample, template) log density of measurements under templates of unknown gain.

    `product` (sample, template) holds scalar products of whitened measurements and templates,
    `energy` (template,) the squared lengths of the templates. A measurement x = g s + n with unit
    white noise n and g ~ N(1, sigma^2) has the covariance 1 + sigma^2 s s', so that up to a term of
    x alone

        2 log p = [2 (x.s) - (s.s) + sigma^2 (x.s)^2] / (1 + sigma^2 s.s) - log(1 + sigma^2 s.s).
    """
    x_s = np.asarray(product, dtype=np.float32)
    s_s = np.asarray(energy, dtype=np.float64)
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
    """Return each ship's best log density (sample, ship), and densities relative to it.

    `evidence` (sample, template) holds log densities, equally many of each ship, ship by ship; the
    relative densities are (sample, ship, template), at most 1.
    """
    by_ship = np.asarray(evidence, dtype=np.float32).reshape(len(evidence), ships, -1)
    best = by_ship.max(axis=2)
    density = by_ship - best[:, :, None]
    np.exp(density, out=density)
    return best, density


def ship_evidence(evidence: NDArray[np.floating], ships: int) -> Singles:
    """Return the (sample, ship) log of the mean density over the templates of each ship.

    `evidence` (sample, template) holds log densities, equally many of each ship, ship by ship.
    """
    return joint_evidence(relative_densities(evidence, ships))


def over_places(density: Singles, places: int) -> Singles:
    """Return (sample, ship, template) densities averaged over neighbouring templates of all places.

    `density` is that of `relative_densities`, by aspect with the `places` on the IFOVs in turn.
    Each mean is over the two best-centred runs of `places` templates, or the only one at an end;
    densities below 1e-30 count as 1e-30. Each template has one place only: once another sensor has
    found the aspect, a silhouette that changes more with place than from one aspect to the next
    might match no template of its own ship.
    """
    rows = np.maximum(density, MIN_DENSITY).reshape(-1, density.shape[2])
    return (rows @ _place_weights(density.shape[2], places)).reshape(density.shape)


@lru_cache(maxsize=8)
def _place_weights(templates: int, places: int) -> Singles:
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
    """Return the (sample, ship) log density of the measurements of several sensors under ships.

    Each argument holds the `relative_densities` of one sensor under the same templates. All sensors
    see one view, so their densities multiply, and a ship has the mean over its templates.
    """
    best = np.sum([best for best, _ in sensors], axis=0)
    densities = [density for _, density in sensors]
    joint = np.einsum(",".join(["sft"] * len(densities)) + "->sf", *densities)
    return np.asarray(best + np.log(joint / np.float32(densities[0].shape[2])), dtype=np.float32)


def fit_inverse_temperature(
    evidence: Singles, ships: int, truth: ArrayLike, *, least: float
) -> float:
    """Return the factor of log densities, at most 1, with the least log loss.

    `evidence` (sample, template) is of views neither learned nor tested, `truth` (sample,) their
    ships. The search steps down from 1 by sqrt(1/2) to the first minimum, or to `least`: the
    sensor's noise is known, and errors of templates only add to it.
    """
    true_ship = np.arange(len(evidence)), np.asarray(truth)

    def loss(factor: float) -> float:
        of_ships = ship_evidence(evidence * np.float32(factor), ships).astype(np.float64)
        return float((np.logaddexp.reduce(of_ships, axis=1) - of_ships[true_ship]).mean())

    factor, current = 1.0, loss(1.0)
    while factor * STEP >= least and (lower := loss(factor * STEP)) < current:
        factor, current = factor * STEP, lower
    return factor
