"""Fixtures: the folders in which sweeps of these tests run and keep their results."""

import pytest
from once import sharing_ships


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Return the folder of a test, in which its commands run, as Hydra writes there."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """Return the cache of finished results that the tests share."""
    return sharing_ships(tmp_path_factory.mktemp("cache"))
