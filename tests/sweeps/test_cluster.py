"""Workers: what they start with, whom an interrupt reaches, and that none is lost."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import distributed
import pytest

from sweeps.cluster import KEPT, MAPPED, executor
from sweeps.schema import ClusterConfig


@pytest.fixture(autouse=True)
def at_a_terminal():
    """Interrupts are heard, as by a command that is typed: what runs in the background ignores
    them, and so would all that it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt_oneself():
    """Ctrl-C as a worker would get it; the time for it to act."""
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.1)
    return os.getpid()


def signals_blocked():
    return os.getpid(), frozenset(signal.pthread_sigmask(signal.SIG_BLOCK, []))


def results(workers, function, count):
    outcomes = list(workers.run(function, [()] * count))
    assert [error for *_, error in outcomes] == [None] * count
    return {result for _, result, _ in outcomes}


def test_a_worker_does_not_hear_an_interrupt():
    handler, blocked = signal.getsignal(signal.SIGINT), signal.pthread_sigmask(signal.SIG_BLOCK, [])
    with executor(ClusterConfig(kind="local", workers=1), tasks=2) as workers:
        (first,) = results(workers, interrupt_oneself, 2)
        assert first != os.getpid()
        # Nor does the one that takes its place when it dies.
        os.kill(first, signal.SIGKILL)
        ((second, blocked_there),) = results(workers, signals_blocked, 1)
        assert second != first
        assert signal.SIGINT in blocked_there
    assert signal.getsignal(signal.SIGINT) is handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == blocked


def started_with():
    """What the process itself was started with, whatever was set in it since."""
    lines = Path("/proc/self/environ").read_bytes().split(b"\0")
    return frozenset(line.decode() for line in lines)


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="the system does not tell")
def test_a_worker_starts_with_one_thread_and_an_allocator_that_keeps():
    before = dict(os.environ)
    with executor(ClusterConfig(kind="local", workers=1), tasks=1) as workers:
        (there,) = results(workers, started_with, 1)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        assert f"{name}=1" in there
    assert {f"MALLOC_TRIM_THRESHOLD_={KEPT}", f"MALLOC_MMAP_THRESHOLD_={MAPPED}"} <= there
    assert dict(os.environ) == before


@pytest.fixture(params=["alone", "beside a thread that takes signals"])
def thread(request):
    """Another thread of this process, as a progress bar has, or none."""
    done = threading.Event()
    if request.param != "alone":
        threading.Thread(target=done.wait, daemon=True).start()
    yield
    done.set()


@pytest.mark.usefixtures("thread")
@pytest.mark.parametrize("times", [0, 1, 2])
def test_an_interrupt_while_workers_start_is_delivered_afterwards(times, monkeypatch):
    clusters = []
    start = distributed.LocalCluster

    def interrupted(**options):
        for _ in range(times):
            interrupt_oneself()
        clusters.append(start(**options))
        return clusters[0]

    monkeypatch.setattr(distributed, "LocalCluster", interrupted)
    entered = False
    try:
        with executor(ClusterConfig(kind="local", workers=2), tasks=2):
            entered = True
    except KeyboardInterrupt:
        assert times
    else:
        assert not times
    # It was started all the same, nothing ran on it, and it was ended in order.
    assert entered == (times == 0)
    assert clusters[0].status == distributed.Status.closed


def started(process):
    """Processes that a process and its threads have started to run Python's tasks in."""
    children = Path(f"/proc/{process.pid}/task").glob("*/children")
    listed = " ".join(path.read_text() for path in children).split()
    commands = (Path(f"/proc/{child}/cmdline").read_bytes() for child in listed)
    return [command for command in commands if b"spawn_main" in command]


def test_the_command_ends_when_interrupted_while_its_workers_start(tmp_path, cache):
    """In a session of its own, all of whose processes hear the interrupt, as of a terminal's."""
    arguments = (
        *("grid.ship=duncan", "grid.aspect=[0,45,90]", "grid.vigilance=0.9"),
        *("cluster.workers=2", "store=s.zarr", f"cache={cache}"),
    )
    command = subprocess.Popen(
        [sys.executable, "-m", "sweeps.app", *arguments],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        while command.poll() is None and not started(command):
            time.sleep(0.01)
        os.killpg(command.pid, signal.SIGINT)
        _, told = command.communicate(timeout=120)
    finally:
        command.kill()
    assert command.returncode == 130
    last = told.strip().splitlines()[-1]
    assert last == "ncti-sweep: interrupted; the same command goes on from here"
    assert "Traceback" not in told
    # No work was begun.
    assert not (tmp_path / "s.zarr").exists()
