"""Mesh of a ship without trimesh, which takes longer to import than a view takes to draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class ShipMesh:
    """Lightweight mesh of a ship: views read its vertices, faces and hash.

    `vertices` (n, 3) [m] are in ship axes, `faces` (m, 3) counter-clockwise from outside.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    metadata: dict[str, Any]

    def __hash__(self) -> int:
        return hash(self.metadata["digest"])  # equal digests mean equal meshes

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return the mesh as a new trimesh, which notebooks show as a picture."""
        from ncti.ships.displayed import Ship

        mesh = Ship(self.vertices, self.faces, process=False)
        mesh.metadata.update(self.metadata)
        return mesh


Mesh: TypeAlias = "trimesh.Trimesh | ShipMesh"
"""Mesh of which views are drawn."""
