"""Sweeps survive killed and stopped processes, full disks and jumping clocks.

Either the sweep itself or a repeat of its command makes the store of an undisturbed run.
"""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path

import numpy as np
import psutil
import pytest
from executors import IMPORTS, cluster_at, eventually, meanwhile, running_server
from small_stores import contents, files, opened
from toys import SPRINGS, Few, go, run_few

from sweeps.engine import sweeping as run
from sweeps.engine.cache import packs
from sweeps.engine.command.line import Command
from sweeps.engine.declare.stage import Group, Output, stage
from sweeps.engine.run import dask_cluster, progress

pytestmark = pytest.mark.usefixtures("at_a_terminal")
MARKS = "SWEEP_TEST_MARKS"  # environment variable that holds the path of the folder of marks
DAY = 86_400.0  # s


# -- workers


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def mortal(size):
    """Kill the worker when a size is computed for the first time."""
    mark = Path(os.environ[MARKS]) / f"spared {size}"
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return size


def test_workers_that_are_killed_are_replaced(tmp_path, monkeypatch):
    monkeypatch.setenv(MARKS, str(tmp_path))
    monkeypatch.setattr(dask_cluster, "CHECK_INTERVAL", 0.1)
    finished = run_few([mortal], tmp_path / "s.zarr", kind="local", workers=2)
    assert finished.failures == [] and len(list(tmp_path.glob("spared *"))) == 3
    assert opened(tmp_path / "s.zarr", "all").x.values.tolist() == [1, 2, 3]


def test_suspended_worker_is_replaced_and_harmless_on_return(tmp_path, monkeypatch):
    """The worker is stopped for longer than the scheduler waits for it (5 minutes by default)."""
    monkeypatch.setitem(dask_cluster.DASK_SETTINGS, "distributed.scheduler.worker-ttl", "1s")
    monkeypatch.setattr(dask_cluster, "CHECK_INTERVAL", 0.1)

    def cut_off():
        eventually(lambda: list((tmp_path / "s.cache").rglob("*.pack")))
        victim, *_ = running_server().children()
        victim.suspend()
        time.sleep(3)
        victim.resume()

    with meanwhile(cut_off):
        go(tmp_path / "s.zarr", kind="local", workers=2, measured__pause=1)
    go(tmp_path / "t.zarr", tmp_path / "s.cache", measured__pause=1)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr")


def test_killed_scheduler_is_reported_and_the_next_run_resumes(tmp_path, monkeypatch, capsys):
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    monkeypatch.setattr(progress, "LINE_INTERVAL", 3600)
    with cluster_at(tmp_path / "scheduler") as (choice, (scheduler, *_)):

        def kill():
            eventually(lambda: list(cache.rglob("*.pack")))
            monkeypatch.setattr(
                dask_cluster, "ANSWER_SECONDS", 1
            )  # 10 s until the scheduler is killed
            scheduler.kill()

        names = ("address", "ca_file", "cert", "private_key")
        arguments = [f"cluster.{name}={getattr(choice, name)}" for name in names]
        arguments += ["cluster=address", f"store={store}", f"cache={cache}", "measured.pause=0.5"]
        with meanwhile(kill):
            assert Command(SPRINGS).main(arguments) == 1
    lines = capsys.readouterr().err.splitlines()
    gone = "springs: the scheduler of the cluster is gone; the same command resumes the sweep"
    assert lines[-1] == gone and len(lines) == 3
    assert not store.exists()
    resumed = go(store, cache, measured__pause=0.5)
    assert sum(stage.reused for stage in resumed.progress.values()) > 0
    go(tmp_path / "t.zarr", cache, measured__pause=0.5)
    assert files(store) == files(tmp_path / "t.zarr")


# -- drivers


SPRINGS_IN_A_TERMINAL = """
import signal, sys
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from sweeps.engine.command.line import Command
from toys import SPRINGS
sys.exit(Command(SPRINGS).main("cluster.workers=2 cache=c store=s.zarr measured.pause=0.3".split()))
"""


def test_closing_the_terminal_stops_the_sweep_cleanly(tmp_path):
    """SIGHUP goes to the whole process group: the command, its workers and the fork server."""
    options = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": IMPORTS}}
    options |= {"stderr": subprocess.PIPE, "text": True, "start_new_session": True}
    command = subprocess.Popen([sys.executable, "-c", SPRINGS_IN_A_TERMINAL], **options)
    eventually(lambda: list(tmp_path.glob("c/**/*.pack")))
    os.killpg(command.pid, signal.SIGHUP)
    _, errors = command.communicate(timeout=60)
    assert command.returncode == 128 + signal.SIGHUP
    assert {line.partition(" ")[0] for line in errors.splitlines()} == {"springs:"}, errors
    assert errors.endswith("springs: stopped by SIGHUP; the same command resumes the sweep\n")


