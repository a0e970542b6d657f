"""Registration of the compiled loop of tilts, with a small call that compiles it."""

from __future__ import annotations

import numpy as np

from ncti.irar.tilt import tilts
from ncti.machine_code import CompiledLoops


def _tilt() -> None:
    """Call the loop on a tiny image."""
    ship = np.pad(np.ones((8, 16)), 8)
    tilts(ship, np.kron(ship, np.ones((4, 4))))


TILTS = CompiledLoops("tilts", ("irar.seen.add_looks",), _tilt)
