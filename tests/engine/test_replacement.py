"""Stores are replaced atomically, despite full disks, kills at any moment and readers."""

import errno
import os
import random
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress

import numpy as np
import pytest
import xarray as xr
from executors import IMPORTS
from small_stores import (
    Killed,
    array,
    below,
    contents,
    ending_after,
    files,
    full,
    opened,
    small,
)

from sweeps.engine.objects import Objects
from sweeps.engine.store.arrays import Array, ArrayGroup
from sweeps.engine.store.locks import store_lock
from sweeps.engine.store.manifest import verify
from sweeps.engine.store.writing import read_attributes, recover, write_store, zarr_store


def grown(rows):
    """Return groups with a number of rows; more rows leave the first ones unchanged."""
    values = np.add.outer(np.arange(rows), np.zeros(6)).astype("f4")
    x, note = array(values, chunks=(1, 6)), Array.from_values((), np.float64(rows))
    return {"one": ArrayGroup({"x": x, "note": note}), "two/three": ArrayGroup({"x": x})}


def test_full_disk_leaves_the_old_or_the_new_store(tmp_path):
    path = tmp_path / "s.zarr"
    write_store(tmp_path / "t.zarr", small(2), {"seed": 2})
    write_store(path, small(1), {"seed": 1})
    before, after = contents(path), contents(tmp_path / "t.zarr")
    for succeeding in range(1000):
        try:
            with ending_after(succeeding, ["put"], full):  # deletions still succeed
                write_store(path, small(2), {"seed": 2})
            break
        except OSError as error:
            assert error.errno == errno.ENOSPC
        assert verify(path) == []
        begun = b'"nodes"' in files(path)["manifest"]
        recover(path)
        assert contents(path) == (after if begun else before)
        assert sorted(os.listdir(tmp_path)) == ["s.zarr", "t.zarr"]
        write_store(path, small(1), {"seed": 1})
    assert succeeding > len(small(0)["one"].arrays)
    assert contents(path) == after


def test_failed_put_raises_even_if_later_puts_succeed(tmp_path, monkeypatch):
    path, put = tmp_path / "s.zarr", Objects.put

    def failing(objects, name, content):
        if name == "g/a/c.1.0":
            raise full()
        put(objects, name, content)

    monkeypatch.setattr(Objects, "put", failing)
    values = np.arange(6.0).reshape(3, 2)
    with pytest.raises(OSError, match="No space left"):
        write_store(path, {"g": ArrayGroup({"a": array(values, chunks=(1, 2))})}, {})
    assert not path.exists()


@pytest.mark.parametrize("old", [None, 3])
def test_store_is_consistent_after_a_failed_write(place, old):
    direct, new = below(place, "direct.zarr"), 5
    write_store(direct, grown(new), {"rows": new})
    # Requests to a bucket take milliseconds: test only every fifth moment there.
    for succeeding in range(0, 1000, 5 if isinstance(place, str) else 1):
        path = below(place, f"{succeeding}.zarr")
        if old is not None:
            write_store(path, grown(2), {"rows": 2})
            write_store(path, grown(old), {"rows": old})
            lazy = xr.open_zarr(zarr_store(path), group="one", chunks=None)
        ended = False
        with suppress(Killed), ending_after(succeeding):
            write_store(path, grown(new), {"rows": new})
            ended = True
        attributes = read_attributes(path)
        assert (attributes or {"rows": old})["rows"] in (old, new)
        if old is not None:  # readers that opened the store before still read the old values
            np.testing.assert_array_equal(lazy["x"].values[:, 0], np.arange(old))
        if attributes is None:
            assert "zarr.json" not in files(path)
        else:
            assert verify(path) == []
            tree = xr.open_datatree(zarr_store(path), engine="zarr", chunks=None)
            for name in ("one", "two/three"):
                dataset = xr.open_zarr(zarr_store(path), group=name, chunks=None)
                assert dataset.sizes["ship"] in (old, new)
                assert tree[name].sizes["ship"] == attributes["rows"]
                for group in (dataset, tree[name].to_dataset(inherit=False)):
                    rows = group.sizes["ship"]
                    np.testing.assert_array_equal(group["x"].values[:, 0], np.arange(rows))
                    assert group.get("note", rows) == rows
        with store_lock(path):
            recover(path)
            write_store(path, grown(new), {"rows": new})
        assert contents(path) == contents(direct)
        if ended:
            break
    assert succeeding > 10


