"""Ships built in several processes have the same files as ships built one after another."""

import sys

import pytest

from ncti import ships
from ncti.ships import parallel
from ncti.ships.loading import is_built

NAMES = ["duncan", "texas", "duncan@0.1"]


@pytest.fixture
def build(tmp_path, monkeypatch):
    """Return a function that builds ships into a folder by a number of processes."""

    def build(names, *, processes=2):
        monkeypatch.setattr(parallel, "processor_count", lambda: processes)
        counts = []
        parallel.build_in_parallel(names, cache=tmp_path / str(processes), progress=counts.append)
        return tmp_path / str(processes), counts

    return build


def test_parallel_builds_equal_serial_builds(build):
    alone, counts = build(NAMES, processes=1)
    assert counts == [1, 2, 3]
    shared, counts = build(NAMES, processes=3)
    assert len(counts) == 1 and counts[0] >= 1
    for name in NAMES:
        assert is_built(name, cache=shared)
        one, other = (ships.load(name, cache=folder) for folder in (alone, shared))
        assert one.vertices.tobytes() == other.vertices.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()


def test_ships_that_cannot_be_built_are_left_out(build, tmp_path):
    sheet = tmp_path / "broken.yaml"
    sheet.write_text("hull: 7\n")
    folder, _ = build([str(sheet), "duncan"])
    assert is_built("duncan", cache=folder) and not is_built(sheet, cache=folder)


@pytest.mark.parametrize("executable", ["/nowhere/python", "/bin/false"])
def test_ships_of_failed_workers_stay_unbuilt(build, monkeypatch, executable):
    monkeypatch.setattr(sys, "executable", executable)
    folder, _ = build(NAMES[:2])
    assert [is_built(name, cache=folder) for name in NAMES[:2]] == [True, False]
