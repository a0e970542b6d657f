"""What the tests of ships build with: packaged sheets, and a barge small enough to build often."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml
from manifold3d import Manifold, Mesh64

from ncti.ships import sheets


def packaged_text(name: str) -> str:
    return (resources.files("ncti.ships") / "sheets" / f"{name}.yaml").read_text()


@cache
def packaged_sheet(name: str) -> sheets.Sheet:
    return sheets.parse(packaged_text(name), packaged_text("templates"), where=name)


def solid_of(mesh: trimesh.Trimesh) -> Manifold:
    return Manifold(Mesh64(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.uint64)))


def barge() -> dict[str, Any]:
    """A sheet of one plain hull with a component of nearly every kind."""
    sheet: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("barge.yaml").read_text())
    return sheet
