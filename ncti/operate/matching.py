"""Evidence for templates and ships, of what is measured with Gaussian noise and unknown gain."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all

Singles = NDArray[np.float32]


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

    >>> from ncti.operate import log_evidence
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
    >>> from ncti.operate import ship_evidence
    >>> np.exp(ship_evidence(np.log([[0.5, 0.1, 0.2, 0.2]]), 2)).round(2).tolist()
    [[0.30000001192092896, 0.20000000298023224]]
    """
    samples, templates = evidence.shape
    if ships < 1 or templates % ships:
        raise ValueError(f"ships is {ships}, but must divide the number of templates, {templates}")
    each = np.asarray(evidence, dtype=np.float32).reshape(samples, ships, -1)
    best = each.max(axis=2, keepdims=True)
    weights = each - best
    np.exp(weights, out=weights)
    return np.asarray(best[:, :, 0] + np.log(weights.mean(axis=2)), dtype=np.float32)
