"""Stores can be extended on any axis, with or without a cache; other changes are refused."""

import shutil
import zlib
from dataclasses import replace

import numpy as np
import pytest
from small_stores import contents, opened
from toys import CALLS, SPRINGS, go, having, run

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.settings import Settings, ZippedAxis, count, read_choices, text
from sweeps.engine.declare.stage import Experiment, Group, Output, derived, stage

CELLS = {"period": 4, "energy": 6, "noisy": 24, "trace": 24, "answers": 16}
GROWN = {
    "in front": {"spring__mass": [0.5, 1, 2]},
    "between": {"spring__stiffness": [1, 2, 3, 4]},
    "at the end": {"measured__length": [2, 4, 5]},
    "two axes": {"measured__rule": ["max", "mean", "min"], "spring__mass": [1, 2, 7]},
    "a new axis": {"spring__limit": [100, 200]},
    "a new axis of switches": {"measured__doubled": [False, True]},
    "more draws": {"measured__draw": 3},
    "more seeds": {"seed": [0, 2**62 + 1]},
}


@pytest.fixture(scope="module")
def grown(tmp_path_factory):
    """Return a function that gives the store of one run with some settings, made only once."""
    folder, stores = tmp_path_factory.mktemp("grown"), {}

    def clean(**values):
        name = repr(sorted(values.items()))
        if name not in stores:
            stores[name] = folder / f"{len(stores)}.zarr"
            go(stores[name], **values)
        return stores[name]

    return clean


@pytest.mark.parametrize("given", GROWN.values(), ids=GROWN)
def test_a_store_grows_on_any_axis(grown, tmp_path, given):
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    shutil.copytree(grown(), store)
    shutil.copytree(grown().with_suffix(".cache"), cache)
    finished = go(store, cache, **given)
    assert contents(store) == contents(grown(**given))
    for name, progress in finished.progress.items():
        if name != "answers" or "spring__stiffness" not in given:  # answers gather stiffnesses
            assert progress.reused == CELLS[name], name


def test_one_more_value_along_an_axis_computes_only_itself(grown, tmp_path):
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    go(store, cache)
    CALLS.clear()
    go(store, cache, measured__length=[2, 3, 4])
    assert CALLS == {"noisy": 12, "trace": 12, "answers": 8}  # the cells of one length
    CALLS.clear()
    go(store, cache, measured__length=[2, 3, 4], measured__rule=["max", "mean", "min"])
    assert CALLS == {"answers": 12}  # the cells of one rule


def test_without_a_cache_only_a_store_that_lacks_something_is_computed_again(grown, tmp_path):
    store = tmp_path / "s.zarr"
    shutil.copytree(grown(), store)
    CALLS.clear()
    finished = go(store, tmp_path / "b")
    assert not (CALLS or finished.written)
    assert finished.progress["answers"].reused == CELLS["answers"]
    go(store, tmp_path / "c", spring__limit=[50.0, 100.0])
    assert CALLS["period"] == 8 and contents(store) == contents(grown(spring__limit=[50.0, 100.0]))


class Cut(Settings, key="cut"):
    """Settings of pieces of a series."""

    begin = count([3, 5, 9], label="begin")
    size = count([1, 4], label="size")


@stage(
    Output("piece", ("bin",), label="piece", dtype="f4"),
    Output("same", ("bin",), label="same", dtype="i2", pad=7),
    Output("first_bin", label="bin", dtype="i8", role="inner"),
    Output("tail", ("k", "j"), label="tail", pad=0),
    Output("none", ("nothing",), label="nothing"),
    uses=(Cut,),
    group=Group("pieces", dims=("bin", "begin")),
)
def piece(begin, size):
    """Return arrays, of which some equal their padding and some are empty; fail for one cell."""
    CALLS["piece"] += 1
    if begin == 9 and size == 4:
        raise ValueError("too far")
    values = np.where(np.arange(size) % 2, np.nan, begin)
    tail = np.zeros((size - 1, begin))
    found = {"piece": values, "same": np.full(size, 7), "first_bin": begin - 4, "tail": tail}
    return found | {"none": np.zeros(0)}


@stage(Output("hash", label="hash", dtype="i8"), uses=(Cut,), group=Group("hashes"))
def hashed(piece):
    """Return a checksum of the names, types, shapes and values of all arrays that it gets."""
    arrays = [(name, piece[name].dtype.str, piece[name].tolist()) for name in sorted(piece)]
    return zlib.crc32(repr([*arrays, *(array.shape for array in piece.values())]).encode())


