"""Range profiles of many views: their expected values, noise, and match with templates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require, require_all, require_shape
from ncti.ladar.extent import REFERENCE_BIN
from ncti.ladar.moments import magnitude_covariance
from ncti.ladar.pulse import SPEED_OF_LIGHT, noise_by_lag, noise_covariance, target_response
from studies.operate.matching import log_evidence
from studies.operate.survey import Seen

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Places = NDArray[np.integer]

RAYLEIGH = 2 - math.pi / 2  # variance of a Rayleigh magnitude over that of a quadrature
LOADING = 1e-3  # variance of noise beyond the model, over the model's; as of `GaussianTemplates`
NEGLIGIBLE = 1e-5  # energy of a template in a direction, over the noise of an average
BETWEEN = 0.25
"""Covariance between templates, over that of second differences of neighbours."""


def signatures(
    seen: Seen,
    *,
    pulse_width: Sequence[float],
    cnr: Sequence[float],
    bin_width: float,
    bins: int,
    learned: int,
) -> dict[str, NDArray[Any]]:
    """Return expected range profiles above the noise floor, and the power that reaches each bin.

    Parameters
    ----------
    seen : Seen
        What IFOVs see of a ship, in the views learned and then in others.
    pulse_width : (pulse,) sequence of float
        1/e^2 pulse widths [s].
    cnr : (cnr,) sequence of float
        Carrier-to-noise ratios of a filled IFOV, as power ratios.
    bin_width : float
        Width of a range bin [m].
    bins : int
        Number of range bins.
    learned : int
        Number of views learned.

    Returns
    -------
    dict
        `excess`, (cnr, pulse, view, bin): `ncti.ladar.expected_profile` less the noise floor of
        every IFOV. `power`, (cnr, pulse, 1 + test, bin): power in a quadrature over the CNR, summed
        over IFOVs, first the mean of the views learned, then that of each other view. `ifovs`,
        (cnr, pulse, test): the number of IFOVs that see the ship in these.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    ProfileMatch : Identifies ships by them.

    Notes
    -----
    Equation C of the article: the mean magnitude of an IFOV is sqrt(pi/2 (CNR p + v)), p the
    power after the pulse and v the variance of its noise. Bins that no power reaches add
    nothing to the excess, so that only the others are computed. Of the pulse's response what is
    below exp(-16) of its peak in field, exp(-32) in power, is left out.

    Examples
    --------
    >>> import trimesh
    >>> from studies.operate import draw_views, seen_views, signatures
    >>> views = draw_views(trimesh.creation.box((4, 30, 30)), [0.0], depression=0, spacing=0.5)
    >>> seen = seen_views(views, [(0.0, 0.0)], footprint=15.0)
    >>> how = {"pulse_width": [30e-9], "bin_width": 1.0, "bins": 250, "learned": 1}
    >>> excess = signatures(seen, cnr=[0.0, 10**3.2], **how)["excess"]
    >>> print(f"{excess[0].max():.1f} {excess[1].max():.1f}")
    0.0 75.3
    """
    ratios = require_all("cnr", cnr, minimum=0.0)
    require("learned", learned, minimum=1, whole=True)
    noise = math.sqrt(math.pi / 8)
    shape = len(seen.ifovs), bins
    excess = np.empty((len(ratios), len(pulse_width), *shape), np.float32)
    power = np.empty((len(pulse_width), 1 + shape[0] - learned, bins), np.float32)
    for p, width in enumerate(pulse_width):
        place, after = _after_pulse(seen, width, bin_width, bins)

        def summed(values: Floats, place: Places = place) -> Floats:
            return np.bincount(place, values, math.prod(shape)).astype(np.float64).reshape(shape)

        for c, ratio in enumerate(ratios):
            above = summed(np.sqrt(ratio * after + noise) - math.sqrt(noise))
            excess[c, p] = math.sqrt(math.pi / 2) * above
        whole = summed(after)
        power[p, 0], power[p, 1:] = whole[:learned].mean(axis=0), whole[learned:]
    along = len(ratios), len(pulse_width)
    ifovs = seen.ifovs[learned:]
    return {
        "excess": excess,
        "power": np.broadcast_to(power, (len(ratios), *power.shape)),
        "ifovs": np.broadcast_to(ifovs, (*along, len(ifovs))),
    }


def _after_pulse(
    seen: Seen, pulse_width: float, bin_width: float, bins: int
) -> tuple[Places, Floats]:
    """Return the power of every IFOV in the bins that it reaches, and places in (view, bin)."""
    # Imported here because scipy takes a tenth of a second.
    from scipy.sparse import csr_array, diags_array

    response = target_response(pulse_width=pulse_width, bin_width=bin_width) ** 2
    middle = len(response) // 2
    reach = min(middle, bins - 1)
    lags = range(-reach, reach + 1)
    kernel = diags_array(
        [np.full(bins - abs(lag), response[middle + lag]) for lag in lags],
        offsets=list(lags),
        shape=(bins, bins),
    ).tocsr()
    density = seen.fraction.astype(np.float64) * (REFERENCE_BIN / bin_width)
    start = np.concatenate([[0], np.cumsum(seen.samples)])
    extent = csr_array((density, seen.place, start), shape=(len(seen.samples), bins))
    after = (extent @ kernel).tocsr()
    place = np.repeat(seen.view, np.diff(after.indptr)) * bins + after.indices
    return place, after.data


@lru_cache(maxsize=32)
def correlations(*, pulse_width: float, bin_width: float, bins: int) -> tuple[Floats, Floats]:
    """Return the (bin, bin) correlations of magnitudes of an IFOV of target, and of noise alone."""
    noise = noise_covariance(pulse_width=pulse_width, bin_width=bin_width, bin_count=bins)
    n_z = SPEED_OF_LIGHT * pulse_width / (math.sqrt(2) * bin_width)
    lag = np.subtract.outer(np.arange(bins), np.arange(bins))
    target = magnitude_covariance(np.exp(-2 * lag**2 / n_z**2)) / RAYLEIGH
    return target, magnitude_covariance(noise) / (RAYLEIGH * noise[0, 0])


@lru_cache(maxsize=32)
def factors(*, pulse_width: float, bin_width: float, bins: int) -> tuple[Floats, Floats]:
    """Return matrices F of both correlations, F' F, of which F makes noise from white noise."""
    roots = []
    for correlation in correlations(pulse_width=pulse_width, bin_width=bin_width, bins=bins):
        values, vectors = np.linalg.eigh(correlation)
        roots.append((vectors * np.sqrt(np.maximum(values, 0.0))).T.copy())
    return roots[0], roots[1]


