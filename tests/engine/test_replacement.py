"""Stores are replaced atomically, despite full disks, kills at any moment and readers."""

import errno
import itertools
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from small_stores import COUNTS, array, below, contents, files, opened, small

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


CHANGES = ("put", "_delete")


class Killed(BaseException):
    """Exception that no writer catches."""


@pytest.fixture
def ending():
    """Yield a function that lets `number` changes succeed and later ones raise; None undoes it."""

    patch = pytest.MonkeyPatch()

    def after(number, raised=Killed, methods=CHANGES):
        patch.undo()
        remaining = itertools.count(1)
        for name in methods if number is not None else ():
            change = getattr(Objects, name)

            def act(objects, *arguments, change=change):
                if next(remaining) > number:
                    raise raised()
                return change(objects, *arguments)

            patch.setattr(Objects, name, act)

    yield after
    patch.undo()


def full():
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "there")


def test_a_disk_that_is_full_leaves_the_old_store_or_all_of_the_new(tmp_path, ending):
    path = tmp_path / "s.zarr"
    write_store(tmp_path / "t.zarr", small(2), {"seed": 2})
    write_store(path, small(1), {"seed": 1})
    before, after = contents(path), contents(tmp_path / "t.zarr")
    for succeeding in range(1000):
        ending(succeeding, full, methods=("put",))  # deletions still succeed
        try:
            write_store(path, small(2), {"seed": 2})
        except OSError as error:
            assert error.errno == errno.ENOSPC
        else:
            break
        finally:
            ending(None)
        assert verify(path) == []
        begun = b'"nodes"' in files(path)["manifest"]
        recover(path)
        assert contents(path) == (after if begun else before)
        assert sorted(os.listdir(tmp_path)) == ["s.zarr", "t.zarr"]
        write_store(path, small(1), {"seed": 1})
        assert contents(path) == before
    assert succeeding > len(small(0)["one"].arrays)
    assert contents(path) == after


def test_a_put_that_fails_is_noticed_though_what_follows_stays(tmp_path, monkeypatch):
    """The store already has the last chunk, and the chunk before it cannot be written."""
    path, put = tmp_path / "s.zarr", Objects.put
    first, last = array(np.zeros((3, 2)), chunks=(1, 2)), array(np.ones((3, 2)), chunks=(1, 2))
    write_store(path, {"g": ArrayGroup({"z": last})}, {})

    def failing(objects, name, content):
        if name == "g/a/c.2.0":
            raise full()
        put(objects, name, content)

    monkeypatch.setattr(Objects, "put", failing)
    before = contents(path)
    first.read = np.arange(6.0).reshape(3, 2).__getitem__
    with pytest.raises(OSError, match="No space left"):
        write_store(path, {"g": ArrayGroup({"a": first, "z": last})}, {})
    assert contents(path) == before


@pytest.mark.parametrize("old", [None, 3])
def test_a_store_is_whole_whenever_its_writer_ends(place, ending, old):
    direct, new = below(place, "direct.zarr"), 5
    write_store(direct, grown(new), {"rows": new})
    # Requests to a bucket take milliseconds: test only every third moment there.
    for succeeding in range(0, 1000, 3 if isinstance(place, str) else 1):
        ending(None)
        path = below(place, f"{succeeding}.zarr")
        if old is not None:
            write_store(path, grown(2), {"rows": 2})
            write_store(path, grown(old), {"rows": old})
            lazy = xr.open_zarr(zarr_store(path), group="one", chunks=None)
        ending(succeeding)
        try:
            write_store(path, grown(new), {"rows": new})
        except Killed:
            ended = False
        else:
            ended = True
        ending(None)
        attributes = read_attributes(path)
        assert (attributes or {"rows": old})["rows"] in (old, new)
        if old is not None:  # readers that opened the store before still read the old values
            np.testing.assert_array_equal(lazy["x"].values[:, 0], np.arange(old))
        if attributes is not None:
            assert verify(path) == []
            tree = xr.open_datatree(zarr_store(path), engine="zarr", chunks=None)
            for name in ("one", "two/three"):
                dataset = xr.open_zarr(zarr_store(path), group=name, chunks=None)
                assert dataset.sizes["ship"] in (old, new)
                assert tree[name].sizes["ship"] == attributes["rows"]
                for opened_group in (dataset, tree[name].to_dataset(inherit=False)):
                    np.testing.assert_array_equal(
                        opened_group["x"].values[:, 0], np.arange(opened_group.ship.size)
                    )
                    assert (
                        opened_group.get("note", opened_group.sizes["ship"])
                        == opened_group.sizes["ship"]
                    )
        else:
            assert "zarr.json" not in files(path)
        with store_lock(path):
            recover(path)
            write_store(path, grown(new), {"rows": new})
        assert contents(path) == contents(direct)
        if ended:
            break
    assert succeeding > 10