DRIVER = """
from toys import go

if __name__ == "__main__":
    go("s.zarr", "cache", "local", 2, measured__pause=0.3)
"""


def test_killed_driver_ends_its_workers_and_is_resumable(tmp_path):
    (tmp_path / "driver.py").write_text(DRIVER)
    options = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": IMPORTS}}
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    with subprocess.Popen([sys.executable, "driver.py"], **options) as driver:
        eventually(lambda: list(cache.rglob("*.pack")))
        children = psutil.Process(driver.pid).children(recursive=True)
        driver.kill()

    def ended(process):
        try:
            return process.status() == psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return True

    assert len(children) > 2
    eventually(lambda: all(map(ended, children)))
    packs = len(list(cache.rglob("*.pack")))
    assert not store.exists()
    finished = go(store, cache, measured__pause=0.3)
    # Each pack, of any stage, has at least one cell.
    assert sum(progress.reused for progress in finished.progress.values()) >= packs
    go(tmp_path / "t.zarr", cache, measured__pause=0.3)
    assert files(store) == files(tmp_path / "t.zarr")
    assert not (tmp_path / ".s.zarr.lock").exists()


# -- disks


@contextmanager
def disk(folder, size):
    """Mount a disk of `size`; yield a function that enlarges it to 50 MiB."""

    def mount(*options):
        command = ["mount", "-t", "tmpfs", "-o", ",".join(options), "none", str(folder)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"no disk can be mounted: {done.stderr.strip()}")

    folder.mkdir()
    mount(f"size={size}")
    try:
        yield lambda: mount("remount", "size=50m")
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.mark.parametrize(("full", "kind"), [("store", "inline"), ("cache", "local")])
def test_full_disk_is_reported_and_loses_no_results(full, kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = [f"cluster={kind}", "store=s.zarr", "cache=cache", f"{full}=disk/here"]
    with disk(tmp_path / "disk", "24k") as enlarge:
        assert Command(SPRINGS).main(arguments) == 1
        lines = capsys.readouterr().err.splitlines()
        assert lines[-1].startswith("springs: cannot write '") and "disk/" in lines[-1]
        assert lines[-1].endswith("': No space left on device")
        assert "Traceback" not in "".join(lines)
        store = Path("disk/here" if full == "store" else "s.zarr")
        assert not store.exists()
        enlarge()
        assert Command(SPRINGS).main(arguments) == 0
        counted = capsys.readouterr().err.splitlines()[0]
        assert counted.endswith("0 cells to compute, 74 reused from the cache") or full == "cache"
        assert " 0 reused" not in counted
        go(tmp_path / "t.zarr")
        assert files(store) == files(tmp_path / "t.zarr")


# -- memory


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def greedy(size):
    """Return a sum that needs more memory than any machine has for size 2."""
    return np.ones(2**50 if size == 2 else 1).sum()


def test_memory_error_fails_only_its_cell(tmp_path):
    [(name, why)] = run_few([greedy], tmp_path / "s.zarr").failures
    assert name == "greedy size=2" and why.startswith("MemoryError: Unable to allocate 8.00 PiB")
    assert opened(tmp_path / "s.zarr", "all").x.isnull().values.tolist() == [False, True, False]


def test_driver_memory_error_is_reported_in_one_line(monkeypatch, tmp_path, capsys):
    def full(*arguments, **keywords):
        raise MemoryError("Unable to allocate 64.0 GiB")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run, "write_store", full)
    arguments = ["cluster=inline", "store=s.zarr", "cache=cache"]
    assert Command(SPRINGS).main(arguments) == 1
    assert capsys.readouterr().err.splitlines()[-1] == (
        "springs: out of memory (Unable to allocate 64.0 GiB); the same command resumes the sweep"
    )


# -- clocks


def test_clock_jumps_do_not_affect_the_store(tmp_path, monkeypatch):
    """Whoever asks this process for the time finds it three days later, or as much earlier."""
    now, later = time.time(), cycle([False, True])
    monkeypatch.setattr(time, "time", lambda: now + 3 * DAY * next(later))
    monkeypatch.setattr(packs, "time_ns", lambda: int(time.time() * 1e9))
    go(tmp_path / "s.zarr", tmp_path / "cache", spring__mass=1)
    go(tmp_path / "s.zarr", tmp_path / "cache")
    resumed = go(tmp_path / "t.zarr", tmp_path / "cache")
    assert sum(progress.done for progress in resumed.progress.values()) == 0
    assert contents(tmp_path / "s.zarr") == contents(tmp_path / "t.zarr")
