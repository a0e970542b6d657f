"""Repeated sweeps by seed, and the interval of a mean over seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from docs._tables.sweeping import WORKERS, sweep_groups
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.stages.classifier import draw_aspects

LEVEL = 0.95
MIN_VIEWS = 10  # views, right or wrong, below which Student's t covers too little

Floats = NDArray[np.float64]
Array = TypeVar("Array", xr.DataArray, xr.Dataset)


@dataclass(frozen=True)
class Interval:
    """Mean of a figure over seeds, with an interval that covers its mean over all seeds."""

    mean: float
    low: float
    high: float

    def text(self, digits: int = 0, sign: str = "") -> str:
        """Return the figures as in `79 [78-81]`; a sign is shown with `+`."""
        mean, low, high = (
            f"{figure:{sign}.{digits}f}" for figure in (self.mean, self.low, self.high)
        )
        return f"{mean} [{low} to {high}]" if sign else f"{mean} [{low}-{high}]"


def mean_over_seeds(
    values: ArrayLike, *, views: int | None = None, bounds: tuple[float, float] = (0.0, 100.0)
) -> Interval:
    """Return the mean over seeds and its 95 % interval.

    Parameters
    ----------
    values : (seed,) array_like
        A figure of each seed, such as percent correct; at least two.
    views : int, optional
        Number of views of each seed that the figure is a percentage of. If all seeds agree, or
        nearly so, their scatter is no measure of the error: the interval then reaches at least as
        far as Wilson's interval of all views.
    bounds : (low, high) tuple of float, default=(0.0, 100.0)
        Limits of the figure.

    Returns
    -------
    Interval
        Student's t interval: seeds redraw aspects and noise and are independent, so what the
        draws of a seed share is in their scatter.
    """
    seeds = np.asarray(values, dtype=np.float64)
    mean = float(seeds.mean())
    error = float(seeds.std(ddof=1)) / np.sqrt(seeds.size)
    reach = float(stats.t.isf((1 - LEVEL) / 2, seeds.size - 1)) * error
    low, high = mean - reach, mean + reach
    if views is not None:
        share, count = mean / 100, views * seeds.size
        if min(share, 1 - share) * count < MIN_VIEWS:
            z = stats.norm.isf((1 - LEVEL) / 2)
            centre = (share + z**2 / (2 * count)) / (1 + z**2 / count)
            half = z * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
            half /= 1 + z**2 / count
            low = min(low, 100 * (centre - half))
            high = max(high, 100 * (centre + half))
    return Interval(mean, max(low, bounds[0]), min(high, bounds[1]))


def list_argument(values: Sequence[float]) -> str:
    """Return numbers as a list of a command line."""
    return f"[{','.join(f'{value:.10g}' for value in values)}]"


def aspects_of(learned: Sequence[float], fresh: int, seed: int) -> list[float]:
    """Return the random aspects of a seed between the ends of the learned ones."""
    drawn = draw_aspects(min(learned), max(learned), fresh, seed)
    return sorted(set(drawn) - set(learned))


def sweep_by_seed(
    overrides: Sequence[str],
    groups: Sequence[str],
    *,
    seeds: int,
    learned: Sequence[float],
    fresh: int,
    label: str,
    workers: ClusterChoice = WORKERS,
) -> list[dict[str, xr.Dataset]]:
    """Return groups of a sweep over the random aspects of several seeds, split by seed.

    One sweep has the aspects of all seeds, so that learned views and templates are made once. Each
    view has noise of its own, so the seeds are independent of one another.

    Parameters
    ----------
    overrides, groups, label, workers
        See `sweep_groups`.
    seeds : int
        Number of seeds, from 0.
    learned : sequence of float
        Aspects learned [deg].
    fresh : int
        Number of random aspects of a seed in every 30 degrees.

    Returns
    -------
    list of dict of str to Dataset
        For each seed, the groups at the learned aspects and at its own.
    """
    tests = [aspects_of(learned, fresh, seed) for seed in range(seeds)]
    aspects = sorted(set(learned).union(*tests))
    chosen = [
        f"grid.aspect={list_argument(aspects)}",
        f"classifier.training_aspect={list_argument(learned)}",
    ]
    by_group = sweep_groups([*overrides, *chosen], groups, label=label, workers=workers)
    return [
        {
            name: dataset.isel(aspect=np.isin(dataset.aspect.values, [*learned, *aspects_tested]))
            for name, dataset in by_group.items()
        }
        for aspects_tested in tests
    ]


def sweep_each_seed(
    overrides: Sequence[str],
    groups: Sequence[str],
    *,
    seeds: int,
    learned: Sequence[float],
    fresh: int,
    label: str,
    workers: ClusterChoice = WORKERS,
) -> list[dict[str, xr.Dataset]]:
    """Return the groups of `sweep_by_seed` from one sweep per seed, which also redraws training."""
    aspects = (f"grid.aspect={list_argument(learned)}", f"grid.random_aspects={fresh}")
    return [
        sweep_groups(
            [*overrides, *aspects, f"seed={seed}"],
            groups,
            label=f"{label}, seed {seed}",
            workers=workers,
        )
        for seed in range(seeds)
    ]


def percent_of(correct: xr.DataArray, where: NDArray[np.bool_]) -> float:
    """Return the percentage of (..., ship, aspect) answers that are right at some aspects.

    Views with a negative answer were not asked.
    """
    right = correct.isel(aspect=np.flatnonzero(where))
    return float(xr.where(right >= 0, 100.0 * (right == 1), np.nan).mean())


def bins_of(aspect: ArrayLike, width: float = 30.0) -> dict[str, NDArray[np.bool_]]:
    """Return masks of aspects by bin: three of 30 degrees, and all together."""
    angles = np.asarray(aspect, dtype=np.float64)
    index = np.minimum(angles // width, 2)
    return {
        "0-30°": index == 0,
        "30-60°": index == 1,
        "60-90°": index == 2,
        "overall": np.ones(angles.shape, dtype=bool),
    }


def multiples_mask(aspect: ArrayLike, step: float) -> NDArray[np.bool_]:
    """Return the mask of aspects that are multiples of a step, as the learned ones are."""
    steps = np.asarray(aspect, dtype=np.float64) / step
    return np.isclose(steps, np.round(steps), rtol=0, atol=1e-6)


def pick(answers: Array, **places: object) -> Array:
    """Return answers at values of axes; axes without a dimension are ignored."""
    return answers.sel({name: value for name, value in places.items() if name in answers.dims})
