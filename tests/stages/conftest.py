"""Fixtures of several tests of stages."""

import pytest


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder in which sweeps of flights of one module share results."""
    return tmp_path_factory.mktemp("flights")