@pytest.mark.parametrize("where", ["read", "manifest"])
def test_an_interrupt_leaves_the_old_store(tmp_path, monkeypatch, where):
    path = tmp_path / "s.zarr"
    write_store(path, small(1), {})
    before = contents(path)

    def interrupt(*_):
        raise KeyboardInterrupt

    groups = small(2)
    if where == "read":
        groups["z"] = ArrayGroup({"x": array(COUNTS, read=interrupt)})
    if where == "manifest":
        monkeypatch.setattr("sweeps.engine.store.manifest.seal", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_store(path, groups, {})
    assert os.listdir(tmp_path) == ["s.zarr"]
    assert contents(path) == before


WRITER = """
import os, sys
from pathlib import Path
from small_stores import small

from sweeps.engine.store.locks import store_lock
from sweeps.engine.store.writing import write_store

path = Path(sys.argv[1])
for _ in sys.stdin:  # for each line a writer, until it is killed
    child = os.fork()
    if child == 0:
        with store_lock(path):
            while True:
                for value in (1, 2):
                    write_store(path, small(value), {"value": value})
    print(child, flush=True)
    os.waitpid(child, 0)
    print("dead", flush=True)
"""


def test_a_store_is_whole_whenever_its_writer_is_killed(tmp_path):
    path = tmp_path / "s.zarr"
    write_store(path, small(1), {"value": 1})
    delays = random.Random(5)
    search = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    states, kills = set(), 0
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": search},
    ) as server:
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
            recover(path)  # the next writer calls this first
            value = read_attributes(path)["value"]
            assert verify(path) == []
            assert all((opened(path, name)["x"] == value).all() for name in small(0))
            states.add(value)
    assert states == {1, 2}
    with store_lock(path):  # the lock of a killed writer does not block; its files are removed
        recover(path)
        assert sorted(os.listdir(tmp_path)) == [".s.zarr.lock", "s.zarr"]
    assert os.listdir(tmp_path) == ["s.zarr"]


def test_readers_of_a_growing_store_never_see_two(place):
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


def test_the_chunks_of_an_array_that_grows_stay_and_are_not_read(tmp_path):
    path = tmp_path / "s.zarr"
    values = np.arange(12.0).reshape(4, 3)

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
        (everything, everything),
        (everything, []),
    ):
        before = {name: os.stat(path / "g/x" / name).st_ino for name in chunks(path)}
        expected, read = groups(rows)
        write_store(path, expected, {"rows": rows})
        assert read == new
        assert (opened(path, "g")["x"] == values[rows]).all()
        inodes = {os.stat(path / "g/x" / name).st_ino for name in chunks(path)}
        assert len(inodes) == len(rows)
        assert new == everything or inodes.issuperset(before.values())
    assert sorted(chunks(path)) == ["0.0", "1.0", "2.0", "3.0"]  # a change moved a chunk


def chunks(path):
    folder = path / "g/x"
    return [name for name in os.listdir(folder) if name != "zarr.json"] if folder.exists() else []


def test_a_damaged_chunk_is_written_again(tmp_path):
    path = tmp_path / "s.zarr"
    write_store(path, grown(3), {})
    (path / "one/x/c.1.0").write_bytes(b"other")
    (path / "two/three/x/c.2.0").unlink()
    write_store(path, grown(4), {})
    write_store(tmp_path / "t.zarr", grown(4), {})
    assert contents(path) == contents(tmp_path / "t.zarr")
