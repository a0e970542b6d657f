"""Sweeps survive killed and stopped processes, full disks and jumping clocks.

Either the sweep itself or a repeat of its command makes the store of an undisturbed run.
"""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from cut_off import MARKS, MINUTE
from executors import IMPORTS, cluster_at, eventually, meanwhile, running_server
from running import python
from small_stores import files, opened
from toys import SPRINGS, Few, go, run_few

from sweeps.engine import sweeping as run
from sweeps.engine.command.line import Command
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.stage import Group, Output, stage
from sweeps.engine.run import dask_cluster, progress
from sweeps.engine.store import provenance

pytestmark = pytest.mark.usefixtures("at_a_terminal")
SPRINGS_COMMAND = (
    "import sys; from toys import SPRINGS; from sweeps.engine.command.line import Command; "
    "sys.exit(Command(SPRINGS).main())"
)
SEARCH = f"{IMPORTS}:{Path(__file__).parents[1]}"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the files of the store of an undisturbed run."""
    path = tmp_path_factory.mktemp("whole") / "s.zarr"
    go(path)
    return files(path)


@pytest.fixture(scope="module", autouse=True)
def cut_off(tmp_path_factory):
    """Run a sweep with a worker stopped for a minute, in parallel with the other tests."""
    folder = tmp_path_factory.mktemp("cut_off")
    script, environment = (
        Path(__file__).with_name("cut_off.py"),
        os.environ | {"PYTHONPATH": SEARCH},
    )
    command = [sys.executable, script, folder]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        yield folder, process
        process.terminate()


# -- workers


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def mortal(size):
    """Kill the worker when a size that is not spared is computed for the first time."""
    folder = Path(os.environ[MARKS])
    if not (folder / f"spared {size}").exists():
        (folder / f"spared {size}").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return size**0.5


@pytest.mark.parametrize("deaths", [1, 3, 4], ids=["once", "three times", "all"])
def test_workers_that_are_killed_are_replaced(deaths, tmp_path, monkeypatch):
    monkeypatch.setenv(MARKS, str(tmp_path))
    monkeypatch.setattr(dask_cluster, "CHECK_INTERVAL", 0.1)
    sizes = range(1, 5)
    for size in sizes[deaths:]:
        (tmp_path / f"spared {size}").touch()
    finished = run_few([mortal], tmp_path / "s.zarr", sizes=sizes, kind="local", workers=2)
    assert finished.failures == [] and len(list(tmp_path.glob("spared *"))) == 4
    assert opened(tmp_path / "s.zarr", "all").x.values.tolist() == [n**0.5 for n in sizes]


def test_a_worker_that_is_cut_off_is_replaced_and_does_no_harm_when_it_is_back(
    tmp_path, monkeypatch
):
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


def test_a_scheduler_that_is_killed_is_a_sentence_and_the_next_run_resumes(
    tmp_path, monkeypatch, capsys
):
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


@pytest.mark.parametrize(
    ("full", "kind"), [("store", "inline"), ("cache", "inline"), ("cache", "local")]
)
def test_a_full_disk_is_a_sentence_and_no_loss(full, kind, whole, tmp_path, monkeypatch, capsys):
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
        assert files(store) == whole


def test_a_full_temporary_folder_is_not_used(whole, tmp_path):
    arguments = ["-c", SPRINGS_COMMAND, "store=s.zarr", "cache=cache", "cluster.workers=2"]
    with disk(tmp_path / "disk", "8k"):
        (tmp_path / "disk" / "full").write_bytes(bytes(8192))
        done = python(*arguments, cwd=tmp_path, PYTHONPATH=IMPORTS, TMPDIR=str(tmp_path / "disk"))
    assert "No space" not in done.stderr
    assert files(tmp_path / "s.zarr") == whole


# -- memory


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def greedy(size):
    """Return a sum that needs 64 GiB of memory for size 2."""
    return np.ones(2**33 if size == 2 else 1).sum()


FEW_COMMAND = """
import resource, sys
import test_survival
from toys import of
from sweeps.engine.command.line import Command
if __name__ == "__main__":
    name, limit, *given = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_AS, (int(limit), -1))
    sys.exit(Command(of(getattr(test_survival, name))).main(given))
