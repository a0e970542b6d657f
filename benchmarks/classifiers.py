"""Profiles of the article's experiment, and the classifiers that learn and name them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # of scikit-learn

import ncti.ships
from benchmarks.views import DEPRESSION
from ncti.classify import (
    AdaptiveClusteringNetwork,
    CorrelationNeighbour,
    GainAnnealedNetwork,
    GaussianTemplates,
)
from ncti.evaluate import aspect_bins
from ncti.features import profile_vector
from ncti.ladar import (
    banded_frame_moments,
    cumulative_average,
    expected_profile,
    range_extent,
    sample_frames,
)
from ncti.render import range_image

SHIPS = ("duncan", "horne", "spruance", "texas")
ASPECTS = tuple(range(0, 91, 3))  # [deg]
SLANT_RANGE = 100e3  # [m]
SIGNAL: dict[str, Any] = {"pulse_width": 30e-9, "cnr": 10**3.2, "target_free_ifovs": 4000}
FRAMES, REPLICATES = 16, 4
VIGILANCE, PASSES = 0.95, 200

Array = NDArray[Any]


@dataclass(frozen=True)
class Task:
    """Training and test profiles of all classifiers.

    Attributes
    ----------
    expected : (view, bin) float64 ndarray
        Profiles without noise, noise floor included.
    covariance : (view, lag, bin) float64 ndarray
        Of one frame, as a lower band.
    averaged : (test, bin) float64 ndarray
        Averages of 16 frames, replicate by replicate.
    training, tests : (view, bin) and (test, bin) float64 ndarray
        The same as profile vectors.
    ship, group : (view,) intp ndarray
        Ship and aspect group of each view.
    groups : int
        Number of aspect groups.
    """

    expected: Array
    covariance: Array
    averaged: Array
    training: Array
    tests: Array
    ship: Array
    group: Array
    groups: int

    @property
    def label(self) -> Array:
        """Ship and aspect group of each view, (view,), which the multilayered networks learn."""
        return self.ship * self.groups + self.group

    @property
    def true_ship(self) -> Array:
        """Ship of each test, (test,)."""
        return np.tile(self.ship, len(self.tests) // len(self.ship))

    @property
    def floor(self) -> Array:
        """Noise floor of each expected profile at its window's edge, (view, 1)."""
        return self.expected[:, :1]


@lru_cache(maxsize=2)
@threadpool_limits.wrap(1)  # as in a worker: threads of small products cost more than they save
def source_task(
    ships: Sequence[str] = SHIPS,
    aspects: Sequence[float] = ASPECTS,
    replicates: int = REPLICATES,
) -> Task:
    """Return the article's profiles at 30 ns and 100 km, of some ships and aspects."""
    expected, bands, averaged = [], [], []
    for i, ship in enumerate(ships):
        mesh = ncti.ships.load(ship)
        for j, aspect in enumerate(aspects):
            image = range_image(mesh, aspect=aspect, depression=DEPRESSION, engine="auto")
            extent = range_extent(image, slant_range=SLANT_RANGE)
            rng = np.random.default_rng([i, j])
            frames = sample_frames(extent, frame_count=FRAMES * replicates, rng=rng, **SIGNAL)
            runs = frames.reshape(replicates, FRAMES, -1)
            averaged.append([cumulative_average(run, [FRAMES])[0] for run in runs])
            expected.append(expected_profile(extent, **SIGNAL))
            bands.append(banded_frame_moments(extent, **SIGNAL)[1])
    lags = max(map(len, bands))
    covariance = np.array([np.pad(band, ((0, lags - len(band)), (0, 0))) for band in bands])
    tests = np.swapaxes(averaged, 0, 1).reshape(len(expected) * replicates, -1)
    names, group = aspect_bins(np.array(aspects, dtype=np.float64))
    return Task(
        expected=np.array(expected),
        covariance=covariance,
        averaged=tests,
        training=profile_vector(np.array(expected)),
        tests=profile_vector(tests),
        ship=np.repeat(np.arange(len(ships)), len(aspects)),
        group=np.tile(group, len(ships)),
        groups=len(names),
    )


@dataclass(frozen=True)
class Contender:
    """A classifier: functions that fit it, and that predict the ships of the tests."""

    fit: Callable[[Task], Any]
    name_ships: Callable[[Any, Task], Array]


def _likelihood(sigma: float) -> Contender:
    """Return the likelihood classifier with a prior deviation `sigma` of gain and floor."""
    return Contender(
        lambda task: GaussianTemplates(gain_sigma=sigma, floor_sigma=sigma).fit(
            task.expected, task.covariance, task.ship, floor=task.floor
        ),
        lambda templates, task: templates.predict(task.averaged, FRAMES),
    )


CONTENDERS = {
    "AdaptiveClusteringNetwork": Contender(
        lambda task: AdaptiveClusteringNetwork(vigilance=VIGILANCE, max_passes=PASSES).fit(
            task.training, task.ship
        ),
        lambda network, task: network.predict(task.tests),
    ),
    "GainAnnealedNetwork": Contender(
        lambda task: GainAnnealedNetwork(random_state=0).fit(task.training, task.label),
        lambda network, task: network.predict(task.tests) // task.groups,
    ),
    "CorrelationNeighbour": Contender(
        lambda task: CorrelationNeighbour().fit(task.training, task.ship),
        lambda neighbour, task: neighbour.predict(task.tests),
    ),
    "GaussianTemplates": _likelihood(1.0),
    "GaussianTemplates, known": _likelihood(0.0),
}
"""Classifiers by name; templates take gain and floor as unknown or as known."""
