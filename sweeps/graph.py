"""The wiring of a sweep: which task follows which. Nothing is computed here."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps import store
from sweeps.axes import CELL, CELL_INFRARED, OPTIONAL
from sweeps.classification import classify_profiles, classify_silhouettes
from sweeps.classifier_schema import ClassifierConfig
from sweeps.cluster import Executor
from sweeps.flight_variables import CELL_MEASURED, KINDS, MEASURED, TABLES_MEASURED, VALIDATION
from sweeps.flights import view_flights
from sweeps.fusion import name_by_both, place_of
from sweeps.grid import ship_label
from sweeps.infrared import view_images
from sweeps.measured import name_measured
from sweeps.naming import Profiles, name_by_correlation, name_by_likelihood, name_by_network
from sweeps.rejection import tabulate_rejection
from sweeps.schema import INFRARED, IRAR, RANGE, SweepConfig
from sweeps.seeds import cell_rng
from sweeps.stages import Ship, View, ViewPlan, view_profiles
from sweeps.tabulation import (
    tabulate_answers,
    tabulate_images,
    tabulate_profiles,
    tabulate_silhouettes,
)
from sweeps.variables import (
    ACN,
    ACN_INFRARED,
    ANSWERS,
    DETECTION,
    FAILED,
    IMAGES,
    PROFILES,
    RECONSTRUCTION,
    REJECTION,
    TABLES_INFRARED,
    TABLES_OF,
)


@dataclass(frozen=True)
class Failure:
    """A task that failed: what it was to do, and why it could not."""

    what: str
    why: str


def run_views(
    executor: Executor,
    ships: tuple[Ship, ...],
    config: SweepConfig,
    plan: ViewPlan,
    path: Path,
) -> Iterator[Failure | None]:
    """Measure every view that the store lacks; yields once a view, with its failure if any."""
    aspects = config.grid.expand().aspect
    todo = np.argwhere(~store.views_done(path)).tolist()
    tasks = [(path, i, j, ships[i], aspects[j], plan) for i, j in todo]
    for (_, i, j, ship, aspect, _), _, error in executor.run(_measure_view, tasks):
        if error is None:
            yield None
        else:
            store.mark_view(path, i, j, FAILED)
            yield Failure(f"ship={ship.label} aspect={aspect:g}", _reason(error))


def run_classification(
    executor: Executor, config: SweepConfig, path: Path
) -> Iterator[Failure | None]:
    """Train and test in every cell; yields once a cell, with its failure if any."""
    shared = (config.classifier, path)
    grid = config.grid.expand()
    silhouettes = config.infrared.expand(grid)
    learned = config.learned()
    tasks: list[tuple[Any, ...]] = []
    for cell in cells(config):
        if cell.group == ACN:
            tasks.append((_classify_profiles, cell, *shared, learned, grid.vigilance))
        elif cell.group == ACN_INFRARED:
            orders = presentation_orders(config)
            vigilances = silhouettes.vigilance
            tasks.append((_classify_silhouettes, cell, *shared, learned, vigilances, orders))
        elif cell.group == MEASURED:
            tasks.append((_name_measured, cell, *shared, config))
        else:
            tasks.append((_name_profiles, cell, *shared, config))
    for (_, cell, *_), _, error in executor.run(_call, tasks):
        if error is None:
            yield None
        else:
            store.mark_cell(path, cell.group, cell.index, FAILED)
            yield Failure(f"classification of {cell.name}", _reason(error))


@dataclass(frozen=True)
class Cell:
    """What one task classifies.

    Attributes
    ----------
    group : str
        Group of the store that its answers go to.
    place : mapping of str to int
        Its place on the axes that the group's chunks are cut along.
    index : tuple of int
        The same on those axes that are dimensions of the store.
    values : mapping of str to float or str
        What stands there on those axes, whatever else the grid holds.
    name : str
        What to call it.
    """

    group: str
    place: Mapping[str, int]
    index: tuple[int, ...]
    values: Mapping[str, float | str]
    name: str


def cells(config: SweepConfig) -> list[Cell]:
    """Every cell that is classified, those of the range channel first."""
    grid = config.grid.expand()
    axes: dict[str, dict[str, Any]] = {
        RANGE: asdict(grid) | {"target_free_ifovs": config.ladar.floor_axis()},
        INFRARED: asdict(config.infrared.expand(grid)),
        IRAR: asdict(grid) | asdict(config.irar.expand()),
    }
    found = []
    names = config.classifiers
    groups: list[tuple[str, str, tuple[str, ...]]]
    groups = [(RANGE, ANSWERS[name], CELL) for name in names]
    groups += [(INFRARED, ACN_INFRARED, CELL_INFRARED)] if "acn" in names else []
    groups += [(IRAR, MEASURED, CELL_MEASURED)]
    for sensor, group, cut in (entry for entry in groups if entry[0] in config.sensors):
        lines = [list(enumerate(axes[sensor][name])) for name in cut]
        several = [name not in OPTIONAL or len(axes[sensor][name]) > 1 for name in cut]
        for points in product(*lines):
            named = [(name, *point) for name, point in zip(cut, points, strict=True)]
            kept = [item for item, shown in zip(named, several, strict=True) if shown]
            shown = (f"{name}={_shown(value)}" for name, _, value in kept)
            found.append(
                Cell(
                    group,
                    {name: index for name, index, _ in named},
                    tuple(index for _, index, _ in kept),
                    {name: value for name, _, value in named},
                    " ".join([group.rpartition("/")[2], *shown]),
                )
            )
    return found


def presentation_orders(config: SweepConfig) -> list[NDArray[np.intp]]:
    """Orders in which views are presented in training: the grid's own, then random ones."""
    grid = config.grid.expand()
    views = len(grid.ship) * len(grid.aspect)
    _, *others = config.infrared.expand(grid).order
    return [
        np.arange(views),
        *(
            cell_rng(config.seed, stage="presentation_order", order=order).permutation(views)
            for order in others
        ),
    ]


