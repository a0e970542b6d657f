"""Cost of differences between tests and templates: place, sight, range gate, pulse, ship."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

import ncti.ships
from benchmarks.classifiers import FRAMES, SHIPS, SIGNAL, SLANT_RANGE
from benchmarks.reports import Column, Report
from benchmarks.views import DEPRESSION
from docs._tables.repeated import mean_over_seeds
from ncti.classify import AdaptiveClusteringNetwork, CorrelationNeighbour, GaussianTemplates
from ncti.features import profile_vector
from ncti.ladar import banded_frame_moments, expected_profile, range_extent, spread_place
from ncti.ladar.frames import averaged_frames
from ncti.ladar.places import TEMPLATE_PLACES
from ncti.render import LineImage, line_image
from ncti.render.view import ROLL
from sweeps.stages.meshes import cache_folder

STEP = 1.5  # between learned aspects [deg]
SEEDS, TESTS = 20, 40  # sets of tests, and tests of a ship in each

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Condition:
    """A difference between tests and templates.

    Attributes
    ----------
    name, size : str
        The quantity that differs, and by how much.
    corner : bool
        Whether the ship lies where the first place of templates is.
    depression : float
        Difference of the depression [deg].
    gate : float
        Largest distance of the ship origin from the edge of a range bin [m]; drawn evenly.
    roll : float
        Rotation of the IFOVs about the line of sight [deg].
    pulse : float
        Ratio of the pulse width to the learned one.
    variants : int
        Number of variants of a ship that are tested in its place.
    """

    name: str
    size: str
    corner: bool = False
    depression: float = 0.0
    gate: float = 0.0
    roll: float = 0.0
    pulse: float = 1.0
    variants: int = 0


UNCHANGED = Condition("none", "place drawn, all else as learned")
CONDITIONS = (
    Condition("place", "at the corner, as the first place of templates", corner=True),
    Condition("depression", "0.45° less: 22,000 ft over a round Earth", depression=-0.45),
    Condition("range gate", "up to ±0.5 m within a bin", gate=0.5),
    Condition("roll of the IFOVs", "5°", roll=5.0),
    Condition("pulse width", "5 % longer", pulse=1.05),
    Condition("ship", "four variants at the uncertainty of its sheet", variants=4),
)
CLASSIFIERS = (
    "likelihood",
    "likelihood, gain and floor known",
    "correlation",
    "ACN",
)

Classify = Callable[[Floats], NDArray[Any]]


def measure(seeds: int = SEEDS, tests: int = TESTS, step: float = STEP) -> Report:
    """Return the change of percent correct by each difference between tests and templates.

    Parameters
    ----------
    seeds, tests : int
        Sets of tests, and tests of a ship in each.
    step : float
        Distance between learned aspects [deg].
    """
    with threadpool_limits(1):
        classifiers = _learn_classifiers(np.arange(0.0, 90.1, step))
        of_all = {
            condition: np.array(
                [_percent(classifiers, condition, seed, tests) for seed in range(seeds)]
            )
            for condition in (UNCHANGED, *CONDITIONS)
        }
    best = of_all[UNCHANGED]
    rows: list[dict[str, Any]] = []
    for condition, percent in of_all.items():
        row: dict[str, Any] = {"what": condition.name, "size": condition.size}
        for name, now, before in zip(CLASSIFIERS, percent.T, best.T, strict=True):
            change = mean_over_seeds(now - before, bounds=(-100.0, 100.0)).text(1, "+")
            row[name] = mean_over_seeds(now).text() if condition is UNCHANGED else change
        rows.append(row)
    heads = (Column("what", "what differs"), Column("size", "by"))
    return Report(
        "Percent correct, and its change, by what templates and tests do not share",
        (*heads, *(Column(name, name) for name in CLASSIFIERS)),
        rows,
        [
            f"100 km, 30 ns, {FRAMES} frames, {len(SHIPS)} ships learned every {step:g}°; "
            f"percent correct at random aspects and places in the first row, points below: means "
            f"over {seeds} sets of {tests * len(SHIPS)} tests, which are the same views and noise "
            "streams in all rows, with 95 % intervals."
        ],
    )


def _learn_classifiers(aspects: Floats) -> list[Classify]:
    """Return the classifiers of `CLASSIFIERS`, as functions of averages."""
    means, bands, ship = [], [], np.repeat(SHIPS, len(aspects))
    for name in SHIPS:
        for aspect in aspects.tolist():
            image = _image(name, aspect, DEPRESSION)
            extents = [
                range_extent(image, slant_range=SLANT_RANGE, shift=spread_place(number))
                for number in range(TEMPLATE_PLACES)
            ]
            means.append([expected_profile(extent, **SIGNAL) for extent in extents])
            bands.append(banded_frame_moments(extents[0], **SIGNAL)[1])
    band = np.zeros((len(bands), max(map(len, bands)), bands[0].shape[1]))
    for padded, covariance in zip(band, bands, strict=True):
        padded[: len(covariance)] = covariance
    mean, template_aspects = np.array(means), np.tile(aspects, len(SHIPS))
    vectors = profile_vector(mean[:, 0])

    def templates(sigma: float) -> Classify:
        fitted = GaussianTemplates(gain_sigma=sigma, floor_sigma=sigma, template_error=None).fit(
            mean, band, ship, mean[..., :1], aspect=template_aspects, rng=np.random.default_rng(0)
        )
        return lambda averages: fitted.predict(averages, FRAMES)

    nearest = CorrelationNeighbour().fit(vectors, ship)
    network = AdaptiveClusteringNetwork().fit(vectors, ship)
    return [
        templates(1.0),
        templates(0.0),
        lambda averages: nearest.predict(profile_vector(averages)),
        lambda averages: network.predict(profile_vector(averages)),
    ]


def _percent(
    classifiers: Sequence[Classify], condition: Condition, seed: int, tests: int
) -> list[float]:
    """Return percent correct of each classifier in one set of tests."""
    averages, true = [], np.repeat(SHIPS, tests)
    for ship, name in enumerate(SHIPS):
        for test in range(tests):
            rng = np.random.default_rng([seed, ship, test])
            aspect, right, up, gate = rng.random(4).tolist()
            number = 1 + test % condition.variants if condition.variants else 0
            image = _image(
                f"{name}@0.{number}" if number else name,
                90 * aspect,
                DEPRESSION + condition.depression,
                roll=condition.roll,
                nearer=condition.gate * (2 * gate - 1),
            )
            extent = range_extent(
                image,
                slant_range=SLANT_RANGE,
                shift=(0.0, 0.0) if condition.corner else (right, up),
            )
            signal = SIGNAL | {"pulse_width": condition.pulse * SIGNAL["pulse_width"]}
            averages.append(averaged_frames(extent, [FRAMES], rng=rng, **signal)[0])
    return [100 * float(np.mean(classify(np.array(averages)) == true)) for classify in classifiers]


def _image(
    name: str, aspect: float, depression: float, *, roll: float = 0.0, nearer: float = 0.0
) -> LineImage:
    """Return a view in the far field, with rolled IFOVs, `nearer` by some distance [m]."""
    image = line_image(_mesh(name), aspect=aspect, depression=depression, spacing=0.25, roll=ROLL)
    piece = image.piece - np.array([0.0, 0.0, nearer, nearer])
    return replace(image, piece=piece, roll=ROLL + roll)


@cache
def _mesh(name: str) -> trimesh.Trimesh:
    """Return the mesh of a ship or variant."""
    return ncti.ships.load(name, cache=cache_folder() / "meshes")
