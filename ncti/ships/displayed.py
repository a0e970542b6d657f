"""A ship's trimesh that notebooks show as a picture."""

from __future__ import annotations

import numpy as np
import trimesh

from ncti.ships.drawing import figure


class Ship(trimesh.Trimesh):
    """The mesh of `load`: a trimesh with a silhouette, measures and findings in notebooks.

    Copies and other meshes made of it are plain ones of trimesh.
    """

    def _repr_html_(self) -> str:
        metadata = self.metadata
        remarks = (*metadata.get("findings", ()), *metadata.get("faults", ()))
        name = metadata.get("name", "ship")
        return figure(name, np.asarray(self.vertices), np.asarray(self.faces), remarks)
