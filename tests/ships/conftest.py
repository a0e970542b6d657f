"""The six ships, built once a test run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

from ncti import ships


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache folder of this test run alone."""
    return tmp_path_factory.mktemp("meshes")


@pytest.fixture(scope="session")
def ship(folder: Path) -> Callable[[str], trimesh.Trimesh]:
    """A packaged ship by name, built on first use."""
    return lambda name: ships.load(name, cache=folder)
