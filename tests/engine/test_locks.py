"""Locks allow one writer of a store at a time, on disks and in buckets, even if it is killed."""

import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from running import ROOT
from small_stores import below

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.objects import Objects
from sweeps.engine.store import locks
from sweeps.engine.store.locks import seconds_since_renewal, store_lock

HOLDER = """
import sys, time
from pathlib import Path
from sweeps.engine.store import locks

locks.RENEW_INTERVAL = 0.1
place = sys.argv[1] if ":" in sys.argv[1] else Path(sys.argv[1])
with locks.store_lock(place):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    """Set leases short enough to wait for, long enough for an owner to renew on a busy machine."""
    monkeypatch.setattr(locks, "LEASE", 2.0)
    monkeypatch.setattr(locks, "POLL_INTERVAL", 0.02)


@pytest.fixture
def holder(place):
    """Yield a process that holds the lock of a store, and the path of the store."""
    path = below(place, "s.zarr")
    command = [sys.executable, "-c", HOLDER, str(path)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout.readline() == "held\n"
        yield process, path
        process.kill()


def test_a_living_owner_keeps_the_lock_and_a_dead_one_loses_it(holder):
    process, path = holder
    host = os.uname().nodename
    sentence = rf"being written by process {process.pid} on {host} since .*; wait until it ends"
    with pytest.raises(ConfigurationError, match=sentence), store_lock(path):
        pytest.fail("two writers")
    assert seconds_since_renewal(path) < locks.LEASE
    if isinstance(path, Path):
        process.send_signal(signal.SIGSTOP)  # the owner is stopped but alive
        with pytest.raises(ConfigurationError, match=sentence), store_lock(path):
            pytest.fail("two writers")
    process.send_signal(signal.SIGKILL)
    process.wait()
    for _ in range(2):
        with store_lock(path) as check:
            check()
    assert seconds_since_renewal(path) is None and not lock_names(path)


def test_inspecting_a_lock_does_not_disturb_writers(tmp_path):
    path, lock = tmp_path / "s.zarr", tmp_path / ".s.zarr.lock"
    lock.write_text("of a killed process")
    assert seconds_since_renewal(path) is None and lock.exists()
    with lock.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_SH)  # another process has just begun to read the lock
        threading.Timer(locks.LOCK_SECONDS / 4, fcntl.flock, (file, fcntl.LOCK_UN)).start()
        with store_lock(path):
            assert seconds_since_renewal(path) == 0.0


def test_symlinked_lock_file_is_refused(tmp_path):
    victim, lock = tmp_path / "victim", tmp_path / ".s.zarr.lock"
    victim.write_text("kept")
    lock.symlink_to(victim)
    with pytest.raises(ConfigurationError, match="nothing can be locked"):
        store_lock(tmp_path / "s.zarr").__enter__()
    assert victim.read_text() == "kept"


def lock_names(path):
    """Return the names of the locks beside a store."""
    above = path.parent if isinstance(path, Path) else path.rpartition("/")[0]
    return [name for name in Objects(above).sizes() if name.endswith(".lock")]


def test_there_is_one_writer_at_a_time(tmp_path):
    path = tmp_path / "s.zarr"
    holders, most_holders, refusals, writes = 0, 0, 0, 0

    def work():
        nonlocal holders, most_holders, refusals, writes
        for _ in range(50):
            try:
                with store_lock(path):
                    holders += 1
                    most_holders = max(most_holders, holders)
                    time.sleep(0.001)
                    holders -= 1
                    writes += 1
            except ConfigurationError:
                refusals += 1

    with ThreadPoolExecutor(4) as pool:
        for _ in range(4):
            pool.submit(work)
    assert most_holders == 1 and writes + refusals == 200 and writes
    assert not lock_names(path)


def test_only_one_contender_takes_over_a_stale_bucket_lock(bucket, monkeypatch):
    monkeypatch.setattr(locks, "RENEW_INTERVAL", 0.1)
    path, start, tried = below(bucket, "s.zarr"), threading.Barrier(6), threading.Barrier(6)
    Objects(bucket).put(".s.zarr.lock", b"process 1 on host since 2000-01-01T00:00:00")

    def take():
        start.wait()
        try:
            with store_lock(path):
                tried.wait()
                return True
        except ConfigurationError:
            tried.wait()
            return False

    with ThreadPoolExecutor(6) as pool:
        taken = [pool.submit(take) for _ in range(6)]
    assert sum(future.result() for future in taken) == 1
    assert not lock_names(path)


def test_slow_bucket_responses_do_not_expire_the_lease(bucket, monkeypatch):
    def slow(objects, name, get=Objects.get_versioned):
        time.sleep(1.1 * locks.LEASE)
        return get(objects, name)

    path = below(bucket, "s.zarr")
    monkeypatch.setattr(locks, "RENEW_INTERVAL", 0.1)
    with store_lock(path) as check:
        monkeypatch.setattr(Objects, "get_versioned", slow)
        with pytest.raises(ConfigurationError, match="being written"), store_lock(path):
            pytest.fail("two writers")
        check()


def test_owner_that_stops_renewing_loses_the_bucket_lock(bucket):
    path = below(bucket, "s.zarr")
    with store_lock(path) as check:
        check()
        with store_lock(path) as recheck:
            with pytest.raises(OSError, match="its lock was taken by another process"):
                check()
            recheck()
    assert not lock_names(path)


def test_retried_renewal_keeps_the_lock(bucket, monkeypatch):
    """A renewal that is repeated after the server has written it finds a newer version: its own."""
    path, put = below(bucket, "s.zarr"), Objects.put_if

    def twice(self, name, content, version):
        done = put(self, name, content, version)
        return put(self, name, content, version) if version else done

    with store_lock(path) as check:
        monkeypatch.setattr(Objects, "put_if", twice)
        check()
        check()
    assert not lock_names(path)
