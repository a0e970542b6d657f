"""Compiled loops of classifiers, and a small call that compiles them."""

from __future__ import annotations

import numpy as np

from ncti.machine_code import CompiledLoops


def _compile_loops() -> None:
    """Call both loops, which compiles them."""
    from ncti.classify.bands import densities, whiten

    whiten(np.ones((1, 1)), np.ones((1, 1)))
    densities(*(np.ones((1, 1)),) * 3, np.ones(1), np.ones(1), np.ones((1, 1)))


DENSITIES = CompiledLoops(
    "densities of range profiles",
    ("classify.whitening.solve_band", "classify.whitening.band_products"),
    _compile_loops,
)
