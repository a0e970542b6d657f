"""Time and percent correct of the classifiers, beside scikit-learn's."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neighbors import KNeighborsClassifier, NearestNeighbors
from sklearn.neural_network import MLPClassifier
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]  # of scikit-learn

import ncti.ships
from benchmarks.reports import Column, Report, Sample
from ncti.classify import (
    AdaptiveClusteringNetwork,
    CorrelationNeighbour,
    GainAnnealedNetwork,
    GaussianTemplates,
    Similarities,
    cluster,
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
DEPRESSION, SLANT_RANGE = 3.84, 100e3  # [deg], [m]
SIGNAL: dict[str, Any] = {"pulse_width": 30e-9, "cnr": 10**3.2, "target_free_ifovs": 4000}
FRAMES, REPLICATES = 16, 4
VIGILANCE, PASSES = 0.95, 200
VIGILANCES = {
    1: (VIGILANCE,),
    5: (0.80, 0.85, 0.90, 0.95, 0.99),
    20: tuple(np.linspace(0.80, 0.99, 20).tolist()),
}
PERCEPTRON_RATE = 0.1  # the best of 0.03, 0.1 and 0.3

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
        """(view,): ship and aspect group, which the multilayered networks learn."""
        return self.ship * self.groups + self.group

    @property
    def true_ship(self) -> Array:
        """(test,): ship of each test."""
        return np.tile(self.ship, len(self.tests) // len(self.ship))

    @property
    def true_label(self) -> Array:
        """(test,): ship and aspect group of each test."""
        return np.tile(self.label, len(self.tests) // len(self.ship))

    @property
    def floor(self) -> Array:
        """(view, 1): noise within each expected profile, what its window's edge holds."""
        return self.expected[:, :1]

    @property
    def standardised(self) -> tuple[Array, Array]:
        """Training and test vectors as `GainAnnealedNetwork` makes them for itself."""
        centre, scale = self.training.mean(axis=0), self.training.std()
        return (self.training - centre) / scale, (self.tests - centre) / scale


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
            whole = frames.reshape(replicates, FRAMES, -1)
            averaged.append([cumulative_average(some, [FRAMES])[0] for some in whole])
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


NEIGHBOURS, PERCEPTRON = "KNeighborsClassifier", "MLPClassifier, sgd"
"""Classifiers with which the others are compared."""


def contenders(epochs: int) -> dict[str, Contender]:
    """Return all classifiers by name, scikit-learn's networks with so many epochs."""
    return {
        "AdaptiveClusteringNetwork": Contender(
            lambda task: AdaptiveClusteringNetwork(vigilance=VIGILANCE, max_passes=PASSES).fit(
                task.training, task.ship
            ),
            lambda network, task: network.predict(task.tests),
        ),
        "CorrelationNeighbour": Contender(
            lambda task: CorrelationNeighbour().fit(task.training, task.ship),
            lambda neighbour, task: neighbour.predict(task.tests),
        ),
        "NearestNeighbors": Contender(
            lambda task: NearestNeighbors(n_neighbors=1, metric="cosine").fit(task.training),
            lambda neighbours, task: task.ship[
                neighbours.kneighbors(task.tests, return_distance=False)[:, 0]
            ],
        ),
        NEIGHBOURS: Contender(
            lambda task: KNeighborsClassifier(1, metric="cosine").fit(task.training, task.ship),
            lambda neighbours, task: neighbours.predict(task.tests),
        ),
        "GaussianTemplates": _likelihood(1.0),
        "GaussianTemplates, known": _likelihood(0.0),
        "GainAnnealedNetwork": Contender(
            lambda task: GainAnnealedNetwork(random_state=0).fit(task.training, task.label),
            lambda network, task: network.predict(task.tests) // task.groups,
        ),
        PERCEPTRON: _perceptron(epochs, solver="sgd", learning_rate_init=PERCEPTRON_RATE),
        "MLPClassifier, adam": _perceptron(epochs, solver="adam"),
    }


def _likelihood(sigma: float) -> Contender:
    """Return the likelihood classifier with a prior deviation `sigma` of gain and floor."""
    return Contender(
        lambda task: GaussianTemplates(gain_sigma=sigma, floor_sigma=sigma).fit(
            task.expected, task.covariance, task.ship, floor=task.floor
        ),
        lambda templates, task: templates.predict(task.averaged, FRAMES),
    )


def _perceptron(epochs: int, **solver: Any) -> Contender:
    """Return scikit-learn's network, of as many nodes and epochs as ours."""
    settings = solver | {"max_iter": epochs, "n_iter_no_change": epochs, "tol": 0.0}
    return Contender(
        lambda task: MLPClassifier((25,), activation="tanh", random_state=0, **settings).fit(
            task.standardised[0], task.label
        ),
        lambda network, task: network.predict(task.standardised[1]) // task.groups,
    )


