"""Random streams keyed by the cell they serve, never by the worker or the order."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np


def cell_rng(seed: int, **cell: Any) -> np.random.Generator:
    """Generator of one cell's noise.

    Parameters
    ----------
    seed : int
        The sweep's seed, at least 0.
    **cell : str, number, bool or None
        What names the cell. The values are the key, not their places in a grid, so a cell
        draws the same noise whatever else the grid holds.

    Returns
    -------
    numpy.random.Generator
        A stream independent of every other cell's.
    """
    name = json.dumps(cell, sort_keys=True).encode()
    words = np.frombuffer(hashlib.sha256(name).digest(), dtype="<u4")
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=words.tolist()))
