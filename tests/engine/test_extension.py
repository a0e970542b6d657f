"""Stores can be extended on any axis, with or without a cache; other changes are refused."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest
from small_stores import contents, opened
from toys import CALLS, SPRINGS, go, having, run

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.settings import Settings, ZippedAxis, count, read_choices
from sweeps.engine.declare.stage import Experiment, Group, Output, stage
from sweeps.engine.store import provenance

CELLS = {"period": 4, "energy": 6, "noisy": 24, "trace": 24, "answers": 16}
GROWN = {
    "in front": {"spring__mass": [0.5, 1, 2]},
    "between": {"spring__stiffness": [1, 2, 3, 4]},
    "two axes": {"measured__rule": ["max", "mean", "min"], "spring__mass": [1, 2, 7]},
    "a new axis": {"spring__limit": [100, 200]},
    "a new axis of switches": {"measured__doubled": [False, True]},
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
def test_store_extends_along_any_axis(grown, tmp_path, given):
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    shutil.copytree(grown(), store)
    shutil.copytree(grown().with_suffix(".cache"), cache)
    finished = go(store, cache, **given)
    assert contents(store) == contents(grown(**given))
    for name, progress in finished.progress.items():
        if name != "answers" or "spring__stiffness" not in given:  # answers gather stiffnesses
            assert progress.reused == CELLS[name], name


def test_extending_an_axis_computes_only_new_cells(grown, tmp_path):
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    go(store, cache)
    CALLS.clear()
    go(store, cache, measured__length=[2, 3, 4])
    assert CALLS == {"noisy": 12, "trace": 12, "answers": 8}  # the cells of one length
    CALLS.clear()
    go(store, cache, measured__length=[2, 3, 4], measured__rule=["max", "mean", "min"])
    assert CALLS == {"answers": 12}  # the cells of one rule


def test_without_a_cache_only_incomplete_stores_are_recomputed(grown, tmp_path):
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


def test_ragged_arrays_are_aligned_by_their_first_index(tmp_path):
    experiment = Experiment("cut", "Cut", (Cut, piece))
    choices = read_choices(experiment.declared, {})
    run(experiment, choices, tmp_path / "s.zarr", tmp_path / "a")
    CALLS.clear()
    run(experiment, choices, tmp_path / "s.zarr", tmp_path / "a")
    assert CALLS == {"piece": 1}  # the cell that failed
    pieces = opened(tmp_path / "s.zarr", "pieces")
    for begin, size in ((3, 1), (3, 4), (5, 4), (9, 1)):
        cell, bins = pieces.sel(begin=begin, size=size), range(begin - 4, begin - 4 + size)
        expected = np.where(np.arange(size) % 2, np.nan, begin)
        np.testing.assert_array_equal(cell.piece.sel(bin=bins), expected)
        assert cell.piece.drop_sel(bin=bins).isnull().all()
        assert (cell.same == 7).all() and cell["tail"].shape == (3, 9)
    assert pieces.piece.sel(begin=9, size=4).isnull().all()


REFUSED = [
    ({"spring__mass": [1, 3]}, "spring.mass is 1, 3, ", " has 2: ", "spring.mass=[1,2,3]"),
    ({"measured__draw": 1}, "measured.draw is 0, ", " has 1: ", "give another store"),
    ({"seed": 3}, "seed is 3, ", " has 0: ", "seed=[0,3]"),
    ({"measured__doubled": True}, "is true, ", " has false: ", "measured.doubled=[false,true]"),
    ({"spring__reference": 4.0}, "is 4, ", " has null: ", "spring.reference=[4,null]"),
]


@pytest.mark.parametrize(("given", "asked", "stored", "advice"), REFUSED)
def test_incompatible_settings_are_refused_by_key(grown, given, asked, stored, advice):
    store = grown()
    before = contents(store)
    with pytest.raises(ConfigurationError) as refused:
        go(store, store.with_suffix(".cache"), **given)
    assert all(word in str(refused.value) for word in (asked, repr(str(store)) + stored, advice))
    assert contents(store) == before


def test_different_library_versions_are_refused(grown, monkeypatch):
    now = provenance.versions
    monkeypatch.setattr(provenance, "versions", lambda plan: now(plan) | {"dask": "9.0"})
    with pytest.raises(ConfigurationError, match="was made by a different version of dask; give"):
        go(grown(), grown().with_suffix(".cache"), spring__mass=[1, 2, 3])


def test_different_code_is_refused(grown):
    store = grown()
    changed = replace(SPRINGS.by_name["period"], function=SPRINGS.by_name["energy"].function)
    springs = having(SPRINGS, (*SPRINGS.stages[:2], changed, *SPRINGS.stages[3:]))
    with pytest.raises(ConfigurationError, match="was made by different code of period \\("):
        run(springs, read_choices(SPRINGS.declared, {}), store)


def joined(*points):
    """Return choices in which stiffness and limit run together, point by point."""
    keys = ("spring.stiffness", "spring.limit")
    given = {key: sorted({point[k] for point in points}) for k, key in enumerate(keys)}
    choices = read_choices(SPRINGS.declared, given | {"measured.draw": 1})
    return replace(choices, zipped=(ZippedAxis("two", keys, points),))


NOT_GATHERED = having(SPRINGS, SPRINGS.stages[:4], ())


def test_zipped_axes_extend_by_whole_points(tmp_path):
    store = tmp_path / "s.zarr"
    more = joined((1.0, 9.0), (1.5, 9.0), (2.0, 8.0))
    run(NOT_GATHERED, joined((1.0, 9.0), (2.0, 8.0)), store)
    CALLS.clear()
    run(NOT_GATHERED, more, store)
    assert CALLS["period"] == 2
    run(NOT_GATHERED, more, tmp_path / "t.zarr")
    assert contents(store) == contents(tmp_path / "t.zarr")
    springs = opened(store, "springs")
    assert springs.period.dims == ("two", "mass")
    assert springs.stiffness.values.tolist() == [1, 1.5, 2] and "limit" in springs.coords
    crossed = joined((1.0, 8.0), (1.5, 9.0), (2.0, 8.0))
    with pytest.raises(ConfigurationError, match=r"spring\.limit, spring\.stiffness together"):
        run(NOT_GATHERED, crossed, store)


# inputs at another setting's value ----------------------------------------------------------------


# Without stages that gather springs, their settings may run together with others.
FEWER = having(SPRINGS, [stage for stage in SPRINGS.stages if stage.name != "answers"], ())
DESCENDING = ((70.0, 4.0), (80.0, 2.0), (90.0, 1.0))  # not in the order of sorted stiffnesses


@pytest.mark.parametrize("points", [DESCENDING, DESCENDING[1:] + DESCENDING[:1]])
def test_input_on_a_zipped_axis_is_selected_by_value(tmp_path, points):
    given = {"spring.mass": 1.0, "spring.limit": [70.0, 80.0, 90.0]}
    given |= {"spring.stiffness": [1.0, 2.0, 4.0], "spring.reference": [1.0, 2.0, 4.0]}
    zipped = ZippedAxis("joint", ("spring.limit", "spring.stiffness"), points)
    choices = replace(read_choices(FEWER.declared, given), zipped=(zipped,))
    run(FEWER, choices, tmp_path / "s.zarr")
    [ratio] = opened(tmp_path / "s.zarr", "references").ratio
    # The limit that runs together with the stiffness gets no dimension of its own.
    assert ratio.dims == ("stiffness_there",)
    for reference in (1.0, 2.0, 4.0):
        expected = 2 * math.pi / round(math.sqrt(reference), 12) / reference
        assert ratio.sel(stiffness_there=reference) == pytest.approx(expected, rel=1e-15)
