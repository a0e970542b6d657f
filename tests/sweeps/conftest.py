"""Fixtures that several files of this room share."""

import pytest
from classifier_sweep import SWEEP
from sweeping import command, fresh


@pytest.fixture(scope="session")
def swept(tmp_path_factory, cache):
    """The folder of the tiny sweep of all classifiers: two workers, a stage cache of its own."""
    folder = tmp_path_factory.mktemp("classifiers")
    done = command(
        *SWEEP, "cluster.workers=2", "store=s.zarr", folder=folder, cache=fresh(folder, cache)
    )
    assert done.returncode == 0, done.stderr
    return folder
