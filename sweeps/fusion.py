"""Range profiles and silhouettes together, in one cell of the range channel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.classify import GaussianTemplates, fit_sharpness, fuse, label_posterior
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
    gain_sigma: float,
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
        Noiseless log-polar maps.
    silhouettes : (phase, super_resolution, frame_count, view, feature) float32 ndarray
        Maps cut out of images at the range of the cell.
    gain_sigma, nugget
        As for `sweeps.naming.name_by_likelihood`.

    Returns
    -------
    dict of str to ndarray
        predicted, correct, probability : (channel, super_resolution, infrared_frame_count, draw,
        frame_count, ship, aspect); sharpness : (channel, super_resolution,
        infrared_frame_count, draw, frame_count) of range and infrared, NaN for both.

    Notes
    -----
    Draw d pairs replicate d of the profiles with phase d of the silhouettes, as many of the
    first as there are, over again where there are fewer. A template is a view, a ship at an
    aspect, for both sensors.

    The score of a profile is its log-likelihood; that of a silhouette the largest cosine of its
    map to those of a template in all phases. Each is given its sharpness on the *other* draws
    (`ncti.classify.fit_sharpness`), then they are added. An empty silhouette says nothing: all
    its scores are 0.
    """
    ship = profiles.ship
    likelihood = GaussianTemplates(gain_sigma=gain_sigma, nugget=nugget)
    likelihood.fit(profiles.expected, covariance, ship, floor=profiles.floor)
    replicates, counts, views, bins = profiles.averaged.shape
    phases, ways, looks = silhouettes.shape[:3]
    draws = max(replicates, phases)
    by_profile = np.empty((replicates, counts, views, views))
    for n, frames in enumerate(profiles.frame_count):
        samples = profiles.averaged[:, n].reshape(-1, bins)
        logs = likelihood.log_likelihood(samples, frames)
        by_profile[:, n] = logs.reshape(replicates, views, views)
    by_silhouette = _similarity(silhouettes, templates)

    shape = (len(CHANNELS), ways, looks, draws, counts)
    named = np.empty((*shape, views), dtype=np.intp)
    true = np.empty((*shape, views))
    sharpness = np.full(shape, np.nan)
    taught = profiles.taught
    by_profile, by_silhouette = by_profile[..., taught], by_silhouette[..., taught]
    labels = ship[taught]
    of_profile = _calibrate(by_profile[..., taught, :], labels)
    of_silhouette = _calibrate(by_silhouette[..., taught, :], labels)
    for k, m, d, n in np.ndindex(shape[1:]):
        r, phase = d % replicates, d % phases
        alone = by_profile[r, n], by_silhouette[phase, k, m]
        mine = float(of_profile[r, n]), float(of_silhouette[phase, k, m])
        sharpness[:2, k, m, d, n] = mine
        answers = (
            fuse(alone[0], sharpness=mine[:1]),
            fuse(alone[1], sharpness=mine[1:]),
            fuse(*alone, sharpness=mine),
        )
        for c, answer in enumerate(answers):
            classes, posterior = label_posterior(answer, labels)
            named[c, k, m, d, n] = classes[posterior.argmax(axis=1)]
            # 0 for a ship that nobody taught.
            true[c, k, m, d, n] = (posterior * (classes == ship[:, None])).sum(axis=1)
    return {
        "predicted": profiles.spread(named, NONE, np.int16),
        "correct": profiles.spread(named == ship, NONE, np.int8),
        "probability": profiles.spread(true, np.nan, np.float32),
        "sharpness": sharpness.astype(np.float32),
    }


def _similarity(silhouettes: NDArray[np.float32], templates: NDArray[np.float32]) -> Scores:
    """(phase, super_resolution, frame_count, view, template): largest cosine over phases."""
    phases, views, features = templates.shape
    tests = _directions(silhouettes).reshape(-1, features)
    cosines = tests @ _directions(templates).reshape(-1, features).T
    best = cosines.reshape(len(tests), phases, views).max(axis=1)
    return best.reshape(*silhouettes.shape[:-1], views).astype(np.float64)


def _directions(vectors: NDArray[np.float32]) -> NDArray[np.floating]:
    norm = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    return vectors / np.where(norm > 0, norm, np.float32(1))


def _calibrate(scores: Scores, ship: NDArray[np.intp]) -> Scores:
    """(draw, ...): sharpness of (draw, ..., view, template) scores, from all draws but each one.

    Of a single draw from itself.
    """
    draws = len(scores)
    found = np.empty(scores.shape[:-2])
    for place in np.ndindex(found.shape):
        others = [d for d in range(draws) if d != place[0]] or [0]
        pooled = scores[(others, *place[1:])].reshape(-1, scores.shape[-1])
        found[place] = fit_sharpness(pooled, ship, np.tile(ship, len(others)))
    return found


def places_of(
    config_ranges: Mapping[str, tuple[float, ...]], cell: Mapping[str, int]
) -> dict[str, Any]:
    """Where the silhouettes of a cell lie on the axes of the infrared group.

    Parameters
    ----------
    config_ranges : mapping of str to tuple of float
        `grid` and `infrared`: slant ranges [km].
    cell : mapping of str to int
        Place on the axes of the range channel.

    Returns
    -------
    dict of str to int
        Its range, and the first of every choice of how silhouettes are made.
    """
    slant_range = config_ranges["grid"][cell["range"]]
    choices = ("coverage_rule", "segmentation", "inner_radius", "interpolation")
    return {"range": config_ranges["infrared"].index(slant_range), **dict.fromkeys(choices, 0)}
