"""After failed cells, damaged results and full disks, a later run completes the same store."""

import errno
import time

import numpy as np
import pytest
from packed import pack_files
from small_stores import contents, files, opened
from toys import CALLS, Few, Recorder, go, of, run

from sweeps.engine.cache.packs import PackWriter
from sweeps.engine.declare.settings import read_choices
from sweeps.engine.declare.stage import Group, Output, Status, in_memory, stage
from sweeps.engine.objects import Objects
from sweeps.engine.run.schedule import Schedule
from sweeps.engine.store.writing import read_attributes

STIFF = "ValueError: too [stiff]"


def test_a_cell_that_raises_fails_alone_with_its_reason(tmp_path):
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


@stage(
    Output("first", label="first", dtype="f8"),
    uses=(Few,),
    along=(Few.size,),
    group=ALL,
)
def first(size):
    """Return roots of all sizes in one call, which fails if it has any of the failing values."""
    CALLS["first"] += len(size)
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


@stage(
    Output("total", label="total", dtype="f8"),
    uses=(Few,),
    gather=(Few.size,),
    group=ALL,
)
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


@pytest.mark.parametrize("values", [{2}, {1, 4}, {12}, {3, 11}, {1, 2, 3, 4}])
def test_a_run_after_failures_makes_the_store_of_one_without(tmp_path, broken, values):
    choices = read_choices(FLAKY.declared, {"few.size": [1, 2, 3, 4]})
    run(FLAKY, choices, tmp_path / "clean.zarr")
    broken["values"] = frozenset(values)
    store = tmp_path / "s.zarr"
    finished = run(FLAKY, choices, store)
    assert {why for _, why in finished.failures} <= {
        "RuntimeError: out of order",
        "RuntimeError: cannot be made",
    }
    assert len(finished.failures) == len(values)
    there, state = opened(store, "all"), opened(store, "status")["all"]
    failed = [n in values or n + 10 in values for n in (1, 2, 3, 4)]
    # The state marks the cells of sizes that failed and no others.
    assert (state == np.where(failed, 0, 1)).all()
    assert np.isfinite(there["first"]).sum() == 4 - len({value for value in values if value < 10})
    assert np.isfinite(there["second"]).sum() == 4 - len(values)
    expected = sum(np.sqrt(n) + n for n in (1, 2, 3, 4) if not {n, n + 10} & values)
    everything = np.nan if len(values) == 4 else expected
    np.testing.assert_allclose(there["total"], everything, rtol=1e-15)
    broken["values"] = frozenset()
    assert run(FLAKY, choices, store).written
    assert contents(store) == contents(tmp_path / "clean.zarr")


# damage -------------------------------------------------------------------------------------------


def damage(file, at=-3):
    """Flip a bit of a file."""
    content = bytearray(file.read_bytes())
    content[at] ^= 4
    file.write_bytes(content)


@pytest.mark.parametrize("way", ["flipped", "short", "gone", "header"])
def test_damaged_packs_are_made_again_and_said(tmp_path, way):
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    go(store, cache)
    before = contents(store)
    for file in pack_files(cache):
        match way:
            case "flipped":
                damage(file)
            case "short":
                file.write_bytes(file.read_bytes()[:-1])
            case "gone":
                file.unlink()
            case "header":
                damage(file, at=20)
    recorder = Recorder()
    CALLS.clear()
    finished = go(tmp_path / "t.zarr", cache, callbacks=recorder.callbacks)
    if way == "gone":
        assert CALLS["noisy"] == 24  # the index has no such packs, so there is no warning
    else:
        assert any(
            "results in the cache are damaged" in sentence for sentence in recorder.sentences
        )
        assert 0 < sum(CALLS.values()) <= 78
    assert contents(tmp_path / "t.zarr") == before
    for progress in finished.progress.values():
        assert progress.reused + progress.done == progress.total and progress.done >= 0
    wider = {"measured__rule": ["max", "mean", "min"]}
    go(store, cache, **wider)
    go(tmp_path / "clean.zarr", **wider)
    assert contents(store) == contents(tmp_path / "clean.zarr")


@pytest.mark.parametrize("kept", [True, False], ids=["with cache", "without cache"])
def test_a_chunk_that_is_lost_or_cut_short_is_made_again_and_said(tmp_path, kept):
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


def test_a_full_cache_stops_a_sweep_that_is_resumed(tmp_path, monkeypatch):
    write, packed = PackWriter.write, []

    def full(packing, folder, *what):
        if packed:
            raise OSError(errno.ENOSPC, "No space left on device", str(folder))
        packed.append(what)
        return write(packing, folder, *what)

    monkeypatch.setattr(PackWriter, "write", full)
    with pytest.raises(OSError, match="No space left on device"):
        go(tmp_path / "s.zarr", tmp_path / "cache")
    assert [path.name for path in tmp_path.iterdir()] == ["cache"]
    monkeypatch.undo()
    finished = go(tmp_path / "s.zarr", tmp_path / "cache")
    assert sum(progress.reused for progress in finished.progress.values()) > 0
    go(tmp_path / "t.zarr")
    assert contents(tmp_path / "s.zarr") == contents(tmp_path / "t.zarr")


def test_a_store_that_cannot_be_written_stays_as_it_was(tmp_path, monkeypatch):
    store = tmp_path / "s.zarr"
    go(store)
    before = contents(store)
    put = Objects.put

    def full(objects, name, content):
        if "noisy" in name:
            raise OSError(errno.ENOSPC, "No space left on device", name)
        put(objects, name, content)

    monkeypatch.setattr(Objects, "put", full)
    with pytest.raises(OSError, match="No space left"):
        go(store, spring__mass=[1, 2, 3])
    assert contents(store) == before
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []
    monkeypatch.undo()
    CALLS.clear()
    go(store, spring__mass=[1, 2, 3])
    assert not CALLS  # the cache has all results
    go(tmp_path / "t.zarr", spring__mass=[1, 2, 3])
    assert contents(store) == contents(tmp_path / "t.zarr")


@pytest.mark.parametrize("values", [{2}, {12}])
def test_what_gathers_all_without_a_mask_fails_with_one_of_them(tmp_path, broken, values):
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


@stage(Output("slow", label="slow", dtype="f8"), uses=(Few,), group=ALL)
def slow(size):
    """Sleep 0.3 s for size 1; fail at once for other sizes."""
    if size > 1:
        raise RuntimeError("too large")
    time.sleep(0.3)
    return size


def test_failed_calls_do_not_make_cells_look_cheap(tmp_path, monkeypatch):
    schedules = []
    record = Schedule.record_outcome

    def recorded(self, *arguments, **keywords):
        schedules.append(self)
        return record(self, *arguments, **keywords)

    monkeypatch.setattr(Schedule, "record_outcome", recorded)
    experiment = of(slow)
    choices = read_choices(experiment.declared, {"few.size": list(range(1, 21))})
    run(experiment, choices, tmp_path / "s.zarr")
    assert schedules[-1].costs["slow"] >= 0.3
