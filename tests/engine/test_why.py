"""`--why` names the parts of keys that differ from a store; debug logs explain decisions."""

import logging
from copy import deepcopy

import numpy as np
import pytest
from toys import SPRINGS, Few, go, run_few

from sweeps.engine.command.line import Command
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.settings import read_choices
from sweeps.engine.declare.stage import Group, Output, stage
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.store.provenance import check_extends, differences
from sweeps.engine.store.writing import read_attributes


@pytest.fixture
def store(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    go(tmp_path / "s.zarr", tmp_path / "c")
    return tmp_path / "s.zarr"


def test_differences_are_listed_by_stage(store):
    old, plan = read_attributes(store), Plan(SPRINGS, read_choices(SPRINGS.declared, {}))
    assert not dict(differences(plan, old))
    more = Plan(SPRINGS, read_choices(SPRINGS.declared, {"spring.mass": [1, 2, 3]}))
    reasons = dict(differences(more, old))
    assert reasons["rate"] == ["spring.mass"] and reasons["solver"] == ["its input rate"]
    then = deepcopy(old)
    then["versions"]["numpy"] = "2.3"
    assert dict(differences(plan, then))["noisy"] == [
        f"numpy 2.3 -> {np.__version__}",
        "its input period",
    ]
    then = deepcopy(old)
    then["code"]["period"] = then["parts"]["code of toys.period"] = "0"
    assert dict(differences(plan, then))["period"] == ["code of toys.period"]
    assert dict(differences(plan, {}))["period"] == ["not in the store"]
    with pytest.raises(ConfigurationError, match=r"code of period \(code of toys.period\); give"):
        check_extends(SPRINGS, "s.zarr", then, plan)


def test_why_option_prints_differences(store, capsys):
    main = Command(SPRINGS).main
    assert main(["--why", "store=s.zarr"]) == 0
    assert capsys.readouterr().out == "nothing differs: the store has all of the sweep\n"
    assert main(["--why", "store=s.zarr", "spring.mass=[1,2,3]"]) == 0
    assert "rate: spring.mass\nsolver: its input rate\n" in capsys.readouterr().out


@stage(Output("square"), uses=(Few,), group=Group("all"))
def square(size):
    return size**2


def test_debug_log_explains_reuse_writing_and_batching(tmp_path, caplog):
    def messages(sizes):
        caplog.clear()
        with caplog.at_level(logging.DEBUG, "sweeps"):
            run_few([square], tmp_path / "s.zarr", tmp_path / "c", sizes)
        return [record.getMessage() for record in caplog.records]

    first = messages((1, 2))
    assert "square differs from the store in: not in the store" in first
    assert "square: 2 cells are computed by 2 calls" in first
    assert any(line.startswith("task of ['square']: about ") for line in first)
    assert any("chunks are written, 0 stay" in line for line in first)
    assert messages((1, 2)) == ["store is reused: it has all of the sweep, and is undamaged"]
    more = messages((1, 2, 3))
    assert "square differs from the store in: few.size" in more
    assert "square: 1 cells are computed by 1 calls" in more
    assert "store is written again: its cells, configuration, swept differ" in more
