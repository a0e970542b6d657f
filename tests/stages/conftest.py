"""Fixture that several test files of stages use."""

import pytest


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return the folder in which a module's sweeps of flights share results."""
    return tmp_path_factory.mktemp("flights")
