"""Random streams, keyed by the cell, never by the worker or the order."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np

# Part of all keys, since a stage without `rng` may call `cell_rng`. Raise it with any change of
# `cell_rng` or of `Plan.stream`.
STREAM_VERSION = 1


def cell_rng(seed: int, **cell: Any) -> np.random.Generator:
    """Return the generator of one cell's noise, independent of every other cell's.

    `cell` names it by text, numbers, flags, times or None (values, not positions in a grid),
    so that a cell draws the same noise in any grid. The sweep's `seed` is at least 0.
    """
    name = json.dumps(cell, sort_keys=True, default=str).encode()
    words = np.frombuffer(hashlib.sha256(name).digest(), dtype="<u4")
    sequence = np.random.SeedSequence(seed, spawn_key=words.tolist())
    return np.random.Generator(np.random.PCG64(sequence))
