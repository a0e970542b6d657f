"""What a rendering engine is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ncti.render.solid import Solid
from ncti.render.view import Lattice, View


class EngineError(RuntimeError):
    """A rendering engine cannot run here."""


class Engine(Protocol):
    """What sees which facet of a ship lies behind each pixel centre.

    That is all an engine is asked: the range and the slope of what is seen follow from the
    facets in float64, once for all engines (`ncti.render.solid.surface`), so that no engine's
    arithmetic is in them.

    Attributes
    ----------
    from_behind : bool
        Whether it also sees facets from behind: as rays do, where two of opposite winding coincide.
    """

    from_behind: bool

    def visible(
        self, solid: Solid, view: View, lattice: Lattice, points: NDArray[np.float64]
    ) -> NDArray[np.float32] | NDArray[np.int32]:
        """The facet that each pixel sees.

        Parameters
        ----------
        solid, view, lattice
            What is seen, from where, and by which pixels.
        points : (3, vertex) float64 ndarray
            Vertices along the axes of the view, from the ship origin [m].

        Returns
        -------
        (row * col,) float32 or int32 ndarray
            Index into `solid.faces` of the facet nearest to the sensor; -1 where there is none.
        """
        ...
