"""What workers need is imported ahead where there is clearly work, and only there."""

from contextlib import contextmanager
from importlib.util import find_spec

import pytest

from sweeps import app
from sweeps.engine import forking
from sweeps.engine.forking import worth_importing
from sweeps.engine.results import INDEX
from sweeps.experiment import MODULES


@pytest.fixture
def started(monkeypatch):
    """Modules of every server that is started ahead."""
    found = []

    @contextmanager
    def record(modules):
        found.append(list(modules))
        yield

    monkeypatch.setattr(forking, "fork_server_ahead", record)
    return found


@pytest.mark.parametrize("more", [["+experiment=paper"], ["store={}/new.zarr", "seed=1"]])
def test_a_sweep_where_nothing_is_kept_starts_the_server_ahead(tmp_path, started, more):
    arguments = [f"cache={tmp_path}", *(one.format(tmp_path) for one in more)]
    with app._workers_ahead(arguments):
        assert started == [["sweeps.ahead"]]
    assert find_spec("sweeps.ahead")


@pytest.mark.parametrize(
    "more",
    [
        *(["--help"], ["-m", "ladar.cnr=26,32"], ["--cfg", "job"], ["--settings"]),
        *(["dry_run=true"], ["++dry_run=true"], ["cluster=inline"], ["cluster.kind=inline"]),
        ["store={}"],
    ],
)
def test_no_server_is_started_for_nothing(tmp_path, started, more):
    arguments = [f"cache={tmp_path / 'new'}", *(one.format(tmp_path) for one in more)]
    with app._workers_ahead(arguments):
        assert not started


def test_no_server_is_started_where_results_are_kept(tmp_path, started):
    (tmp_path / INDEX).touch()
    with app._workers_ahead([f"cache={tmp_path}"]):
        assert not started


def test_what_it_imports_is_there():
    listed = worth_importing(module.__name__ for module in MODULES)
    assert len(listed) > len(MODULES)
    assert all(find_spec(name) for name in listed)
