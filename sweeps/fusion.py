"""Range profiles and silhouettes together, in one cell of the range channel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ncti.classify import GaussianTemplates, fit_sharpness, fuse, label_posterior
from sweeps.axes import OF_SILHOUETTES
from sweeps.classification import NONE, Arrays
from sweeps.naming import Profiles

CHANNELS = ("range", "infrared", "both")

Scores = NDArray[np.float64]


def name_by_both(
    profiles: Profiles,
    covariance: NDArray[np.float32],
    templates: NDArray[np.float32],
    silhouettes: NDArray[np.float32],
    *,
    gain_sigma: tuple[float, ...],
    nugget: float,
) -> Arrays:
    """Name ships by profile, by silhouette and by both.

    Parameters
    ----------
    profiles : Profiles
        Of the cell.
    covariance : (view, lag, bin) float32 ndarray
        Of one frame of each view.
    templates : (phase, view, feature) float32 ndarray
        Noiseless log-polar maps, of two phases or more.
    silhouettes : (phase, super_resolution, frame_count, view, feature) float32 ndarray
        Maps cut out of images at the range of the cell.
    gain_sigma : tuple of float
        Prior standard deviations of the target's gain, one after the other.
    nugget : float
        As for `sweeps.naming.name_by_likelihood`.

    Returns
    -------
    dict of str to ndarray
        predicted, correct, probability : (channel, gain_sigma, super_resolution,
        infrared_frame_count, draw, frame_count, ship, aspect); sharpness : (channel, gain_sigma,
        super_resolution, infrared_frame_count, draw, frame_count) of range and infrared, NaN for
        both.

    Notes
    -----
    Draw d pairs replicate d of the profiles with phase d of the silhouettes, as many of the
    first as there are, over again where there are fewer. A template is a view, a ship at an
    aspect, for both sensors.

    The score of a profile is its log-likelihood, which is worth what it says: its sharpness is 1.
    That of a silhouette is the largest cosine of its map to those of a template in all phases but
    its own, whose place on the detector no observer would have on file; it is given its sharpness
    on the silhouettes of the *other* phases (`ncti.classify.fit_sharpness`). Then they are added.
    An empty silhouette says nothing: all its scores are 0.
    """
    ship, taught = profiles.ship, profiles.taught
    likelihood = GaussianTemplates(nugget=nugget)
    likelihood.fit(profiles.expected, covariance, ship, floor=profiles.floor)
    replicates, counts, views, bins = profiles.averaged.shape
    phases, ways, looks = silhouettes.shape[:3]
    draws = max(replicates, phases)
    by_profile = np.empty((len(gain_sigma), replicates, counts, views, views))
    for n, frames in enumerate(profiles.frame_count):
        samples = profiles.averaged[:, n].reshape(-1, bins)
        logs = likelihood.log_likelihood(samples, frames, gain_sigma=gain_sigma)
        by_profile[:, :, n] = logs.reshape(-1, replicates, views, views)
    by_silhouette = _similarity(silhouettes, templates)

    shape = (len(CHANNELS), len(gain_sigma), ways, looks, draws, counts)
    named = np.empty((*shape, views), dtype=np.intp)
    true = np.empty((*shape, views))
    sharpness = np.full(shape, np.nan)
    by_profile, by_silhouette = by_profile[..., taught], by_silhouette[..., taught]
    labels = ship[taught]
    worth = _calibrate(by_silhouette[..., taught, :], labels)
    for g, k, m, d, n in np.ndindex(shape[1:]):
        r, phase = d % replicates, d % phases
        alone = by_profile[g, r, n], by_silhouette[phase, k, m]
        mine = 1.0, float(worth[phase, k, m])
        sharpness[:2, g, k, m, d, n] = mine
        answers = (
            fuse(alone[0], sharpness=mine[:1]),
            fuse(alone[1], sharpness=mine[1:]),
            fuse(*alone, sharpness=mine),
        )
        for c, answer in enumerate(answers):
            classes, posterior = label_posterior(answer, labels)
            named[c, g, k, m, d, n] = classes[posterior.argmax(axis=1)]
            # 0 for a ship that nobody taught.
            true[c, g, k, m, d, n] = (posterior * (classes == ship[:, None])).sum(axis=1)
    return {
        "predicted": profiles.spread(named, NONE, np.int16),
        "correct": profiles.spread(named == ship, NONE, np.int8),
        "probability": profiles.spread(true, np.nan, np.float32),
        "sharpness": sharpness.astype(np.float32),
    }


def _similarity(silhouettes: NDArray[np.float32], templates: NDArray[np.float32]) -> Scores:
    """(phase, super_resolution, frame_count, view, template): largest cosine over other phases."""
    phases, views, features = templates.shape
    known = _directions(templates)
    best = np.empty((*silhouettes.shape[:-1], views))
    for phase, seen in enumerate(_directions(silhouettes)):
        others = known[np.arange(phases) != phase].reshape(-1, features)
        cosines = seen.reshape(-1, features) @ others.T
        best[phase] = cosines.reshape(*seen.shape[:-1], phases - 1, views).max(axis=-2)
    return best


def _directions(vectors: NDArray[np.float32]) -> NDArray[np.floating]:
    norm = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    return vectors / np.where(norm > 0, norm, np.float32(1))


def _calibrate(scores: Scores, ship: NDArray[np.intp]) -> Scores:
    """(phase, ...): sharpness of (phase, ..., view, template) scores, from all phases but one."""
    phases = len(scores)
    found = np.empty(scores.shape[:-2])
    for place in np.ndindex(found.shape):
        others = [phase for phase in range(phases) if phase != place[0]]
        pooled = scores[(others, *place[1:])].reshape(-1, scores.shape[-1])
        found[place] = fit_sharpness(pooled, ship, np.tile(ship, len(others)))
    return found


def place_of(
    ranges: tuple[float, ...], infrared_ranges: tuple[float, ...], cell: Mapping[str, int]
) -> dict[str, int]:
    """Where the silhouettes of a cell lie on the axes of the infrared group.

    Parameters
    ----------
    ranges, infrared_ranges : tuple of float
        Slant ranges [km] of profiles and of silhouettes.
    cell : mapping of str to int
        Place on the axes of the range channel.

    Returns
    -------
    dict of str to int
        That of its range, and of the one way in which silhouettes are made.
    """
    place = infrared_ranges.index(ranges[cell["range"]])
    return {"range": place, **dict.fromkeys(OF_SILHOUETTES, 0)}