def frame_noise(
    power: ArrayLike,
    ifovs: ArrayLike,
    normals: ArrayLike,
    *,
    pulse_width: float,
    bin_width: float,
    cnr: float,
) -> Floats:
    """Return the noise of one frame of several views, from standard normals.

    Parameters
    ----------
    power : (view, bin) array_like
        Power of each view, as of `signatures`.
    ifovs : (view,) array_like
        IFOVs in a frame, target-free ones included.
    normals : (view, 2, bin) array_like
        Standard normals, of target and of noise.
    pulse_width, bin_width, cnr : float
        As of `ProfileMatch`.

    Returns
    -------
    (view, bin) float64 ndarray
        Deviation of a frame from its expectation.

    See Also
    --------
    ncti.ladar.frame_moments : The exact moments.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.operate.profiles import frame_noise
    >>> normals = np.random.default_rng(0).standard_normal((400, 2, 50))
    >>> still = np.zeros((400, 50))
    >>> noise = frame_noise(
    ...     still, np.full(400, 4000.0), normals, pulse_width=30e-9, bin_width=1.0, cnr=1.0
    ... )
    >>> print(f"{noise.std() / np.sqrt(4000 * (2 - np.pi / 2) * np.sqrt(np.pi / 8)):.1f}")
    1.0
    """
    pulse = {"pulse_width": pulse_width, "bin_width": bin_width}
    normal = np.asarray(normals, dtype=np.float64)
    roots = factors(**pulse, bins=normal.shape[-1])
    noise = float(noise_by_lag(**pulse, bin_count=1)[0])
    own = np.sqrt(RAYLEIGH * cnr * np.asarray(power, dtype=np.float64))
    free = np.sqrt(RAYLEIGH * noise * np.asarray(ifovs, dtype=np.float64))
    of_noise: Floats = free[:, None] * (normal[:, 1] @ roots[1])
    return own * (normal[:, 0] @ roots[0]) + of_noise


