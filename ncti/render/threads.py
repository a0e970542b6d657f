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
    crossings: Sequence[Any], *, surfaces: int
) -> tuple[NDArray[np.int32], Floats, NDArray[np.int32]]:
    """Return the pieces of all lines, swept in as many parts as there are threads.

    Parameters
    ----------
    crossings : (start, order, crossing)
        Crossings of lines with edges, as of `ncti.render.line_sweep.cross`.
    surfaces : int
        Number of surfaces.

    Returns
    -------
    line : (piece,) int32 ndarray
        Number of each piece's line, from the first line.
    piece : (piece, 4) float64 ndarray
        As of `ncti.render.LineImage`.
    surface : (piece,) int32 ndarray
        Surface that is seen.
    """
    from ncti.render.line_sweep import sweep

    start, order, crossing = crossings
    lines = len(start) - 1
    parts = max(1, min(thread_count(), lines // FEWEST))
    inner = np.searchsorted(start, np.arange(1, parts) * start[-1] // parts)
    cuts = [0, *inner.tolist(), lines]

    def part(number: int) -> tuple[NDArray[np.int64], Floats, NDArray[np.int32]]:
        room = 1
        while True:  # surfaces that run through one another make more pieces than crossings
            some = start[cuts[number] : cuts[number + 1] + 1]
            count, piece, surface = sweep(some, order, crossing, surfaces, room)
            if not len(count) or count[0] >= 0:
                return count, piece, surface
            room *= 4

    swept = [part(0)] if parts == 1 else list(_pool(parts, os.getpid()).map(part, range(parts)))
    counts, piece, surface = (
        found[0] if parts == 1 else np.concatenate(found) for found in zip(*swept, strict=True)
    )
    return np.repeat(np.arange(lines, dtype=np.int32), counts), piece, surface


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
