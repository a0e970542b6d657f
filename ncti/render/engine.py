"""Interface of rendering engines."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ncti.render.solid import Solid
from ncti.render.view import Lattice, View


class EngineError(RuntimeError):
    """Error of a rendering engine that cannot run here; its message names what to install.

    See Also
    --------
    available_engines : Names of engines that can run here.

    Examples
    --------
    >>> from ncti.render import EngineError
    >>> raise EngineError("render engine egl cannot run here, because ...")
    Traceback (most recent call last):
    ncti.render.engine.EngineError: render engine egl cannot run here, because ...
    """


class Engine(Protocol):
    """Rendering engine: finds the facet of a ship behind each pixel centre.

    An engine does nothing else: the same code (`ncti.render.solid.surface`) computes range and
    slope from the facets of all engines in float64, so that they do not depend on an engine's
    arithmetic. Facets that face away from the sensor are invisible.
    """

    def visible(
        self, solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
    ) -> NDArray[np.float32] | NDArray[np.int32]:
        """Return the (row * col,) facets that pixels see, as rows of `solid.faces`; -1 for none.

        `points` (3, vertex) are vertices along the axes of the view, from the ship origin [m].
        """
        ...