def write_tables(config: SweepConfig, path: Path) -> None:
    """Tabulate what is classified into the store."""
    tables = {}
    known = np.flatnonzero(config.learned().any(axis=1))
    names = config.classifiers
    if RANGE in config.sensors:
        for name in names:
            # Unknown ships cannot be named right: see `tables/rejection_...`.
            classified = store.read_group(path, ANSWERS[name]).load().isel(ship=known)
            table = (tabulate_profiles if name == "acn" else tabulate_answers)(classified)
            tables[TABLES_OF[name]] = table.assign_attrs(receiver=config.ladar.receiver)
    if INFRARED in config.sensors:
        if "acn" in names:
            named = store.read_group(path, ACN_INFRARED).load().isel(ship=known)
            silhouettes = tabulate_silhouettes(named)
            tables[TABLES_INFRARED] = silhouettes
        images = store.read_group(path, IMAGES)[["detection_probability", "reconstruction_error"]]
        tables[DETECTION], tables[RECONSTRUCTION] = tabulate_images(images.load())
    if IRAR in config.sensors:
        classified = store.read_group(path, MEASURED).load()
        flown = _flown(config)
        tables[TABLES_MEASURED] = tabulate_answers(
            classified.isel(ship=[ship for ship in known if flown[ship]])
        )
    learned = config.learned()
    if not learned.all():
        vigilances = config.classifier.expand().test_vigilance
        for answers, rejection in REJECTION.values():
            if store.has_group(path, answers):
                named = store.read_group(path, answers).load()
                tables[rejection] = tabulate_rejection(named, learned, vigilances)
    store.write_tables(path, tables)


def _measure_view(path: Path, i: int, j: int, ship: Ship, aspect: float, plan: ViewPlan) -> None:
    """Let every sensor look at one view; they share its images."""
    view = View(ship, aspect, plan)
    measured = {}
    if RANGE in plan.sensors:
        measured[PROFILES] = view_profiles(view)
    if INFRARED in plan.sensors:
        measured[IMAGES] = view_images(view)
    if IRAR in plan.sensors:
        measured[VALIDATION] = view_flights(view)
    store.write_view(path, i, j, measured)


def _call(function: Callable[..., None], *arguments: Any) -> None:
    function(*arguments)


