"""A store that several files of this room report of."""

import pytest
from stores import FLIGHTS, swept_once


@pytest.fixture(scope="session")
def sisters(tmp_path_factory):
    """Both sisters flown past near the stern, with and without their transoms."""
    overrides = ("grid.aspect=175", "irar.transom_gain=[0,1]", "irar.cnr=20")
    return swept_once(tmp_path_factory, "sisters", *FLIGHTS, *overrides)
