"""Ships built in several processes have the same files as ships built one after another."""

import sys

import pytest

from ncti import ships
from ncti.ships.loading import is_built
from ncti.ships.parallel import build_in_parallel

NAMES = ["duncan", "texas", "duncan@0.1", "texas@0.2"]


def test_ships_are_built_in_other_processes_as_in_this_one(tmp_path):
    for processes in (1, 3):
        assert not any(is_built(name, cache=tmp_path / str(processes)) for name in NAMES)
        counts = []
        build_in_parallel(
            NAMES, cache=tmp_path / str(processes), processes=processes, progress=counts.append
        )
        assert counts == sorted(counts) and counts[0] >= 1 and counts[-1] <= len(NAMES)
        assert processes > 1 or counts == [1, 2, 3, 4]
        assert all(is_built(name, cache=tmp_path / str(processes)) for name in NAMES)
    for name in NAMES:
        one, other = (ships.load(name, cache=tmp_path / folder) for folder in ("1", "3"))
        assert one.vertices.tobytes() == other.vertices.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()


def test_ships_that_cannot_be_built_are_left_out(tmp_path):
    sheet = tmp_path / "broken.yaml"
    sheet.write_text("hull: 7\n")
    build_in_parallel([str(sheet), "duncan", str(sheet)], cache=tmp_path, processes=2)
    assert is_built("duncan", cache=tmp_path) and not is_built(sheet, cache=tmp_path)


@pytest.mark.parametrize("executable", ["/nowhere/python", "/bin/false"])
def test_processes_that_fail_leave_their_ships_to_the_next_call(tmp_path, monkeypatch, executable):
    monkeypatch.setattr(sys, "executable", executable)
    build_in_parallel(NAMES[:2], cache=tmp_path, processes=2)
    assert [is_built(name, cache=tmp_path) for name in NAMES[:2]] == [True, False]


def test_meshes_of_files_need_no_building(tmp_path):
    mesh = tmp_path / "box.stl"
    ships.load("duncan").export(mesh)
    assert is_built(mesh, cache=tmp_path)
