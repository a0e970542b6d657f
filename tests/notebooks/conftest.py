"""Fixture: the store of flights that a notebook opens."""

from pathlib import Path

import pytest
from commands import swept
from stores import COARSE, SMALL

# Two ships of which the second is flown past, several values on two of the axes that the notebook
# asks for and one on the third; few and coarse lines, in a tenth of a second a flight.
FLIGHTS = [
    *("sensor=irar", "grid.ship=[duncan,roberts]", "grid.aspect=175", "irar.flown=roberts"),
    *("irar.range=3", "irar.cnr=[10,20]", "irar.range_filter=[cluster,mean]"),
    *(f"irar.{key}={value:g}" for key, value in SMALL.items()),
    *COARSE,
]


@pytest.fixture(scope="session")
def flight_store(tmp_path_factory) -> Path:
    """Return the finished store of a small sweep of flights."""
    folder = tmp_path_factory.mktemp("flights")
    assert not swept(folder / "flights.zarr", folder / "cache", *FLIGHTS).failures
    return folder / "flights.zarr"
