"""Compiled loops of classifiers, and a small call that compiles them."""

from __future__ import annotations

import numpy as np

from ncti.machine_code import Loops


def _whiten() -> None:
    """Whiten one column, which compiles the loop."""
    from ncti.classify.bands import whiten  # scipy takes long to import

    whiten(np.ones((1, 1)), np.ones((1, 1)))


DENSITIES = Loops("densities of range profiles", ("classify.whitening.solve_band",), _whiten)
