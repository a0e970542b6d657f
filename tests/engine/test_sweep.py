"""Whole sweeps give the right numbers, the same store for all workers, and compute cells once."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from small_stores import files, opened
from toys import CALLS, Few, go, of, run_few, timed

from sweeps.engine.declare.settings import read_choices
from sweeps.engine.declare.stage import Group, Output, stage
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.resolve.streams import cell_rng
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor
from sweeps.engine.store.writing import read_attributes
from sweeps.testing import check_pure

STIFFNESS, MASS, LENGTH, DRAW = (1.0, 2.0, 4.0), (1.0, 2.0), (2, 4), (0, 1)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Return the store of the springs with all defaults."""
    path = tmp_path_factory.mktemp("springs") / "s.zarr"
    go(path)
    return path


def plain_noise(stiffness, mass, draw, length):
    name = {"stage": "noisy", "stiffness": stiffness, "mass": mass, "draw": draw}
    return cell_rng(0, **name).standard_normal(length)


def plain_period(stiffness, mass):
    return 2 * math.pi / round(math.sqrt(stiffness / mass), 12)


def test_results_equal_a_plain_computation(store):
    springs, answers = opened(store, "springs"), opened(store, "answers")
    for mass, length, draw in product(MASS, LENGTH, DRAW):
        noisy = []
        for stiffness in STIFFNESS:
            point = {"stiffness": stiffness, "mass": mass}
            period = plain_period(stiffness, mass)
            noise = plain_noise(stiffness, mass, draw, length)
            noisy.append(period + noise.mean())
            assert springs.period.sel(point) == period
            point |= {"length": length, "draw": draw}
            assert springs.noisy.sel(point) == noisy[-1]
            trace = springs.trace.sel(point).values
            assert (trace[:length] == (stiffness + noise).astype("f4")).all()
            assert np.isnan(trace[length:]).all()
        answer = answers.answer.sel(mass=mass, length=length, draw=draw)
        assert answer.sel(rule="max") == max(noisy)
        assert answer.sel(rule="mean") == np.mean(noisy)
    assert (opened(store, "status").taken == 1).all()


def test_dimensions_coordinates_and_units(store):
    springs = opened(store, "springs")
    assert springs.period.dims == ("stiffness", "mass")
    assert springs.noisy.dims == ("mass", "length", "draw", "stiffness")  # the order of `dims`
    assert springs.period.attrs == {"units": "s", "long_name": "period"}
    assert springs.stiffness.attrs == {"units": "N m-1", "long_name": "stiffness"}
    assert "limit" not in springs.coords  # one value is no coordinate by default
    assert springs.drawn.dims == ("mass", "length", "draw", "stiffness")
    assert (opened(store, "status").answers == 1).all()
    root = read_attributes(store)
    assert root["configuration"]["spring"]["mass"] == [1, 2] and root["seed"] == 0
    assert not {"failures", "joint"} & set(root)


def test_equal_cells_are_computed_once_and_parents_shared(tmp_path):
    CALLS.clear()
    finished = go(tmp_path / "s.zarr")
    # 1/1 and 2/2, and 2/1 and 4/2, have the same rate: four solvers and periods for six cells.
    assert CALLS["period"] == finished.progress["period"].done == 4
    assert CALLS["solver"] == 4  # periods and energies of one rate share a solver
    assert CALLS["energy"] == 6
    CALLS.clear()
    again = go(tmp_path / "s.zarr")
    assert not CALLS and not again.written
    assert all(progress.reused == progress.total for progress in again.progress.values())


@stage(Output("square", label="square"), uses=(Few,), group=Group("squares"))
def square(size):
    """Return the square of a number, and count the call."""
    CALLS["square"] += 1
    return float(size**2)


def test_stages_of_one_function_share_results_of_equal_keys(tmp_path):
    CALLS.clear()
    same = replace(square, name="same", group=Group("same"))
    run_few([square, same], tmp_path / "s.zarr")
    assert CALLS["square"] == 3
    first, second = (opened(tmp_path / "s.zarr", group) for group in ("squares", "same"))
    np.testing.assert_array_equal(first.square, [1, 4, 9])
    np.testing.assert_array_equal(second.square, first.square)


