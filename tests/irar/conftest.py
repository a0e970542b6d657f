"""Fixtures shared by the tests of `ncti.irar`: a small ship and a pass over it."""

import pytest
from flown import flight, pole_on_box

from ncti.irar import fly


@pytest.fixture(scope="session")
def ship():
    return pole_on_box(60, 9, 5, 20)


@pytest.fixture(scope="session")
def flown(ship):
    return fly(ship, flight(175.0, samples=120, line_rate=60))
