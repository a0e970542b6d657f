"""Plain version of the Adaptive Clustering Network's rule as the article prints it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def plain_network(X, vigilance, learning_rate, max_passes=100):
    """Return categories, assignments, passes and convergence, recomputing every norm."""
    traces: list[NDArray[np.float64]] = []
    assigned = [-1] * len(X)
    for n_passes in range(1, max_passes + 1):
        previous = list(assigned)
        for i, x in enumerate(X):
            rho = [x @ w / (np.linalg.norm(x) * np.linalg.norm(w)) for w in traces]
            if rho and max(rho) > vigilance:
                k = rho.index(max(rho))
                traces[k] = traces[k] + (x - traces[k]) * learning_rate
            else:
                k = len(traces)
                traces.append(x)
            assigned[i] = k
        if assigned == previous:
            return np.array(traces), assigned, n_passes, True
    return np.array(traces), assigned, max_passes, False