def test_ragged_arrays_come_back_as_they_were(tmp_path):
    experiment = Experiment("cut", "Cut", (Cut, piece))
    both = Experiment("cut", "Cut", (Cut, piece, hashed))
    choices = read_choices(experiment.declared, {})
    run(experiment, choices, tmp_path / "s.zarr", tmp_path / "a")
    CALLS.clear()
    run(both, choices, tmp_path / "s.zarr", tmp_path / "a")
    assert CALLS == {"piece": 1}  # the cell that failed
    run(both, choices, tmp_path / "t.zarr", tmp_path / "c")
    assert contents(tmp_path / "s.zarr") == contents(tmp_path / "t.zarr")


class Named(Settings, key="named"):
    """Settings: the name of a file, and an axis."""

    name = text("a", label="name")
    size = count([1, 2], label="size")


CONTENT = {"digest": "one"}


@derived(uses=(Named,), version="1")  # its code does not include the file
def content(name):
    """Return the content of the file that a setting names."""
    return CONTENT["digest"]


@stage(Output("read", label="read", dtype="U3"), uses=(Named,), group=Group("read"))
def reading(content, size):
    """Return a result that depends on that file."""
    CALLS["reading"] += 1
    return content


def test_a_file_that_has_changed_is_read_again(tmp_path):
    files_read = Experiment("files", "Files", (Named, content, reading))
    choices = read_choices(files_read.declared, {})
    run(files_read, choices, tmp_path / "s.zarr", tmp_path / "a")
    CONTENT["digest"] = "two"
    try:
        run(files_read, choices, tmp_path / "s.zarr", tmp_path / "a")
    finally:
        CONTENT["digest"] = "one"
    assert opened(tmp_path / "s.zarr", "read").read.values.tolist() == ["two", "two"]


REFUSED = [
    ({"spring__mass": [1, 3]}, "spring.mass is 1, 3, ", " has 2: ", "spring.mass=[1,2,3]"),
    ({"measured__rule": "min"}, "is min, ", " has max, mean: ", "measured.rule=[max,mean,min]"),
    ({"measured__draw": 1}, "measured.draw is 0, ", " has 1: ", "give another store"),
    ({"seed": 3}, "seed is 3, ", " has 0: ", "seed=[0,3]"),
    ({"measured__doubled": True}, "is true, ", " has false: ", "measured.doubled=[false,true]"),
    ({"spring__reference": 4.0}, "is 4, ", " has null: ", "spring.reference=[4,null]"),
]


@pytest.mark.parametrize(("given", "asked", "stored", "advice"), REFUSED)
def test_another_configuration_is_refused_by_its_keys(grown, given, asked, stored, advice):
    store = grown()
    before = contents(store)
    with pytest.raises(ConfigurationError) as refused:
        go(store, store.with_suffix(".cache"), **given)
    assert all(word in str(refused.value) for word in (asked, repr(str(store)) + stored, advice))
    assert contents(store) == before


def test_other_code_is_refused(grown):
    store = grown()
    changed = replace(SPRINGS.by_name["period"], function=SPRINGS.by_name["energy"].function)
    changed_springs = having(SPRINGS, (*SPRINGS.stages[:2], changed, *SPRINGS.stages[3:]))
    with pytest.raises(ConfigurationError, match="was made by different code of period \\("):
        run(changed_springs, read_choices(SPRINGS.declared, {}), store)


def joined(points, labels=None):
    """Return choices in which stiffness and limit run together, point by point."""
    choices = read_choices(SPRINGS.declared, {"measured.draw": 1})
    values = [sorted({point[k] for point in points}) for k in range(2)]
    ours = {"spring.stiffness": tuple(values[0]), "spring.limit": tuple(values[1])}
    keys = ("spring.stiffness", "spring.limit")
    return replace(
        choices,
        values={**choices.values, **ours},
        zipped=(ZippedAxis("two", keys, points, labels),),
    )


NOT_GATHERED = having(SPRINGS, SPRINGS.stages[:4], ())


def test_settings_that_run_together_grow_by_whole_points(tmp_path):
    store = tmp_path / "s.zarr"
    few, more = ((1.0, 9.0), (2.0, 8.0)), ((1.0, 9.0), (1.5, 9.0), (2.0, 8.0))
    run(NOT_GATHERED, joined(few), store)
    CALLS.clear()
    run(NOT_GATHERED, joined(more), store)
    assert CALLS["period"] == 2
    run(NOT_GATHERED, joined(more), tmp_path / "t.zarr")
    assert contents(store) == contents(tmp_path / "t.zarr")
    springs = opened(store, "springs")
    assert springs.period.dims == ("two", "mass")
    assert springs.stiffness.values.tolist() == [1, 1.5, 2] and "limit" in springs.coords
    crossed = ((1.0, 8.0), (1.5, 9.0), (2.0, 8.0))
    with pytest.raises(ConfigurationError, match=r"spring\.limit, spring\.stiffness together"):
        run(NOT_GATHERED, joined(crossed), store)
