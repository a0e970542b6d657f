"""Parameters of simulated rows: values, lists, intervals and distributions to draw from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require_all

Floats = NDArray[np.float64]

BITS = 53  # of a float64 between 0 and 1
KINDS = "a number, a list of numbers, a tuple (low, high) or a frozen distribution of scipy.stats"


@dataclass(frozen=True)
class Bounds:
    """Values that a parameter may have: inclusive bounds, and whole numbers only if `whole`."""

    minimum: float = -math.inf
    maximum: float = math.inf
    whole: bool = False

    def check(self, name: str, values: Any) -> Floats:
        """Return values as an array, or raise `ValueError` for the first that is out of bounds."""
        return require_all(name, values, **vars(self))


def uniform_numbers(seed: int, key: int, numbers: NDArray[np.int64], columns: int) -> Floats:
    """Return (column, row) random numbers between 0 and 1, exclusive, keyed by seed, key and row.

    `numbers` (row,) are the rows' numbers, and `key` separates uses.
    """
    words = np.array(
        [
            np.random.SeedSequence(seed, spawn_key=(key, number)).generate_state(columns, np.uint64)
            for number in numbers.tolist()
        ],
        dtype=np.uint64,
    ).reshape(-1, columns)
    # Contiguous by column, so that functions of an array give the same bits for any length.
    return np.ascontiguousarray(((words >> np.uint64(64 - BITS)).T + 0.5) * 2.0**-BITS)


def sampler(name: str, given: Any, bounds: Bounds) -> Callable[[Floats], Floats]:
    """Return the function that turns (row,) uniform random numbers into values of a parameter.

    `given` is a value; a list of equally probable values; a tuple (low, high), an interval to draw
    from uniformly, with both ends included for whole numbers; or a distribution of `scipy.stats`,
    inverted by its `ppf`. Values out of bounds raise `ValueError`.
    """
    inverse = getattr(given, "ppf", None)
    if callable(inverse):
        return lambda uniform: bounds.check(name, _quantiles(name, inverse, uniform))
    values = bounds.check(name, given)
    if values.ndim > 1 or not values.size or (isinstance(given, tuple) and values.size != 2):
        raise ValueError(f"{name} is {given!r:.60}, but must be {KINDS}")
    if not isinstance(given, tuple):
        choices = values.reshape(-1)
        return lambda uniform: choices[(uniform * len(choices)).astype(np.intp)]
    low, high = values.tolist()
    if low > high:
        raise ValueError(f"{name} is {given!r:.60}, but must be a tuple (low, high), low first")
    if bounds.whole:
        return lambda uniform: low + np.floor(uniform * (high - low + 1))
    return lambda uniform: low + uniform * (high - low)


def _quantiles(name: str, inverse: Callable[[Floats], Any], uniform: Floats) -> Floats:
    """Return quantiles of a distribution, or raise `ValueError` if it lacks parameters."""
    try:
        return np.asarray(inverse(uniform), dtype=np.float64)
    except TypeError as error:
        raise ValueError(f"{name} is a distribution without its parameters: {error}") from error
