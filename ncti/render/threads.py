"""Lines shared out among threads; the result does not depend on their number."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FEWEST = 64
"""Fewest lines of a thread."""


def swept(
    crossings: Sequence[Any], *, surfaces: int, every: int = 0, kept: int = 0
) -> tuple[NDArray[np.int32], Floats, NDArray[np.int32]]:
    """Return line, piece and surface of the pieces of all lines, swept by as many parts as threads.

    `crossings` are those of `cross`; the results those of `sweep` in `ncti.render.line_sweep`.
    """
    from ncti.render.line_sweep import sweep

    lowest, start, crossing = crossings
    lines = len(start) - 1
    parts = max(1, min(thread_count(), lines // FEWEST))
    inner = np.searchsorted(start, np.arange(1, parts) * start[-1] // parts)
    cuts = [0, *inner.tolist(), lines]

    def part(number: int) -> tuple[NDArray[np.int32], Floats, NDArray[np.int32]]:
        first, last = cuts[number], cuts[number + 1]
        room = 1
        while True:  # surfaces that run through one another make more pieces than crossings
            whole, line, piece, surface = sweep(
                start[first : last + 1],
                crossing,
                surfaces,
                room,
                np.int64(lowest + first),
                np.int64(every),
                np.int64(kept),
            )
            if whole:
                return line, piece, surface
            room *= 4

    if parts == 1:
        return part(0)
    each = zip(*_pool(parts, os.getpid()).map(part, range(parts)), strict=True)
    line, piece, surface = (np.concatenate(parts_of) for parts_of in each)
    return line, piece, surface


def thread_count() -> int:
    """Return the number of threads: that of OMP_NUM_THREADS, or of the process's processors."""
    given = os.environ.get("OMP_NUM_THREADS", "")
    if given.isdigit() and int(given):
        return int(given)
    affinity = getattr(os, "sched_getaffinity", None)  # Linux has it
    return len(affinity(0)) if affinity else os.cpu_count() or 1


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Return a pool of threads of this process, since threads do not survive a fork."""
    return ThreadPoolExecutor(threads, thread_name_prefix="lines")
