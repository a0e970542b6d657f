"""The six ships, built once."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import trimesh

from ncti import ships


@pytest.fixture(scope="session")
def ship() -> Callable[[str], trimesh.Trimesh]:
    """A packaged ship by name, built on first use of its sheet."""
    return ships.load
