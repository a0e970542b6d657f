"""Random test aspects, absent from training.

Ships at sea are at any aspect. A classifier tested only at its training aspects, as in the article,
appears better than it is.
"""

from __future__ import annotations

import numpy as np

from ncti.evaluate.scores import BIN_WIDTH
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.seeds import cell_rng
from sweeps.engine.settings import Choices, Run, Settings, count

DIGITS = 3  # of a drawn aspect [deg]: 2 mm at the end of a ship


class Fresh(Settings, key="grid"):
    """Random test aspects."""

    fresh = count(
        0,
        0,
        10_000,
        label="random test aspects in every 30 degrees, absent from training",
        help="added to grid.aspect, between its ends, by the seed",
        fixed="all of them are tested together",
    )


def drawn_aspects(low: float, high: float, number: int, seed: int) -> tuple[float, ...]:
    """Return aspects [deg] drawn uniformly between two ends, `number` in every 30 degrees.

    The first aspects of a bin are the same for any number, and independent of other bins.
    """
    found: list[float] = []
    for start in np.arange(BIN_WIDTH * (low // BIN_WIDTH), high, BIN_WIDTH):
        share = cell_rng(seed, stage="fresh_aspects", start=float(start)).random(number)
        first, last = max(low, start), min(high, start + BIN_WIDTH)
        found += np.round(first + share * (last - first), DIGITS).tolist()
    return tuple(found)


def fresh_aspects(choices: Choices, grid: tuple[float, ...]) -> tuple[float, ...]:
    """Return the aspects [deg] of a sweep that are drawn at random, between the ends of a grid's.

    Raises
    ------
    ConfigurationError
        If there is nothing to draw between.
    """
    number = choices.one(Fresh.fresh)
    if number and len(grid) < 2:
        raise ConfigurationError(
            f"grid.fresh is {number}, but must be 0 where grid.aspect has one value: aspects are "
            "drawn between its ends"
        )
    return drawn_aspects(grid[0], grid[-1], number, choices.one(Run.seed)) if number else ()
