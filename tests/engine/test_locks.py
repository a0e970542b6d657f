"""One writer at a time, on disks and in buckets, whatever becomes of it."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from small_stores import below

from sweeps.engine import locks
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.locks import locked
from sweeps.engine.places import Objects

HOLDER = """
import sys, time
from pathlib import Path
from sweeps.engine.locks import locked

place = sys.argv[1] if ":" in sys.argv[1] else Path(sys.argv[1])
with locked(place):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def holder(place):
    """A process that holds the lock of a store, and the store."""
    path = below(place, "s.zarr")
    search = os.pathsep.join(sys.path)
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": search},
    ) as process:
        assert process.stdout.readline() == "held\n"
        yield process, path
        process.kill()


def test_a_living_owner_keeps_the_lock_and_a_dead_one_loses_it_at_once(holder):
    process, path = holder
    host = os.uname().nodename
    sentence = rf"being written by process {process.pid} on {host} since .*; wait until it ends"
    with pytest.raises(ConfigurationError, match=sentence), locked(path):
        pytest.fail("two writers")
    process.send_signal(signal.SIGSTOP)  # it is slow, and alive
    with pytest.raises(ConfigurationError, match=sentence), locked(path):
        pytest.fail("two writers")
    process.send_signal(signal.SIGKILL)
    process.wait()
    for _ in range(2):
        with locked(path) as check:
            check()
    assert not objects_of(path)[1]


def objects_of(path):
    """The objects beside a store, and their names."""
    above = path.parent if isinstance(path, Path) else path.rpartition("/")[0]
    there = Objects(above)
    return there, sorted(name for name in there.sizes() if ".lock/" in name)


def test_there_is_one_writer_at_a_time(place):
    path = below(place, "s.zarr")
    inside, most, refused, written = 0, 0, 0, 0

    def work():
        nonlocal inside, most, refused, written
        for _ in range(50 if isinstance(place, Path) else 10):
            try:
                with locked(path):
                    inside += 1
                    most = max(most, inside)
                    time.sleep(0.001)
                    inside -= 1
                    written += 1
            except ConfigurationError:
                refused += 1

    writers = [threading.Thread(target=work) for _ in range(4)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    rounds = 200 if isinstance(place, Path) else 40
    assert most == 1 and written + refused == rounds and written and refused
    assert not objects_of(path)[1]
    if isinstance(place, Path):
        assert not list(place.iterdir())


def test_of_many_that_find_a_dead_owner_one_takes_over(place, monkeypatch):
    path, took, start = below(place, "s.zarr"), [], threading.Barrier(6)
    there, _ = objects_of(path)
    objects = Objects(there.place, make=True)
    dead = {"id": "0", "machine": locks._machine(), "pid": os.getpid(), "started": "before"}
    objects.put(".s.zarr.lock/7", json.dumps(dead).encode())

    def take():
        start.wait()
        try:
            with locked(path):
                took.append(objects_of(path)[1])
                done.wait()
        except ConfigurationError:
            took.append(None)

    done = threading.Event()
    threads = [threading.Thread(target=take) for _ in range(6)]
    for thread in threads:
        thread.start()
    while len(took) < 6:
        time.sleep(0.01)
    done.set()
    for thread in threads:
        thread.join()
    held = [names for names in took if names is not None]
    assert len(held) == 1 and ".s.zarr.lock/7" in held[0]
    assert not objects_of(path)[1]


@pytest.fixture
def elsewhere(monkeypatch):
    """Whoever asks next is on another machine, and leases are short."""
    monkeypatch.setattr(locks, "LEASE", 0.5)
    monkeypatch.setattr(locks, "LOOK", 0.05)

    def move(renewed):
        monkeypatch.setattr(locks, "RENEWED", renewed)
        monkeypatch.setattr(locks, "_machine", lambda: f"other {renewed}")

    return move


@pytest.mark.usefixtures("elsewhere")
def test_an_owner_elsewhere_that_renews_its_lease_keeps_it(place, monkeypatch, elsewhere):
    path = below(place, "s.zarr")
    elsewhere(0.1)
    with locked(path) as check:
        elsewhere(9)
        with pytest.raises(ConfigurationError, match="being written"), locked(path):
            pytest.fail("two writers")
        check()


def test_an_owner_elsewhere_that_is_silent_loses_it_and_is_told(place, elsewhere):
    path = below(place, "s.zarr")
    elsewhere(99)
    with locked(path) as check:
        check()
        elsewhere(98)
        with locked(path) as other:
            with pytest.raises(OSError, match="its lock was taken by another process"):
                check()
            other()
        with pytest.raises(OSError, match="its lock was taken by another process"):
            check()
    assert not objects_of(path)[1]
