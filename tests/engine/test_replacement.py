"""Stores are replaced whole or not at all: full disks, kills, readers."""

import errno
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import xarray as xr
from small_stores import COUNTS, array, files, opened, small

from sweeps.engine import folders, store
from sweeps.engine.folders import locked, verify
from sweeps.engine.store import read_attributes, write_store
from sweeps.engine.zarr_array import Group


@pytest.fixture(params=["exchange", "two renames"])
def swapping(request, monkeypatch):
    if request.param == "two renames":
        monkeypatch.setattr(folders, "_exchange", lambda one, other: False)


@pytest.mark.usefixtures("swapping")
def test_any_failed_write_leaves_the_old_store(tmp_path, monkeypatch):
    path = tmp_path / "s.zarr"
    write_store(path, small(1), {"seed": 1})
    before = files(path)
    write, left = folders.write_file, 0

    def full(file, content):
        nonlocal left
        left -= 1
        if left < 0:
            write(file, content[: len(content) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file))
        return write(file, content)

    for module in (store, folders):
        monkeypatch.setattr(module, "write_file", full)
    for succeeding in range(1000):
        left = succeeding
        try:
            write_store(path, small(2), {})
        except OSError as error:
            assert error.errno == errno.ENOSPC
            assert os.listdir(tmp_path) == ["s.zarr"]
            assert files(path) == before
        else:
            break
    assert succeeding == len(before)  # every file was once the one that did not fit
    assert verify(path) == []
    assert (opened(path, "one")["x"] == 2).all()
    assert os.listdir(tmp_path) == ["s.zarr"]


@pytest.mark.parametrize("where", ["read", "manifest", "rename"])
def test_an_interrupt_leaves_the_old_store(tmp_path, monkeypatch, where):
    path = tmp_path / "s.zarr"
    write_store(path, small(1), {})
    before = files(path)

    def interrupt(*_):
        raise KeyboardInterrupt

    groups = small(2)
    if where == "read":
        groups["z"] = Group({"x": array(COUNTS, read=interrupt)})
    if where == "manifest":
        monkeypatch.setattr(store, "seal", interrupt)
    if where == "rename":  # of the second of two: the first put the old store aside
        monkeypatch.setattr(folders, "_exchange", lambda one, other: False)
        rename = Path.rename
        monkeypatch.setattr(
            Path,
            "rename",
            lambda file, to: interrupt() if file.suffix == ".partial" else rename(file, to),
        )
    with pytest.raises(KeyboardInterrupt):
        write_store(path, groups, {})
    assert os.listdir(tmp_path) == ["s.zarr"]
    assert files(path) == before


WRITER = """
import os, sys
from pathlib import Path
from small_stores import small

from sweeps.engine.folders import locked
from sweeps.engine.store import write_store

path = Path(sys.argv[1])
for _ in sys.stdin:  # for each line a writer, until it is killed
    child = os.fork()
    if child == 0:
        with locked(path):
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
    seen, kills = set(), 0
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": search},
    ) as server:
        while kills < 10 or (len(seen) < 2 and kills < 300):
            kills += 1
            print(file=server.stdin, flush=True)
            child = int(server.stdout.readline())
            time.sleep(delays.uniform(0.005, 0.08))
            os.kill(child, signal.SIGKILL)
            assert server.stdout.readline() == "dead\n"
            value = read_attributes(path)["value"]
            assert verify(path) == []
            assert all((opened(path, name)["x"] == value).all() for name in small(0))
            seen.add(value)
    assert seen == {1, 2}
    with locked(path):  # a killed holder does not block, and its remains go
        assert sorted(os.listdir(tmp_path)) == [".s.zarr.lock", "s.zarr"]
    assert os.listdir(tmp_path) == ["s.zarr"]


def test_a_reader_opens_a_whole_store_at_any_moment(tmp_path):
    path = tmp_path / "s.zarr"
    write_store(path, small(1), {})
    done = threading.Event()

    def swap():
        for k in range(30):
            write_store(path, small(k), {})
            time.sleep(0.002)
        done.set()

    writer = threading.Thread(target=swap)
    writer.start()
    while not done.is_set():
        assert xr.open_zarr(path, chunks=None, group="two/three")["x"].shape == (4, 6)
    writer.join()
