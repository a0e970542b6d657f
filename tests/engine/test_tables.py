"""A table that fails costs itself, and no store."""

import numpy as np
import pytest
import xarray as xr
from small_stores import files, opened
from toys import SPRINGS, having, run

from sweeps.engine.declare.settings import read_choices
from sweeps.engine.declare.stage import Table
from sweeps.engine.store.writing import read_attributes


def spoilt(answers, choices):
    """A table with a mistake."""
    return answers["nothing"]


def unstorable(answers, choices):
    """A table of durations."""
    return xr.Dataset({"x": ("place", np.array([1], "m8[s]"))})


def bare(answers, choices):
    """No data set."""
    return {"x": 1}


def mute(answers, choices):
    """A table that is forgotten."""
    answers.assign(x=1)


def after(best, choices):
    """A table of another table."""
    return best


def experiment(make):
    """The springs with a table that fails, one of it, and one of another."""
    tables = (
        Table("tables/spoilt", ("answers",), make),
        Table("tables/after", ("tables/spoilt",), after),
        *SPRINGS.tables,
    )
    return having(SPRINGS, tables=tables)


@pytest.mark.parametrize("make", [spoilt, unstorable, bare, mute])
def test_a_failing_table_costs_only_itself(tmp_path, make):
    choices = read_choices(SPRINGS.declared, {})
    finished = run(experiment(make), choices, tmp_path / "s.zarr")
    names = [name for name, _ in finished.failures]
    assert names == ["table tables/spoilt", "table tables/after"] and finished.written
    assert finished.failures[1][1] == "needs table tables/spoilt, which failed"
    assert read_attributes(tmp_path / "s.zarr")["failures"] == dict(finished.failures)
    if make is bare:
        assert finished.failures[0][1] == (
            "TypeError: its function returned a dict, but must return a data set or None"
        )
    if make is mute:
        line = mute.__code__.co_firstlineno
        assert finished.failures[0][1].endswith(
            f"test_tables.py:{line}: its function has no return, but must return a data set or None"
        )
    assert "best" in opened(tmp_path / "s.zarr", "tables/best")
    # Mended, it is made of the results that are there.
    again = run(SPRINGS, choices, tmp_path / "s.zarr", tmp_path / "s.cache")
    assert again.failures == [] and sum(progress.done for progress in again.progress.values()) == 0
    run(SPRINGS, choices, tmp_path / "t.zarr", tmp_path / "s.cache")
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr")
