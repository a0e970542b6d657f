"""Stores that several files of this room report of."""

import pytest
from stores import CLASSIFIERS, FLIGHTS, swept_once


@pytest.fixture(scope="session")
def classified(tmp_path_factory):
    """All classifiers of range profiles, with several values of every setting of theirs."""
    return swept_once(tmp_path_factory, "classified", *CLASSIFIERS)


@pytest.fixture(scope="session")
def sisters(tmp_path_factory):
    """Both sisters flown past near the stern, with and without their transoms."""
    given = ("grid.aspect=175", "grid.replicate=2", "irar.transom_gain=[0,1]", "irar.cnr=20")
    return swept_once(tmp_path_factory, "sisters", *FLIGHTS, *given)


@pytest.fixture(scope="session")
def misled(tmp_path_factory):
    """One ship flown past, and what is believed wrong of it."""
    errors = "irar.errors={aircraft_speed: [-2, 2], ship_heading: 5}"
    focused = "irar.autofocus=[false,true]"
    one = [item for item in FLIGHTS if not item.startswith("grid.ship")]
    given = ("grid.ship=roberts", "grid.aspect=175", "irar.cnr=20", errors, focused)
    return swept_once(tmp_path_factory, "misled", *one, *given)
