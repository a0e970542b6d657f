"""A table that fails is reported, and the store has everything else."""

import numpy as np
import pytest
import xarray as xr
from small_stores import files, opened
from toys import SPRINGS, having, run

from sweeps.engine.declare.settings import read_choices
from sweeps.engine.declare.stage import Table
from sweeps.engine.store.writing import read_attributes


def spoilt(answers, choices):
    """Fail with a KeyError."""
    return answers["nothing"]


def unstorable(answers, choices):
    """Return a table of durations, which cannot be stored."""
    return xr.Dataset({"x": ("place", np.array([1], "m8[s]"))})


def bare(answers, choices):
    """Return a dict instead of a data set."""
    return {"x": 1}


def mute(answers, choices):
    """Make a table, but do not return it."""
    answers.assign(x=1)


def after(best, choices):
    """Return a table made of another table."""
    return best


def experiment(make):
    """Return the springs with a table by `make`, one that needs it, and their own table."""
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
    # Without the failing tables, a run reuses all results.
    again = run(SPRINGS, choices, tmp_path / "s.zarr", tmp_path / "s.cache")
    assert again.failures == [] and sum(progress.done for progress in again.progress.values()) == 0
    run(SPRINGS, choices, tmp_path / "t.zarr", tmp_path / "s.cache")
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr")