class ProfileMatch:
    """Averaged range profiles and their likelihood under the templates of several ships.

    Parameters
    ----------
    templates : (ship, template, bin) array_like
        Expected profiles above the noise floor, in the order of their aspects.
    tests : (test, bin) array_like
        The same of views to identify.
    power : (test, bin) array_like
        Power of the tests, as of `signatures`.
    template_power : (bin,) array_like
        Mean power of the templates.
    target_free : (test,) array_like
        IFOVs of each test, target-free ones included, whose noise the profile has.
    normals : (test, 2, bin) array_like
        Standard normals, of target and of noise.
    pulse_width, bin_width : float
        As of `signatures` [s, m].
    cnr : float
        Carrier-to-noise ratio of a filled IFOV, as a power ratio.
    floor_sigma : float
        Prior standard deviation of the noise floor, relative to that of a bin of one frame.

    See Also
    --------
    ncti.classify.GaussianTemplates : The likelihood with each template's own exact covariance.
    log_evidence : The likelihood.

    Notes
    -----
    The noise of a frame is Gaussian, of exact variance in each bin: target and noise of all IFOVs
    add (2 - pi/2) (CNR p + v). Between bins target and noise have each their own correlation
    (`correlations`), instead of one for every IFOV. An average of N frames has 1/N of it. The
    same normals serve for all N, so that percentages are smooth in N.

    The likelihood has one covariance for all templates, W = S / N + B: S that of a frame, mean
    over templates, B what lies between templates of a ship, a quarter of the mean square of second
    differences of neighbours, and the unknown floor. With U' S U = 1 and U' B U diagonal, all N
    share the projections of templates and tests.

    With six ships, 30 ns, 15 m, 32 dB and 4, 16, 64 frames, the exact likelihood has 37, 62, 83 %
    (240 views, +-6) and this 39, 63, 83 %; at 7.5 m and 38 dB 87, 94, 99 and 88, 96, 98 %.

    Examples
    --------
    Two ships of one template each:

    >>> import numpy as np
    >>> from studies.operate import ProfileMatch, ship_evidence
    >>> ships = np.zeros((2, 1, 60))
    >>> ships[0, 0, 20:25], ships[1, 0, 30:35] = 40.0, 40.0
    >>> match = ProfileMatch(
    ...     ships, ships[:, 0], np.zeros((2, 60)), np.zeros(60), np.full(2, 100.0),
    ...     np.zeros((2, 2, 60)), pulse_width=30e-9, bin_width=1.0, cnr=100.0, floor_sigma=1.0,
    ... )
    >>> ship_evidence(match.evidence(16, gain_sigma=1.0), 2).argmax(axis=1).tolist()
    [0, 1]
    """

    def __init__(
        self,
        templates: ArrayLike,
        tests: ArrayLike,
        power: ArrayLike,
        template_power: ArrayLike,
        target_free: ArrayLike,
        normals: ArrayLike,
        *,
        pulse_width: float,
        bin_width: float,
        cnr: float,
        floor_sigma: float,
    ) -> None:
        # Imported here because scipy takes a tenth of a second.
        from scipy.linalg import eigh

        learned = np.asarray(templates, dtype=np.float64)
        seen = np.asarray(tests, dtype=np.float64)
        require_shape("templates", learned, (*learned.shape[:2], seen.shape[-1]))
        require("floor_sigma", floor_sigma, minimum=0.0)
        bins = seen.shape[-1]
        pulse = {"pulse_width": pulse_width, "bin_width": bin_width}
        noise = float(noise_by_lag(**pulse, bin_count=1)[0])
        shapes = correlations(**pulse, bins=bins)
        ifovs = np.asarray(target_free, dtype=np.float64)
        # Covariance of a frame, mean over templates, and what is unknown besides.
        spread = np.sqrt(RAYLEIGH * cnr * np.asarray(template_power, dtype=np.float64))
        frame = np.outer(spread, spread) * shapes[0] + RAYLEIGH * noise * ifovs.mean() * shapes[1]
        variance = float(np.trace(frame)) / bins
        frame[np.diag_indices(bins)] += LOADING * variance
        bend = learned[:, 1:-1] - (learned[:, :-2] + learned[:, 2:]) / 2
        bend = bend.reshape(-1, bins)
        between = BETWEEN * bend.T @ bend / max(len(bend), 1) + floor_sigma**2 * variance
        self._unknown, directions = eigh(between, frame)
        deviation = frame_noise(power, ifovs, normals, cnr=cnr, **pulse)
        flat = learned.reshape(-1, bins)
        self._templates, self._tests, self._noise = (
            (rows @ directions).astype(np.float32) for rows in (flat, seen, deviation)
        )
        self._largest = np.square(self._templates).max(axis=0).astype(np.float64)

    def evidence(self, frame_count: float, *, gain_sigma: float) -> Singles:
        """Return the (test, template) log likelihood of averages, as of `log_evidence`."""
        weight = 1.0 / (1.0 / frame_count + np.maximum(self._unknown, 0.0))
        energy = np.square(self._templates) @ weight.astype(np.float32)
        # Directions that no template reaches above the noise tell nothing apart.
        told = self._largest * weight > NEGLIGIBLE
        seen = self._tests[:, told] + self._noise[:, told] * np.float32(frame_count**-0.5)
        product = (seen * weight[told].astype(np.float32)) @ self._templates[:, told].T
        return log_evidence(product, energy, gain_sigma=gain_sigma)
