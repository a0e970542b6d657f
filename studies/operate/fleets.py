"""Shares of views identified among the first ships of a list, with resampled views."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ncti.checks import require

LEAST = 4
"""Smallest number of ships."""

ARTICLE = ("duncan", "horne", "spruance", "texas")
"""Ships of the article's tables, the first of a list."""


def fleet_order(names: Sequence[str]) -> NDArray[np.intp]:
    """Return the order of ships in a list whose first ones are told apart.

    Parameters
    ----------
    names : sequence of str
        Names of ships, of variants as `duncan@0.7` and `duncan@0.7x4`.

    Returns
    -------
    (ship,) intp ndarray
        Places of the names: nominal ships first, those of the article before others; then the
        variants of each number in the same order.

    Examples
    --------
    >>> from studies.operate import fleet_order
    >>> names = ["connole", "connole@0.1", "duncan", "duncan@0.1", "texas"]
    >>> [names[k] for k in fleet_order(names)]
    ['duncan', 'texas', 'connole', 'duncan@0.1', 'connole@0.1']
    """

    def rank(place: int) -> tuple[list[int], int, str]:
        base, _, variant = names[place].partition("@")
        numbers = [int(number) for number in re.findall(r"\d+", variant)]
        first = ARTICLE.index(base) if base in ARTICLE else len(ARTICLE)
        return numbers, first, names[place]

    return np.array(sorted(range(len(names)), key=rank), dtype=np.intp)


def views_of_ships(tests: int, ships: int) -> list[int]:
    """Return the number of tests of each ship, such that any first ships have enough.

    Parameters
    ----------
    tests : int
        Number of tests of the first n ships, for every n from `LEAST`.
    ships : int
        Number of ships.

    Returns
    -------
    list of int
        The n-th ship has the tests over n, rounded up.

    Raises
    ------
    ValueError
        If a number is below 1.

    See Also
    --------
    fleet_shares : Uses them.

    Examples
    --------
    >>> from studies.operate import views_of_ships
    >>> views_of_ships(20, 6)
    [5, 5, 5, 5, 4, 4]
    """
    require("tests", tests, minimum=1, whole=True)
    require("ships", ships, minimum=1, whole=True)
    return [-(-tests // max(ship, LEAST)) for ship in range(1, ships + 1)]


def bootstrap_places(
    resamples: int, tests: int, ships: int, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return (ship, resample, test) numbers in [0, 1) that choose the views of resamples.

    The same numbers serve all settings, so that resamples of different settings are of the same
    views: a figure derived from many settings is derived from each resample.

    Parameters
    ----------
    resamples, tests, ships : int
        Numbers of resamples, of tests as for `views_of_ships`, and of ships.
    rng : numpy.random.Generator
        Source of all random numbers.

    See Also
    --------
    fleet_shares : Takes them.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.operate import bootstrap_places
    >>> bootstrap_places(100, 256, 6, np.random.default_rng(0)).shape
    (6, 100, 64)
    """
    return rng.random((ships, resamples, views_of_ships(tests, 1)[0]), dtype=np.float32)


def fleet_shares(
    evidence: ArrayLike, tests: int, fleets: Sequence[int], places: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the share of views identified among the first n ships, and those of resampled views.

    Parameters
    ----------
    evidence : (sample, ship) array_like
        Log density of each measurement under each ship; samples ship by ship, as many as
        `views_of_ships` says.
    tests : int
        As for `views_of_ships`.
    fleets : sequence of int
        Numbers of ships n, from `LEAST` to all.
    places : (ship, resample, test) float32 ndarray
        As of `bootstrap_places`.

    Returns
    -------
    share : (fleet,) float64 ndarray
        Views whose own ship has the most evidence among the first n, over all; as many views of
        each ship, ``ceil(tests / n)``.
    resampled : (fleet, resample) float64 ndarray
        The same of views drawn with replacement, ship by ship.

    Raises
    ------
    ValueError
        If a number of ships is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.operate import bootstrap_places, fleet_shares
    >>> evidence = np.eye(4)
    >>> evidence[3] = 1, 0, 0, 0
    >>> share, resampled = fleet_shares(
    ...     evidence, 4, [4], bootstrap_places(5, 4, 4, np.random.default_rng(0))
    ... )
    >>> share.tolist(), resampled.shape
    ([0.75], (1, 5))
    """
    values = np.asarray(evidence)
    rows = views_of_ships(tests, values.shape[1])
    start = np.concatenate([[0], np.cumsum(rows)])
    share, resampled = [], []
    for fleet in fleets:
        require("fleets", fleet, minimum=LEAST, maximum=values.shape[1], whole=True)
        each = rows[fleet - 1]
        which = (start[:fleet, None] + np.arange(each)).ravel()
        named = values[which, :fleet].argmax(axis=1).reshape(fleet, each)
        right = named == np.arange(fleet)[:, None]
        drawn = (places[:fleet, :, :each] * each).astype(np.intp)
        again = np.take_along_axis(right[:, None, :], drawn, axis=2)
        share.append(right.mean())
        resampled.append(again.mean(axis=(0, 2)))
    return np.array(share), np.array(resampled)
