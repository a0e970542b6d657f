"""After failed cells, damaged results and full disks, a later run completes the same store."""

import numpy as np
import pytest
import xarray as xr
from packed import pack_files
from small_stores import contents, ending_after, files, full, opened
from toys import CALLS, SPRINGS, Few, Recorder, go, having, of, run

from sweeps.engine.declare.settings import read_choices
from sweeps.engine.declare.stage import Group, Output, Status, Table, in_memory, stage
from sweeps.engine.store.writing import read_attributes

STIFF = "ValueError: too [stiff]"


def test_failing_cell_fails_only_its_dependents(tmp_path):
    store, recorder = tmp_path / "s.zarr", Recorder()
    finished = go(store, callbacks=recorder.callbacks, spring__limit=1.5)
    name = "period stiffness=4 mass=1"
    assert recorder.failures == finished.failures == [(name, STIFF)]
    failures = read_attributes(store)["failures"]
    needing = {
        f"noisy stiffness=4 mass=1 length={length} draw={draw}": f"needs {name}, which failed"
        for length in (2, 4)
        for draw in (0, 1)
    }
    assert failures == {name: STIFF, **needing}
    springs, status = opened(store, "springs"), opened(store, "status")
    lost = {"stiffness": 4.0, "mass": 1.0}
    for variable in ("period", "noisy"):
        assert np.isnan(springs[variable].sel(lost)).all()
        assert (status[variable].sel(lost) == 0).all()
        assert np.isfinite(springs[variable]).sum() == (status[variable] == 1).sum()
    assert (status.energy == 1).all() and (status.trace == 1).all()
    # A stage that gathers cells with a mask is computed without the failed ones.
    noisy, answers, states = springs.noisy, opened(store, "answers"), opened(store, "status").taken
    assert (states.sel(mass=1, stiffness=4) == 0).all()
    assert states.sum() == 2 * 2 * 2 * (3 * 2 - 1)
    np.testing.assert_array_equal(
        answers.answer.sel(rule="max"), noisy.max("stiffness").transpose("mass", "length", "draw")
    )


class Broken(dict):
    """Values for which stages fail; pickled by name, so that keys do not depend on the values."""

    def __reduce__(self):
        return "BROKEN"


BROKEN = Broken(values=frozenset())
ALL = Group("all", status=Status("all", "state of all", (Few.size,)))


@stage(Output("first", label="first", dtype="f8"), uses=(Few,), along=(Few.size,), group=ALL)
def first(size):
    """Return roots of all sizes in one call, which fails if it has any of the failing values."""
    if BROKEN["values"] & set(size):
        raise RuntimeError("out of order")
    return np.sqrt(size)


@in_memory(uses=(Few,))
def made(size):
    """Return the size; fail if size + 10 is among the failing values."""
    if size + 10 in BROKEN["values"]:
        raise RuntimeError("cannot be made")
    return size


@stage(Output("second", label="second", dtype="f8"), uses=(Few,), group=ALL)
def second(first, made):
    """Return the sum of the results of two stages."""
    return first + made


@stage(Output("total", label="total", dtype="f8"), uses=(Few,), gather=(Few.size,), group=ALL)
def total(second, valid):
    """Return the sum over all valid cells."""
    return second[valid].sum()


@in_memory(uses=(Few,), gather=(Few.size,))
def largest(second):
    """Return an object that needs all cells of `second`."""
    return second.max()


@stage(Output("share", label="share", dtype="f8"), uses=(Few,), group=ALL)
def share(second, largest):
    """Return a result that needs all cells of `second`, through an object."""
    return second / largest


FLAKY = of(first, made, second, total)


@pytest.fixture
def broken():
    """Yield the values for which stages fail; clear them at the end."""
    yield BROKEN
    BROKEN["values"] = frozenset()


@pytest.mark.parametrize("values", [{2}, {3, 11}, {1, 2, 3, 4}])
def test_rerun_after_failures_matches_a_clean_run(tmp_path, broken, values):
    choices = read_choices(FLAKY.declared, {"few.size": [1, 2, 3, 4]})
    run(FLAKY, choices, tmp_path / "clean.zarr")
    broken["values"] = frozenset(values)
    store = tmp_path / "s.zarr"
    assert len(run(FLAKY, choices, store).failures) == len(values)
    there, state = opened(store, "all"), opened(store, "status")["all"]
    failed = [n in values or n + 10 in values for n in (1, 2, 3, 4)]
    # The state marks the cells of sizes that failed and no others.
    assert (state == np.where(failed, 0, 1)).all()
    assert there["first"].isnull().values.tolist() == [n in values for n in (1, 2, 3, 4)]
    assert there["second"].isnull().values.tolist() == failed
    expected = sum(np.sqrt(n) + n for n in (1, 2, 3, 4) if not {n, n + 10} & values)
    everything = np.nan if len(values) == 4 else expected
    np.testing.assert_allclose(there["total"], everything, rtol=1e-15)
    broken["values"] = frozenset()
    assert run(FLAKY, choices, store).written
    assert contents(store) == contents(tmp_path / "clean.zarr")