def measure(*, repeats: int, task: Task | None = None) -> Report:
    """Time every classifier on the same profiles.

    Parameters
    ----------
    repeats : int
        How often each of them is fitted and names all tests.
    task : Task, optional
        Profiles; the article's when not given.

    Returns
    -------
    Report
        One row per classifier.
    """
    task = source_task() if task is None else task
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        epochs = GainAnnealedNetwork(random_state=0).fit(task.training, task.label).n_iter_
        everyone = contenders(epochs)
        taken: dict[str, list[tuple[float, float]]] = {name: [] for name in everyone}
        right = {}
        for turn in range(repeats + 1):
            # Forwards, then backwards: none always follows the same one.
            for name in list(everyone)[:: 1 if turn % 2 == 0 else -1]:
                contender = everyone[name]
                fit, fitted = clocked(contender.fit, task)
                naming, named = clocked(contender.name_ships, fitted, task)
                right[name] = percent(named, task.true_ship)
                if turn:  # the first one is not counted
                    taken[name].append((fit, naming))
    whole = {name: np.array(seconds).sum(axis=1) for name, seconds in taken.items()}
    rows = []
    for name, seconds in taken.items():
        fit_seconds, naming_seconds = zip(*seconds, strict=True)
        row: dict[str, object] = {
            "classifier": name,
            "fit_ms": Sample.of(1e3 * np.array(fit_seconds)),
            "predict_ms": Sample.of(1e3 * np.array(naming_seconds)),
            "right_percent": right[name],
            "over_neighbours": Sample.of(whole[name] / whole[NEIGHBOURS]),
            "over_perceptron": Sample.of(whole[name] / whole[PERCEPTRON]),
        }
        medians = {
            f"{key}_median": value.median for key, value in row.items() if isinstance(value, Sample)
        }
        rows.append(row | medians)
    return Report(
        f"Classifiers: {len(task.training)} profiles to learn, {len(task.tests)} averages of "
        f"{FRAMES} frames to name, {repeats} times",
        (
            Column("classifier", "classifier"),
            Column("fit_ms_median", "ms to fit", ".3g"),
            Column("predict_ms_median", "ms to predict", ".3g"),
            Column("right_percent", "right [%]", ".1f"),
            Column("over_neighbours_median", "x neighbours", ".3g"),
            Column("over_perceptron_median", "x perceptron", ".3g"),
        ),
        rows,
        [
            "On one core, medians, after one round that is not counted. Right: the ship.",
            f"x neighbours: fit and predict together over those of {NEIGHBOURS} (cosine) in the "
            f"same round; x perceptron: over those of {PERCEPTRON}.",
            "The networks have 25 hidden nodes and see the whole training set in each step; "
            f"scikit-learn's take {epochs}, as many as GainAnnealedNetwork needs.",
            "GaussianTemplates knows nothing of gain and floor; known: both of them.",
        ],
    )


def measure_vigilances(
    *,
    repeats: int,
    task: Task | None = None,
    vigilances: Sequence[Sequence[float]] = tuple(VIGILANCES.values()),
) -> Report:
    """Time cosines shared by all vigilances against a network for each of them.

    Parameters
    ----------
    repeats : int
        How often.
    task : Task, optional
        Profiles; the article's when not given.
    vigilances : sequence of sequences of float
        Vigilances that are asked for together.

    Returns
    -------
    Report
        One row per set of vigilances.
    """
    task = source_task() if task is None else task
    rows = []
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        for asked in vigilances:
            taken: list[tuple[float, float]] = []
            for turn in range(repeats + 1):
                ways = (name_one_by_one, name_together)
                found = {way: clocked(way, task, asked) for way in ways[:: (-1) ** turn]}
                if turn:
                    taken.append((found[ways[0]][0], found[ways[1]][0]))
            loop, together = (np.array(part) for part in zip(*taken, strict=True))
            plain, shared = (found[way][1] for way in ways)
            rows.append(
                {
                    "vigilances": len(asked),
                    "loop_ms": Sample.of(1e3 * loop),
                    "together_ms": Sample.of(1e3 * together),
                    "ratio": Sample.of(together / loop),
                    "same_percent": percent(plain, shared),
                    "right_percent": percent(shared, task.true_ship),
                }
            )
    return Report(
        f"Vigilances: {len(task.training)} profiles, {len(task.tests)} averages, {repeats} times",
        (
            Column("vigilances", "vigilances", "d"),
            Column("loop_ms", "ms, a network each", ".3g"),
            Column("together_ms", "ms, cosines shared", ".3g"),
            Column("ratio", "x as long", ".2f"),
            Column("same_percent", "same [%]", ".1f"),
            Column("right_percent", "right [%]", ".1f"),
        ),
        rows,
        [
            "Fit and predict, on one core, after one round that is not counted. A network each: "
            "AdaptiveClusteringNetwork; cosines shared: Similarities and cluster."
        ],
    )


def name_one_by_one(task: Task, vigilances: Sequence[float]) -> Array:
    """(vigilance, test): ships that a network for each vigilance names."""
    return np.array(
        [
            AdaptiveClusteringNetwork(vigilance=vigilance, max_passes=PASSES)
            .fit(task.training, task.ship)
            .predict(task.tests)
            for vigilance in vigilances
        ]
    )


def name_together(task: Task, vigilances: Sequence[float]) -> Array:
    """(vigilance, test): the same from shared cosines."""
    similarities = Similarities.of(task.training, task.tests)
    named = []
    for vigilance in vigilances:
        found = cluster(similarities, vigilance=vigilance, max_passes=PASSES)
        named.append(found.names(task.ship)[found.match(similarities)[0]])
    return np.array(named)


def clocked(work: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Return the run time [s] of a function, and its result."""
    start = time.perf_counter()
    result = work(*arguments)
    return time.perf_counter() - start, result


def percent(named: Array, truth: Array) -> float:
    """Return how often they agree [%]."""
    return 100.0 * float(np.mean(named == truth))
