"""Session fixture: a store of flights that several test files report on."""

import pytest
from stores import FLIGHTS, swept_once


@pytest.fixture(scope="session")
def sisters(tmp_path_factory):
    """Return the store of flights past both sister ships, with transom gains of 0 and 1."""
    overrides = ("grid.aspect=175", "irar.transom_gain=[0,1]", "irar.cnr=20")
    return swept_once(tmp_path_factory, "sisters", *FLIGHTS, *overrides)