# damage -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [-3, 20], ids=["record", "head"])
def test_damaged_packs_are_recomputed_and_reported(tmp_path, at):
    store, cache, recorder = tmp_path / "s.zarr", tmp_path / "cache", Recorder()
    go(store, cache)
    before = contents(store)
    for file in pack_files(cache):
        content = bytearray(file.read_bytes())
        content[at] ^= 4
        file.write_bytes(content)
    CALLS.clear()
    finished = go(tmp_path / "t.zarr", cache, callbacks=recorder.callbacks)
    said = [line for line in recorder.sentences if "results in the cache are damaged" in line]
    assert len(said) == 1  # one round mends the cells of all stages
    assert 0 < sum(CALLS.values()) <= 78
    assert contents(tmp_path / "t.zarr") == before
    for progress in finished.progress.values():
        assert progress.reused + progress.done == progress.total and progress.done >= 0
    wider = {"measured__rule": ["max", "mean", "min"]}
    go(store, cache, **wider)
    go(tmp_path / "clean.zarr", **wider)
    assert contents(store) == contents(tmp_path / "clean.zarr")


@pytest.mark.parametrize("kept", [True, False], ids=["with cache", "without cache"])
def test_missing_or_truncated_chunks_are_restored_and_reported(tmp_path, kept):
    store, cache, recorder = tmp_path / "s.zarr", tmp_path / "cache", Recorder()
    go(store, cache)
    before, names = contents(store), files(store)
    short = store / next(name for name in names if name.startswith("answers/answer/c."))
    short.write_bytes(short.read_bytes()[:-1])
    (store / next(name for name in names if name.startswith("springs/period/c."))).unlink()
    CALLS.clear()
    go(store, cache if kept else tmp_path / "new", callbacks=recorder.callbacks)
    assert any("files of the store are damaged" in sentence for sentence in recorder.sentences)
    assert bool(CALLS["answers"]) == (not kept)
    assert contents(store) == before


# disks --------------------------------------------------------------------------------------------


def test_sweep_resumes_after_a_full_cache_disk(tmp_path):
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    with pytest.raises(OSError, match="No space left on device"), ending_after(9, ["put"], full):
        go(store, cache)
    assert [path.name for path in tmp_path.iterdir()] == ["cache"] and pack_files(cache)
    finished = go(store, cache)
    assert sum(progress.reused for progress in finished.progress.values()) > 0
    go(tmp_path / "t.zarr")
    assert contents(store) == contents(tmp_path / "t.zarr")


@pytest.mark.parametrize("values", [{2}, {12}])
def test_unmasked_gather_fails_if_any_cell_fails(tmp_path, broken, values):
    experiment = of(first, made, second, largest, share)
    choices = read_choices(experiment.declared, {"few.size": [1, 2, 3, 4]})
    broken["values"] = frozenset(values)
    run(experiment, choices, tmp_path / "s.zarr")
    reasons = read_attributes(tmp_path / "s.zarr")["failures"]
    needs = {size: reasons[f"share size={size}"] for size in (1, 2, 3, 4)}
    of_object, of_cell = "needs largest, which failed", "needs second size=2, which failed"
    assert needs == {1: of_object, 2: of_cell, 3: of_object, 4: of_object}
    broken["values"] = frozenset()
    run(experiment, choices, tmp_path / "s.zarr")
    shares = opened(tmp_path / "s.zarr", "all")["share"]
    sizes = np.arange(1, 5)
    np.testing.assert_allclose(shares, (np.sqrt(sizes) + sizes) / 6)


# tables -------------------------------------------------------------------------------------------


def mute(answers, choices):
    """Make a table, but do not return it."""
    answers.assign(x=1)


MUTE = f"test_failures.py:{mute.__code__.co_firstlineno}: its function has no return, but must"
SPOILT = [
    (lambda answers, choices: answers["nothing"], "KeyError: "),
    (lambda answers, choices: xr.Dataset({"x": ("y", np.array([1], "m8[s]"))}), "TypeError: "),
    (lambda answers, choices: {"x": 1}, "returned a dict, but must return a data set or None"),
    (mute, MUTE),
]


@pytest.mark.parametrize(("make", "reason"), SPOILT)
def test_failing_table_fails_only_its_dependents(tmp_path, make, reason):
    spoilt = Table("tables/spoilt", ("answers",), make)
    after = Table("tables/after", ("tables/spoilt",), lambda spoilt, choices: spoilt)
    tables, choices = (spoilt, after, *SPRINGS.tables), read_choices(SPRINGS.declared, {})
    finished = run(having(SPRINGS, tables=tables), choices, tmp_path / "s.zarr")
    names, reasons = zip(*finished.failures, strict=True)
    assert names == ("table tables/spoilt", "table tables/after") and finished.written
    assert reason in reasons[0] and reasons[1] == "needs table tables/spoilt, which failed"
    assert read_attributes(tmp_path / "s.zarr")["failures"] == dict(finished.failures)
    assert "best" in opened(tmp_path / "s.zarr", "tables/best")
    # Without the failing tables, a run reuses all results.
    again = run(SPRINGS, choices, tmp_path / "s.zarr", tmp_path / "s.cache")
    assert again.failures == [] and sum(progress.done for progress in again.progress.values()) == 0
    run(SPRINGS, choices, tmp_path / "t.zarr", tmp_path / "s.cache")
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr")
