"""Distribution of lines among threads; the result does not depend on their number."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.processors import processor_count

Floats = NDArray[np.float64]

MIN_LINES = 64
"""Fewest lines per thread."""


def sweep_lines(
    crossings: Sequence[Any], *, surfaces: int, every: int = 0, kept_line: int = 0
) -> tuple[NDArray[np.int32], Floats, NDArray[np.int32]]:
    """Return line, piece and surface of the pieces of all lines, one part of the lines per thread.

    `crossings` are as of `find_crossings` in `ncti.render.line_sweep`, and pieces as of `sweep`.
    """
    from ncti.render.line_sweep import sweep

    lowest, start, crossing = crossings
    lines = len(start) - 1
    parts = max(1, min(thread_count(), lines // MIN_LINES))
    inner = np.searchsorted(start, np.arange(1, parts) * start[-1] // parts)
    cuts = [0, *inner.tolist(), lines]

    def sweep_part(number: int) -> tuple[NDArray[np.int32], Floats, NDArray[np.int32]]:
        first, last = cuts[number], cuts[number + 1]
        room = 1
        while True:  # intersecting surfaces make more pieces than crossings
            complete, line, piece, surface = sweep(
                start[first : last + 1],
                crossing,
                surfaces,
                room,
                np.int64(lowest + first),
                np.int64(every),
                np.int64(kept_line),
            )
            if complete:
                return line, piece, surface
            room *= 4

    if parts == 1:
        return sweep_part(0)
    results = zip(*_pool(parts, os.getpid()).map(sweep_part, range(parts)), strict=True)
    line, piece, surface = (np.concatenate(parts_of) for parts_of in results)
    return line, piece, surface


def thread_count() -> int:
    """Return the number of threads: OMP_NUM_THREADS, or the number of the process's processors."""
    setting = os.environ.get("OMP_NUM_THREADS", "")
    if setting.isdigit() and int(setting):
        return int(setting)
    return processor_count()


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Return a pool of threads of this process, since threads do not survive a fork."""
    return ThreadPoolExecutor(threads, thread_name_prefix="lines")