def _classify_profiles(
    cell: Cell,
    classifier: ClassifierConfig,
    path: Path,
    learned: NDArray[np.bool_],
    vigilances: tuple[float, ...],
) -> None:
    expected, averaged = store.read_profiles(path, cell.place)
    there = store.views_done(path)
    answers = classify_profiles(
        expected, averaged, there, learned=learned, vigilances=vigilances, classifier=classifier
    )
    asked = (answers["correct"] >= 0) | ~there
    store.write_cell(path, cell.group, cell.index, answers, asked=asked)


def _classify_silhouettes(
    cell: Cell,
    classifier: ClassifierConfig,
    path: Path,
    learned: NDArray[np.bool_],
    vigilances: tuple[float, ...],
    orders: list[NDArray[np.intp]],
) -> None:
    template, silhouette = store.read_silhouettes(path, cell.place)
    there = store.views_done(path)
    answers = classify_silhouettes(
        template,
        silhouette,
        there,
        learned=learned,
        orders=orders,
        vigilances=vigilances,
        classifier=classifier,
    )
    asked = (answers["correct"] >= 0) | ~there
    store.write_cell(path, cell.group, cell.index, answers, asked=asked)


def _name_profiles(
    cell: Cell, classifier: ClassifierConfig, path: Path, config: SweepConfig
) -> None:
    """Let a classifier other than the Adaptive Clustering Network name ships in one cell."""
    expected, averaged = store.read_profiles(path, cell.place)
    there = store.views_done(path)
    grid = config.grid.expand()
    profiles = Profiles(
        expected[there],
        averaged[:, :, there],
        there,
        np.array(grid.aspect),
        grid.frame_count,
        config.learned(),
    )
    if cell.group == ANSWERS["mnn"]:
        rng = cell_rng(config.seed, stage="mnn", **cell.values)
        seed = int(rng.integers(2**32))
        answers = name_by_network(profiles, classifier=classifier, random_state=seed)
    elif cell.group == ANSWERS["correlation"]:
        answers = name_by_correlation(profiles, classifier=classifier)
    elif cell.group == ANSWERS["fusion"]:
        answers = _name_by_both(profiles, cell, path, config)
    else:
        covariance = store.read_covariance(path, cell.place)[there]
        answers = name_by_likelihood(profiles, covariance, classifier=classifier)
    store.write_cell(path, cell.group, cell.index, answers)


def _name_measured(
    cell: Cell, classifier: ClassifierConfig, path: Path, config: SweepConfig
) -> None:
    """Let every classifier that can name measured profiles in one cell."""
    grid = config.grid.expand()
    rng = cell_rng(config.seed, stage="mnn", **cell.values)
    answers = name_measured(
        store.read_signatures(path, cell.place),
        store.views_done(path),
        aspects=grid.aspect,
        learned=config.learned(),
        names=config.classifiers,
        vigilances=grid.vigilance,
        classifier=classifier,
        random_state=int(rng.integers(2**32)),
    )
    synthetic = np.array([kind != "measured" for kind in KINDS])
    asked = (synthetic[:, None] | _flown(config))[:, :, None]
    store.write_cell(path, cell.group, cell.index, answers, asked=asked)


def _flown(config: SweepConfig) -> NDArray[np.bool_]:
    """(ship,): whether each is flown past."""
    labels = tuple(ship_label(name) for name in config.grid.expand().ship)
    return np.isin(labels, config.irar.flies(labels))


def _name_by_both(
    profiles: Profiles, cell: Cell, path: Path, config: SweepConfig
) -> dict[str, NDArray[Any]]:
    grid = config.grid.expand()
    infrared = config.infrared.expand(grid)
    place = place_of(grid.range, infrared.range, cell.place)
    template, silhouette = store.read_silhouettes(path, place)
    there = profiles.there
    features = template.shape[-2] * template.shape[-1]
    # (view, phase, ...) to (phase, ..., view, feature)
    templates = np.swapaxes(template[there].reshape(len(profiles.ship), -1, features), 0, 1)
    seen = silhouette[there]
    seen = np.moveaxis(seen.reshape(*seen.shape[:4], features), 0, 3)
    return name_by_both(
        profiles,
        store.read_covariance(path, cell.place)[there],
        templates,
        seen,
        gain_sigma=config.classifier.expand().gain_sigma,
        nugget=config.classifier.nugget,
    )


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _reason(error: Exception) -> str:
    """An exception in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
