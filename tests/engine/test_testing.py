"""`check_pure` computes cells twice and names those that differ, depend on others or fail."""

import numpy as np
import pytest
from toys import CALLS, SPRINGS, Few, of, timed

from sweeps.engine.declare.settings import read_choices
from sweeps.engine.declare.stage import Group, Output, stage
from sweeps.testing import check_pure

FOUR = {"few.size": [1, 2, 3, 4]}
COUNTED = {"calls": 0}


@stage(Output("x", ("place",), label="x", dtype="f8"), uses=(Few,), group=Group("all"), version="1")
def counting(size):
    """Return a result that, for size 3, depends on the number of calls."""
    COUNTED["calls"] += size == 3
    return np.array([size, float(COUNTED["calls"])]) if size == 3 else np.array([size, np.nan])


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), along=(Few.size,), group=Group("all"))
def in_company(size):
    """Return results of which that of size 2 depends on the other sizes."""
    return np.array(size) - np.mean(size) * (np.array(size) == 2)


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def failing(size):
    """Return the size; fail for size 2."""
    if size == 2:
        raise ValueError("no")
    return size


def checked(experiment, max_cells=10**9, **values):
    """Check an experiment; return the number of cells compared for each stage."""
    return check_pure(experiment, read_choices(experiment.declared, values), max_cells=max_cells)


def test_reproducible_cells_are_computed_twice():
    CALLS.clear()
    rules = {"measured.rule": ["max", "mean", "min"]}
    compared = checked(SPRINGS, **rules)
    assert compared == {"period": 6, "energy": 6, "trace": 24, "noisy": 24, "answers": 24}
    assert CALLS["trace"] == 48
    assert checked(SPRINGS, 5, **rules) == {
        name: 3 if n == 6 else 5 for name, n in compared.items()
    }


def test_cells_that_differ_or_fail_are_named():
    message = r"^counting size=3 differs when computed again, alone: x\[1\] is 1.0, and then 2.0$"
    with pytest.raises(AssertionError, match=message):
        checked(of(counting), **FOUR)
    with pytest.raises(AssertionError, match=r"^failing size=2 failed: ValueError: no$"):
        checked(of(failing), **FOUR)


def test_a_cell_that_depends_on_others_computed_with_it_is_named():
    message = r"^in_company size=2 differs when computed again, alone: x is -0.5, and then 0.0$"
    with pytest.raises(AssertionError, match=message):
        checked(of(in_company), **FOUR)


def test_measured_outputs_may_differ():
    assert checked(of(timed), **FOUR) == {"timed": 4}
