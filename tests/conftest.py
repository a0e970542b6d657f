"""Fixtures that several rooms share, and the search path of the tests' own modules."""

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings
from platformdirs import user_cache_path

# The first example of a test may import a library, which takes longer than a deadline allows.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

for room in ("engine", "sweeps"):  # `company`, `small_stores`, `commands`
    sys.path.insert(1, str(Path(__file__).parent / room))


@pytest.fixture(scope="session")
def cache() -> Path:
    """Cache of the user, whose meshes all sweeps share: ships are built once a machine."""
    return user_cache_path("ncti-sweep")


@pytest.fixture(scope="session")
def smoke_store(tmp_path_factory) -> Path:
    """Finished store of the smoke experiment, run as the README says, on two workers."""
    folder = tmp_path_factory.mktemp("smoke")
    arguments = ["+experiment=smoke", "store=sweep.zarr", "cache=cache", "cluster.workers=2"]
    subprocess.run(
        [sys.executable, "-m", "sweeps.app", *arguments], cwd=folder, check=True, timeout=300
    )
    return folder / "sweep.zarr"
