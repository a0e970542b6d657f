"""Fixtures that several rooms share, and the search path of the tests' own modules."""

import subprocess
import sys
from pathlib import Path

import pytest
from platformdirs import user_cache_path


@pytest.fixture(scope="session")
def cache() -> Path:
    """Cache of finished stages: the user's own, so that ships are built once a machine."""
    return user_cache_path("ncti-sweep")


@pytest.fixture(scope="session")
def smoke_store(tmp_path_factory, cache) -> Path:
    """Finished store of the smoke experiment, run as the README says, on two workers."""
    folder = tmp_path_factory.mktemp("smoke")
    store = folder / "sweep.zarr"
    (cache / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "cache").mkdir()
    (folder / "cache" / "meshes").symlink_to(cache / "meshes", target_is_directory=True)
    subprocess.run(
        [
            sys.executable,
            "-m",
            "sweeps.app",
            "+experiment=smoke",
            f"store={store}",
            f"cache={folder / 'cache'}",
        ],
        cwd=folder,
        check=True,
        timeout=300,
    )
    return store