def test_local_workers_make_the_same_store(store, tmp_path):
    go(tmp_path / "s.zarr", kind="local", workers=2)
    assert files(tmp_path / "s.zarr") == files(store)


def test_small_sweeps_of_known_code_start_no_workers(tmp_path, monkeypatch):
    """This holds for code of packages only: a script's function could end the command's process."""
    started = []

    def counted(choice, **options):
        started.append(choice.kind)
        return open_executor(ClusterChoice("inline"), **options)

    monkeypatch.setattr("sweeps.engine.sweeping.open_executor", counted)
    for masses, store in (([1], "s"), ([1, 2], "s"), ([1, 2, 3], "new")):
        go(tmp_path / f"{store}.zarr", tmp_path / "cache", kind="local", spring__mass=masses)
    for sizes in ([1], [1, 2]):
        run_few([timed], tmp_path / "few.zarr", tmp_path / "cache", sizes, kind="local")
    assert started == ["local", "inline", "local", "local", "local"]


def test_measured_outputs_are_kept_and_marked(tmp_path):
    run_few([timed], tmp_path / "a.zarr", tmp_path / "cache")
    first = opened(tmp_path / "a.zarr", "timed")
    assert first.took.attrs["comment"].startswith("measured while the cell was computed")
    assert "comment" not in first.square.attrs
    run_few([timed], tmp_path / "a.zarr", tmp_path / "cache", [1, 2, 3, 4])
    second = opened(tmp_path / "a.zarr", "timed")
    assert second.sel(size=[1, 2, 3]).took.equals(first.took)


@stage(Output("flat", ("place",), label="flat"), uses=(Few,), group=Group("poor"))
def flat(size):
    """Return a number though an array is declared."""
    return 0.0


def test_arrays_with_the_wrong_number_of_dimensions_fail(tmp_path):
    finished = run_few([flat], tmp_path / "s.zarr")
    reason = "flat returned an array of shape () as flat, but must return one of 1 dimensions"
    assert all(reason in why for _, why in finished.failures) and len(finished.failures) == 3


def test_functions_of_equal_name_share_results_only_if_identical(tmp_path):
    def power(exponent):
        return lambda size: float(size) ** exponent

    def named(name, function):
        output = Output("x", label="x", dtype="f8")
        return stage(output, uses=(Few,), group=Group(name), name=name)(function)

    square, cube = power(2), power(3)
    stages = [named("square", square), named("cube", cube), named("again", square)]
    assert run_few(stages, tmp_path / "s.zarr").failures == []
    for name, exponent in {"square": 2, "cube": 3, "again": 2}.items():
        values = opened(tmp_path / "s.zarr", name).x.values.tolist()
        assert values == [1, 2**exponent, 3**exponent]
    few = of(*stages)
    plan = Plan(few, read_choices(few.declared, {}))
    keys = {declared.name: plan.key(plan.bound[declared.name], 0) for declared in stages}
    assert keys["again"] == keys["square"] != keys["cube"]


# check_pure ---------------------------------------------------------------------------------------


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


def checked(declared):
    """Check a stage of four cells; return the number of cells compared."""
    experiment = of(declared)
    choices = read_choices(experiment.declared, {"few.size": [1, 2, 3, 4]})
    return check_pure(experiment, choices, max_cells=10)[declared.name]


def test_check_pure_reports_differing_and_failing_cells():
    message = r"^counting size=3 differs when computed again, alone: x\[1\] is 1.0, and then 2.0$"
    with pytest.raises(AssertionError, match=message):
        checked(counting)
    with pytest.raises(AssertionError, match=r"^failing size=2 failed: ValueError: no$"):
        checked(failing)


def test_check_pure_reports_cells_that_depend_on_their_batch():
    message = r"^in_company size=2 differs when computed again, alone: x is -0.5, and then 0.0$"
    with pytest.raises(AssertionError, match=message):
        checked(in_company)


def test_check_pure_ignores_measured_outputs():
    assert checked(timed) == 4