"""


def test_a_limit_of_memory_is_a_sentence_that_names_the_stage(tmp_path):
    (tmp_path / "few.py").write_text(FEW_COMMAND)
    arguments = [
        "few.py",
        "greedy",
        2**35,
        "few.size=[1,2,3]",
        "store=s.zarr",
        "cache=cache",
        "cluster=local",
    ]
    done = python(*arguments, cwd=tmp_path, check=False, PYTHONPATH=SEARCH)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    failed = "few: 1 cell failed: greedy size=2 (MemoryError: Unable to allocate 64.0 GiB for"
    assert done.stderr.splitlines()[-1].startswith(failed)
    assert opened(tmp_path / "s.zarr", "all").x.isnull().values.tolist() == [False, True, False]


def test_a_command_without_memory_is_a_sentence(monkeypatch, tmp_path, capsys):
    def full(*arguments, **keywords):
        raise MemoryError("Unable to allocate 64.0 GiB")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run, "write_store", full)
    arguments = ["cluster=inline", "store=s.zarr", "cache=cache"]
    assert Command(SPRINGS).main(arguments) == 1
    assert capsys.readouterr().err.splitlines()[-1] == (
        "springs: out of memory (Unable to allocate 64.0 GiB); the same command resumes the sweep"
    )


# -- versions


def test_a_store_of_another_version_is_a_sentence(monkeypatch, tmp_path):
    go(tmp_path / "s.zarr")
    before = files(tmp_path / "s.zarr")
    now = provenance.versions
    monkeypatch.setattr(provenance, "versions", lambda plan: now(plan) | {"dask": "9.0"})
    with pytest.raises(
        ConfigurationError, match="which was made by a different version of dask; give"
    ):
        go(tmp_path / "s.zarr", spring__mass=[1, 2, 3])
    assert files(tmp_path / "s.zarr") == before


# -- clocks

LIBRARY = next(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"), None)
TRIES = 5  # on a busy machine, libfaketime refuses to sleep until a time that has just passed


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def jumping(size):
    """Return a number; make the clock jump when size 3 is computed for the first time."""
    folder = Path(os.environ[MARKS])
    if size == 3 and not (folder / "jumped").exists():
        before = time.time()
        (folder / "clock").write_text(os.environ["JUMP"])
        while abs(time.time() - before) < 3600:
            pass
        (folder / "jumped").touch()
    return size**0.5


@pytest.mark.skipif(LIBRARY is None, reason="no libfaketime here (apt install faketime)")
@pytest.mark.parametrize(("kind", "days"), [("inline", -3), ("local", 3)])
def test_a_clock_that_jumps_changes_nothing(kind, days, tmp_path):
    """The clock jumps while a cell is computed, after other cells were.

    With workers it jumps only forwards: dask delays a message to the next whole milliseconds of
    this clock (`distributed.batched`), and so for days if the clock is set back meanwhile.
    """
    (tmp_path / "clock").write_text("+0")
    variables = {"LD_PRELOAD": str(LIBRARY), "FAKETIME_TIMESTAMP_FILE": str(tmp_path / "clock")}
    variables |= {"FAKETIME_CACHE_DURATION": "1", "FAKETIME_DONT_FAKE_MONOTONIC": "1"}
    variables |= {MARKS: str(tmp_path), "JUMP": f"{days:+}d"}
    (tmp_path / "few.py").write_text(FEW_COMMAND)
    arguments = ["few.py", "jumping", 2**40, "few.size=[1,2,3,4,5,6]", f"cluster={kind}"]
    arguments += ["store=s.zarr", "cache=cache", "cluster.workers=2"][: 3 if kind == "local" else 2]
    for _ in range(TRIES):
        done = python(*arguments, cwd=tmp_path, check=False, PYTHONPATH=SEARCH, **variables)
        if done.returncode == 0 or os.strerror(errno.EINVAL) not in done.stderr:
            break
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "jumped").exists()
    sizes = range(1, 7)
    resumed = run_few([jumping], tmp_path / "t.zarr", tmp_path / "cache", sizes)
    assert resumed.progress["jumping"].reused == 6
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr")
    assert opened(tmp_path / "s.zarr", "all").x.values.tolist() == [n**0.5 for n in sizes]


# -- the sweep of the fixture `cut_off`, which began with the first test of this file


def test_a_worker_that_is_cut_off_for_a_minute_goes_on(cut_off):
    """With default timeouts, the worker completes its cell, and no cell is computed twice."""
    folder, process = cut_off
    out, _ = process.communicate(timeout=300)
    result = json.loads(out)
    assert result["failures"] == [] and result["took"] > MINUTE
    marks = sorted([int(number) for number in mark.name.split()] for mark in folder.glob("* * *"))
    assert [cell for cell, *_ in marks] == [*range(1, 7)]
    assert {worker for _, worker, _ in marks} > {result["victim"]}
    assert opened(folder / "s.zarr", "all").x.values.tolist() == [n**0.5 for n in range(1, 7)]
