"""`--status` shows the progress of a sweep, and `partial=true` stores the results it has so far."""

import json
import os
import re
import signal
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from executors import eventually, meanwhile
from small_stores import contents, opened
from toys import SPRINGS, go

from sweeps.engine.command import status
from sweeps.engine.command.line import Command
from sweeps.engine.command.status import format_status
from sweeps.engine.objects import Objects
from sweeps.engine.run import progress
from sweeps.engine.store.locks import cache_lock
from sweeps.engine.store.writing import read_attributes

GIVEN = ["store=s.zarr", "cache=cache", "cluster=inline"]
SEEN = ["--status", *GIVEN[:2]]


@pytest.fixture
def start(tmp_path, monkeypatch, capsys):
    """Yield a function that runs a command line in a new folder and returns its output."""
    monkeypatch.chdir(tmp_path)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def run(*arguments, status=0):
        assert Command(SPRINGS).main(arguments) == status
        output = capsys.readouterr()
        return output.err if status else output.out

    yield run
    signal.signal(signal.SIGINT, before)


def rows(text):
    """Return the words of each row of a table, by the first word."""
    return {words[0]: words[1:] for words in map(str.split, text.splitlines()[2:])}


def test_status_shows_running_stopped_and_finished_sweeps(start, monkeypatch):
    monkeypatch.setattr(progress, "SAVE_INTERVAL", 0.0)
    monkeypatch.setattr(progress, "MIN_WORK", 0.2)
    tables = []

    def look():
        eventually(lambda: len(list(Path("cache").rglob("*.pack"))) > 2)
        eventually(estimated)
        os.kill(os.getpid(), signal.SIGINT)

    def estimated():
        tables[:] = [format_status(Path("s.zarr"), Path("cache"))]
        return [*tables[0][1].columns[-1].cells][-1]

    with meanwhile(look):
        start(*GIVEN, "measured.pause=0.2", status=130)
    ((sentence, table),) = tables
    assert f"s.zarr: running as process {os.getpid()}; begun 20" in sentence
    names, *counts, left = [[*column.cells] for column in table.columns]
    assert set(names) == {"period", "energy", "noisy", "trace", "answers", "all"}
    total, reused, done, failed, waiting = (int(column[-1]) for column in counts)
    assert (total, reused, failed) == (74, 0, 0) and 0 < done == 74 - waiting < 74
    assert left[-1].startswith("0:00:")
    output = start(*SEEN)
    assert output.startswith("s.zarr: stopped; begun ") and "time left" not in output
    assert rows(output)["all"][0] == "74" and 0 < int(rows(output)["all"][2]) < 74
    start(*GIVEN, "measured.pause=0.2")
    output = start(*SEEN)
    assert output.startswith("s.zarr: finished; begun ")
    _, reused, done, failed, remaining = map(int, rows(output)["all"])
    assert reused > 0 and reused + done == 74 and failed == remaining == 0


def test_status_of_a_finished_sweep_has_no_cells_left(start):
    start(*GIVEN)
    for _ in range(2):  # the second sweep computes nothing and keeps the counts of the first
        output = start(*SEEN)
        assert output.startswith("s.zarr: finished; ")
        assert rows(output)["all"] == ["74", "0", "74", "0", "0"]
        assert all(row[-1] == "0" for row in rows(output).values())
        start(*GIVEN)


def test_status_shows_last_heartbeat_of_a_killed_bucket_sweep(start, bucket, monkeypatch):
    store = f"{bucket}/s.zarr"
    start(f"store={store}", *GIVEN[1:])
    (file,) = Path("cache", "status").iterdir()
    state = json.loads(file.read_text())
    file.write_text(json.dumps(state | {"ended": "stopped"}))  # the state during a run
    lock = Objects(bucket)
    lock.put(".s.zarr.lock", b"process 1 on host since 2000-01-01T00:00:00")
    seen = ["--status", f"store={store}", "cache=cache"]
    assert f"running as process {os.getpid()}; " in start(*seen)
    monkeypatch.setattr(status, "LEASE", -1.0)
    assert f"stopped: no sign of process {os.getpid()} for 0:00:0" in start(*seen)
    lock.delete([".s.zarr.lock"])
    assert f"{store}: stopped; " in start(*seen)


