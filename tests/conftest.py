"""Fixtures that several folders share, and the search path of the tests' own modules."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings
from once import made_once, sharing_ships

# The first example of a test may import a library, which takes longer than a deadline allows.
settings.register_profile("untimed", deadline=None, max_examples=50)
settings.load_profile("untimed")

for folder in ("engine", "sweeps", "convergence", "report"):  # whose modules others import
    sys.path.insert(1, str(Path(__file__).parent / folder))


@pytest.fixture(scope="session")
def cache(tmp_path_factory) -> Path:
    """Return the cache of a run's sweeps, without earlier results but with ships built before."""
    return sharing_ships(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def smoke_store(tmp_path_factory) -> Path:
    """Return the store of the smoke experiment, run as the README says, on two workers."""
    arguments = ["+experiment=smoke", "store=sweep.zarr", "cache=cache", "cluster.workers=2"]

    def run(folder: Path) -> None:
        sharing_ships(folder / "cache")
        command = [sys.executable, "-m", "sweeps.app", *arguments]
        subprocess.run(command, cwd=folder, check=True, timeout=300)

    return made_once(tmp_path_factory, "smoke", run) / "sweep.zarr"


@pytest.fixture
def quick_layout(monkeypatch):
    """Draw without constrained layout, which takes most of the time and which no test checks."""
    execute = "matplotlib.layout_engine.ConstrainedLayoutEngine.execute"
    monkeypatch.setattr(execute, lambda engine, figure: None)


@pytest.fixture
def one_variant(monkeypatch):
    """Let all settings of a reproduction share one variant of one ship, as each takes seconds."""
    from studies.reproduction import setting

    def variant(name, number):
        return f"{name}@0.1" if name == "duncan" and number else name

    monkeypatch.setattr(setting, "_variant", variant)


@pytest.fixture
def umask():
    """Yield the function that sets the permission mask of new files; restore the mask after."""
    before = os.umask(0o077)
    yield os.umask
    os.umask(before)
