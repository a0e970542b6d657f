"""Interleaved timing of functions, so that other load affects all of them equally."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

MIN_ROUNDS = 3
"""Least number of rounds, whatever the limit."""


def time_in_turn(
    calls: Sequence[Callable[[], object]], *, repeats: int, limit: float = np.inf
) -> NDArray[np.float64]:
    """Return processor times of calls, forwards and backwards, after an uncounted round.

    Parameters
    ----------
    calls : sequence of callable
        Functions to time.
    repeats : int
        Number of rounds.
    limit : float
        Time after which no further round begins, except the first three [s].

    Returns
    -------
    (round, call) float64 ndarray
        Times [s].
    """
    seconds = np.empty((repeats + 1, len(calls)))
    for turn in range(repeats + 1):
        if turn > MIN_ROUNDS and seconds[:turn].sum() >= limit:
            return seconds[1:turn]
        for k, call in list(enumerate(calls))[:: (-1) ** turn]:
            start = time.process_time()
            call()
            seconds[turn, k] = time.process_time() - start
    return seconds[1:]


@contextmanager
def patch_constant(module: Any, name: str, value: Any) -> Iterator[None]:
    """Set a module's constant within this context."""
    original = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, original)
