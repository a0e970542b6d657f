"""Shares of views identified among the first ships of a list, with resampled views."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

MIN_SHIPS = 4
"""Smallest number of ships."""

ARTICLE = ("duncan", "horne", "spruance", "texas")
"""Ships of the article's tables, the first of a list."""


def fleet_order(names: Sequence[str]) -> NDArray[np.intp]:
    """Return the (ship,) order in which ships join a fleet.

    Nominal ships come first, those of the article before others, then variants by their numbers.
    """

    def rank(index: int) -> tuple[list[int], int, str]:
        base, _, variant = names[index].partition("@")
        numbers = [int(number) for number in re.findall(r"\d+", variant)]
        article_rank = ARTICLE.index(base) if base in ARTICLE else len(ARTICLE)
        return numbers, article_rank, names[index]

    return np.array(sorted(range(len(names)), key=rank), dtype=np.intp)


def views_of_ships(tests: int, ships: int) -> list[int]:
    """Return the number of test views of each ship, enough for a fleet of any first ships.

    The n-th ship has the tests over n, rounded up, with at least `MIN_SHIPS` for n.
    """
    return [-(-tests // max(ship, MIN_SHIPS)) for ship in range(1, ships + 1)]


def bootstrap_uniforms(
    resamples: int, tests: int, ships: int, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return (ship, resample, test) numbers in [0, 1) that choose the views of bootstrap resamples.

    All settings share them, so that a figure derived from many settings is resampled consistently.
    """
    return rng.random((ships, resamples, views_of_ships(tests, 1)[0]), dtype=np.float32)


def fleet_shares(
    evidence: ArrayLike, tests: int, fleets: Sequence[int], uniforms: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (fleet,) and (fleet, resample) shares of views identified among the first n ships.

    `evidence` (sample, ship) is the log density of each measurement under each ship, ship by ship,
    as many as `views_of_ships` gives; `fleets` are the n; `uniforms` as of `bootstrap_uniforms`.
    Resamples draw the views of each ship with replacement.
    """
    values = np.asarray(evidence)
    rows = views_of_ships(tests, values.shape[1])
    start = np.concatenate([[0], np.cumsum(rows)])
    share, resampled = [], []
    for fleet in fleets:
        count = rows[fleet - 1]
        indices = (start[:fleet, None] + np.arange(count)).ravel()
        predicted = values[indices, :fleet].argmax(axis=1).reshape(fleet, count)
        right = predicted == np.arange(fleet)[:, None]
        drawn = (uniforms[:fleet, :, :count] * count).astype(np.intp)
        redrawn = np.take_along_axis(right[:, None, :], drawn, axis=2)
        share.append(right.mean())
        resampled.append(redrawn.mean(axis=(0, 2)))
    return np.array(share), np.array(resampled)