def test_invalid_status_requests_are_refused(start):
    output = start("--status", "store=t.zarr", "cache=cache", status=2)
    assert "no sweep of 't.zarr' is recorded in the cache 'cache'; give the store=" in output
    assert "store is 't.zarr', which does not exist" in start("--why", "store=t.zarr", status=2)
    assert "spring.mas is not a key" in start(*SEEN, "spring.mas=1", status=2)
    assert "--status has 's.zarr', but takes settings" in start("--status", "s.zarr", status=2)
    assert "--cache has '--status', but takes settings" in start(*SEEN, "--cache", status=2)
    start(*GIVEN)
    (file,) = Path("cache", "status").iterdir()
    for content in ("", "{}", "[1]", '{"stages": {"x": 1}}'):
        file.write_text(content)
        assert "whose state of the sweep of 's.zarr' cannot be read" in start(*SEEN, status=2)


def test_partial_store_is_completed_by_a_full_run(start, tmp_path):
    start("store=narrow.zarr", *GIVEN[1:], "spring.mass=1")
    start(*GIVEN, "partial=true")
    store = tmp_path / "s.zarr"
    attributes = read_attributes(store)
    missing, _, total = attributes["partial"].split()[:3]
    assert total == "74" and 0 < int(missing) < 74
    assert xr.open_zarr(store, group="springs").partial == attributes["partial"]
    springs, states = opened(store, "springs"), opened(store, "status")
    assert {*np.unique(states.to_array())} == {-1, 1}
    go(tmp_path / "t.zarr")
    results = opened(tmp_path / "t.zarr", "springs")
    for name in ("period", "energy"):
        xr.testing.assert_equal(springs[name], results[name].where(states[name] == 1))
    start(*GIVEN)
    assert contents(store) == contents(tmp_path / "t.zarr")


def test_partial_run_never_replaces_a_complete_store(start, tmp_path):
    start(*GIVEN, "partial=true")
    assert read_attributes(tmp_path / "s.zarr")["partial"] == "74 of 74 cells are missing"
    assert (opened(tmp_path / "s.zarr", "status").period == -1).all()
    start(*GIVEN)
    complete = contents(tmp_path / "s.zarr")
    output = start(*GIVEN, "partial=true", "spring.mass=[1,2,3]", status=2)
    assert "s.zarr', a complete store; partial=true would drop results" in output
    assert contents(tmp_path / "s.zarr") == complete


def test_a_cache_is_pruned_unless_a_sweep_uses_it(start):
    assert "0 cells, 0.0 MB removed" in start("--cache", "clear", "cache=absent")
    assert not Path("absent").exists()
    start(*GIVEN)
    assert re.match(r"\d+ cells, .* MB kept in cache", start("--cache", "cache=cache"))
    packs = sorted(Path("cache").rglob("*.pack"), key=lambda pack: pack.name)
    with cache_lock(Path("cache", "cells").absolute()):
        output = start("--cache", "clear", "cache=cache", status=2)
        assert "cache is 'cache', which a sweep uses; wait until it ends" in output
    assert "removed" in start("--cache", f"prune={packs[-1].stat().st_size}B", "cache=cache")
    assert [*Path("cache").rglob("*.pack")] == packs[-1:]
    output = start("--cache", "prune=much", "cache=cache", status=2)
    assert "prune=much must be a size, such as prune=20GB" in output
    assert "removed" in start("--cache", "clear", "cache=cache")
    assert not [*Path("cache").rglob("*.pack")]


def test_sweep_warns_when_the_cache_exceeds_its_limit(start, capsys):
    assert Command(SPRINGS).main([*GIVEN, "cache_limit=1e-6"]) == 0
    message = "more than cache_limit, 1e-06 GB; `springs --cache prune=1e-06GB` deletes the oldest"
    assert message in capsys.readouterr().err
