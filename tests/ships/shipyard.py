"""Helpers of the ship tests: packaged sheets, and a barge small enough to build often."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml
from manifold3d import Manifold, Mesh64

from ncti import ships
from ncti.ships import errors, sheets


def packaged_text(name: str) -> str:
    return (resources.files("ncti.ships") / "sheets" / f"{name}.yaml").read_text()


@cache
def packaged_sheet(name: str) -> sheets.Sheet:
    return sheets.parse(packaged_text(name), packaged_text("templates"), where=name)


def solid_of(mesh: trimesh.Trimesh) -> Manifold:
    return Manifold(Mesh64(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.uint64)))


def bounds(solid: Manifold) -> np.ndarray:
    return np.reshape(solid.bounding_box(), (2, 3))


def barge() -> dict[str, Any]:
    """Return a sheet of one simple hull with a component of nearly every kind."""
    sheet: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("barge.yaml").read_text())
    return sheet


def refusal(path: str | Path) -> str:
    """Return the message with which loading a file is refused."""
    with pytest.raises(ships.ShipError) as caught:
        ships.load(path)
    return sentence(caught.value)


def refused_sheet(text: str) -> str:
    """Return the message with which parsing the text of a sheet is refused."""
    with pytest.raises(ships.ShipError) as caught:
        sheets.parse(text, "{}", where="barge")
    return sentence(caught.value)


def sentence(error: Exception) -> str:
    """Return an error's message, and check that it is one short printable sentence."""
    message = str(error)
    assert message.isprintable() and message.endswith(".") and len(message) <= errors.MAX_MESSAGE
    return message