WRITER = """
import os, sys
from pathlib import Path
from small_stores import small
from sweeps.engine.store.locks import store_lock
from sweeps.engine.store.writing import recover, write_store

path = Path(sys.argv[1])
for line in sys.stdin:  # of each, a writer that is killed
    if os.fork() == 0:
        with store_lock(path):
            recover(path)
            print(os.getpid(), flush=True)
            while True:
                for value in (1, 2):
                    write_store(path, small(value), {"value": value})
    os.wait()
    print("dead", flush=True)
"""


def test_store_is_consistent_after_its_writer_is_killed(tmp_path):
    path = tmp_path / "s.zarr"
    write_store(path, small(1), {"value": 1})
    delays = random.Random(5)
    states, kills = set(), 0
    options = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    environment = os.environ | {"PYTHONPATH": IMPORTS}
    command = [sys.executable, "-c", WRITER, path]
    with subprocess.Popen(command, env=environment, **options) as server:
        while kills < 10 or (len(states) < 2 and kills < 300):
            kills += 1
            print(file=server.stdin, flush=True)
            child = int(server.stdout.readline())
            time.sleep(delays.uniform(0.005, 0.08))
            os.kill(child, signal.SIGKILL)
            assert server.stdout.readline() == "dead\n"
            assert verify(path) == []
            arrays = [opened(path, name)["x"].values for name in small(0)]
            assert all((values == values.flat[0]).all() for values in arrays)
            recover(path)
            value = read_attributes(path)["value"]
            assert verify(path) == []
            assert all((opened(path, name)["x"] == value).all() for name in small(0))
            states.add(value)
    assert states == {1, 2}
    with store_lock(path):  # the lock of a killed writer does not block
        assert sorted(os.listdir(tmp_path)) == [".s.zarr.lock", "s.zarr"]
    assert os.listdir(tmp_path) == ["s.zarr"]


def test_growing_an_array_neither_reads_nor_rewrites_old_chunks(tmp_path):
    path, folder = tmp_path / "s.zarr", tmp_path / "s.zarr/g/x"
    values = np.arange(12.0).reshape(4, 3)

    def inodes():
        chunks = [file for file in folder.glob("*") if file.name != "zarr.json"]
        return {file.stat().st_ino for file in chunks}

    def groups(rows):
        read = []

        def region(index):
            read.append(index[0].start)
            return values[rows][index]

        x = array(values[rows], chunks=(1, 3), read=region)
        x.source_bytes = lambda region: repr(rows[region[0].start]).encode()
        return {"g": ArrayGroup({"x": x})}, read

    everything = [0, 1, 2, 3]
    for rows, new in (
        ([0, 1], [0, 1]),
        ([0, 1, 3], [2]),
        (everything, everything),  # a change moves a chunk
        (everything, []),
    ):
        before = inodes()
        expected, read = groups(rows)
        write_store(path, expected, {"rows": rows})
        assert read == new
        assert (opened(path, "g")["x"] == values[rows]).all()
        assert len(inodes()) == len(rows)
        assert new == everything or inodes() >= before


def test_readers_never_see_mixed_states_of_a_growing_store(place):
    path = below(place, "s.zarr")
    write_store(path, grown(1), {})
    done = threading.Event()

    def grow():
        try:
            for rows in range(2, 14):
                write_store(path, grown(rows), {})
                time.sleep(0.05)  # a reader must reopen the store after two changes
        finally:
            done.set()

    writer = threading.Thread(target=grow)
    writer.start()
    states, before = set(), xr.open_zarr(zarr_store(path), group="one", chunks=None)
    while not done.is_set():
        dataset = xr.open_zarr(zarr_store(path), group="one", chunks=None).load()
        rows = dataset.sizes["ship"]
        np.testing.assert_array_equal(dataset["x"], np.add.outer(np.arange(rows), np.zeros(6)))
        assert dataset["note"] == rows
        states.add(rows)
    writer.join()
    assert len(states) > 1
    np.testing.assert_array_equal(before["x"], np.zeros((1, 6)))  # its chunks are still in place
