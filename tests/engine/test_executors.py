"""Executors of every kind: equal results, errors by number, one thread a process, the same code."""

import json
import os
import re
import subprocess
import sys
from contextlib import ExitStack, nullcontext
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from distributed.security import Security
from executors import (
    IMPORTS,
    blas_threads,
    draw,
    eventually,
    fails_with,
    gather,
    refuse_odd,
    result_of,
    silent,
    span,
    written,
)
from small_stores import files
from threadpoolctl import threadpool_limits
from toys import go

from sweeps.engine import shared
from sweeps.engine.cluster import ClusterChoice, executor
from sweeps.engine.code import package_digest
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.process import ONE_THREAD
from sweeps.engine.shared import Apart, Shared, marked

pytestmark = pytest.mark.usefixtures("at_a_terminal")
QUIET = ("--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")


@pytest.fixture
def inline():
    with threadpool_limits(2), executor(ClusterChoice(kind="inline"), say=silent) as run:
        yield run


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """Choice of a scheduler that runs on its own, with two workers of two threads each."""
    folder = tmp_path_factory.mktemp("scheduler")
    files = written(Security.temporary(), folder)
    tls = ("--tls-ca-file", files["ca_file"], "--tls-cert", files["cert"], "--tls-key")
    shared = ("--scheduler-file", folder / "scheduler.json", *QUIET, *tls, files["key"])
    commands = [("scheduler", *shared, "--protocol", "tls://", "--port", "0")] + [
        ("worker", *shared, "--nthreads", "2", "--no-nanny")
    ] * 2
    with ExitStack() as stack:
        for name, *arguments in commands:
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{name}", *map(str, arguments)],
                cwd=folder,
                env=os.environ | dict.fromkeys(ONE_THREAD, "2") | {"PYTHONPATH": IMPORTS},
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
        eventually((folder / "scheduler.json").exists)
        address = json.loads((folder / "scheduler.json").read_text())["address"]
        choice = ClusterChoice(kind="address", address=address, **files)
        with executor(choice, say=silent) as run:
            eventually(lambda: run.workers == 2)
        yield choice


@pytest.fixture(scope="module")
def remote(running):
    with executor(running, say=silent) as run:
        yield run


@pytest.fixture(params=["inline", "local", "remote"])
def any_executor(request):
    return request.getfixturevalue(request.param)


def test_results_are_those_of_plain_calls(any_executor):
    for seed in range(20):
        any_executor.submit(seed, draw, seed, 100)
    outcomes = gather(any_executor)
    assert sorted(outcomes) == list(range(20))
    for seed, (result, error) in outcomes.items():
        assert error is None
        np.testing.assert_array_equal(result, draw(seed, 100))
    assert any_executor.finished() == []


def test_errors_come_back_with_their_number(any_executor):
    for number in range(7):
        any_executor.submit(10 + number, refuse_odd, number)
    outcomes = gather(any_executor)
    for number in range(7):
        result, error = outcomes[10 + number]
        if number % 2:
            assert isinstance(error, ValueError) and str(error) == f"{number} is odd"
        else:
            assert error is None and result == number


def test_tasks_of_a_process_run_one_at_a_time_in_one_thread(any_executor):
    for number in range(8):
        any_executor.submit(number, span, 0.05)
    spans = sorted((result for result, _ in gather(any_executor).values()), key=lambda s: s[2])
    processes = {process for process, *_ in spans}
    assert len(processes) <= any_executor.workers
    for process in processes:
        here = [s for s in spans if s[0] == process]
        assert len({thread for _, thread, *_ in here}) == 1
        assert all(a[3] <= b[2] for a, b in pairwise(here))


def test_numerical_libraries_have_one_thread(any_executor):
    assert set(result_of(any_executor, blas_threads)) == {1}


def test_inline_opens_no_port_starts_no_process_and_limits_what_is_loaded_later():
    code = """
import psutil, sys
from sweeps.engine.cluster import ClusterChoice, executor

def look():
    import scipy.linalg
    from threadpoolctl import threadpool_info
    process = psutil.Process()
    return (
        {library["num_threads"] for library in threadpool_info()},
        process.net_connections("inet"),
        process.children(),
    )

with executor(ClusterChoice(kind="inline"), say=print) as run:
    run.submit(0, look)
    ((_, result, error),) = run.finished()
assert error is None, error
assert result == ({1}, [], []), result
assert "distributed" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


# -- a scheduler at an address


def test_an_address_has_as_many_workers_as_processes(remote):
    assert remote.workers == 2


def test_a_scheduler_makes_the_same_store_as_this_process(running, tmp_path):
    asked = {"spring__limit": 1.5}  # the stiffest spring fails
    stores = {kind: tmp_path / f"{kind}.zarr" for kind in ("inline", "remote")}
    inline = go(stores["inline"], **asked)
    remote = go(stores["remote"], kind=running, **asked)
    assert inline.failures and sorted(inline.failures) == sorted(remote.failures)
    assert files(stores["inline"]) == files(stores["remote"])
    done = {name: one.done for name, one in remote.progress.items()}
    assert done["noisy"] and done["answers"]  # which draws, and which gathers
    assert done == {name: one.done for name, one in inline.progress.items()}


@pytest.mark.usefixtures("impatient")
def test_a_scheduler_answers_neither_other_certificates_nor_none(running, tmp_path):
    files = written(Security.temporary(), tmp_path)
    others = ClusterChoice(kind="address", address=running.address, **files)
    plain = ClusterChoice(kind="address", address=running.address.replace("tls:", "tcp:"))
    for choice in (others, plain):
        fails_with(
            choice, f"cluster.address is {choice.address}, but no scheduler answers there .*"
        )


def test_a_worker_with_other_code_is_refused(running, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "of_this_process.py").write_text("")
    with (
        pytest.raises(ConfigurationError) as refused,
        executor(running, packages=("toys", "of_this_process"), say=silent),
    ):
        pass
    assert re.fullmatch(
        rf"cluster.address is {running.address}, but its worker tls://127.0.0.1:\d+ has other code "
        "of of_this_process; it must have that of this process",
        str(refused.value),
    )


def test_a_worker_that_comes_later_with_other_code_gets_no_task(running, tmp_path):
    with executor(running, say=silent) as run:
        run._shared = run._shared._replace(code={**run._shared.code, "toys": "another"})
        run.submit(0, Path.touch, tmp_path / "ran")
        with pytest.raises(ConfigurationError, match="a worker of the cluster has other code of"):
            run.finished()
    assert not (tmp_path / "ran").exists()


def elsewhere(folder):
    """A mark in a folder that no worker sees."""
    return ((str(folder / "cells" / "mark.partial"), "token"),)


def test_workers_that_do_not_see_a_folder_are_refused(running, tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setattr(shared, "marked", lambda folders: nullcontext(elsewhere(*folders)))
    with (
        pytest.raises(ConfigurationError) as refused,
        executor(running, folders=[folder], say=silent),
    ):
        pass
    assert re.fullmatch(
        rf"cluster.address is {running.address}, but its worker tls://127.0.0.1:\d+ does not see "
        rf"the folder '{folder}' of this command; it must be on a file system that all of them "
        "share",
        str(refused.value),
    )


def test_a_worker_that_comes_later_elsewhere_gets_no_task(running, tmp_path):
    with executor(running, say=silent) as run:
        run._shared = run._shared._replace(marks=elsewhere(tmp_path))
        run.submit(0, Path.touch, tmp_path / "ran")
        with pytest.raises(ConfigurationError, match="a worker of the cluster does not see the"):
            run.finished()
    assert not (tmp_path / "ran").exists()


def test_folders_are_marked_while_workers_are_asked(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    with marked([tmp_path / "cache", tmp_path / "file"]) as marks:
        ((path, _),) = marks  # nothing can be in a file, so nobody needs to see it
        assert Path(path).is_relative_to(tmp_path / "cache")
        Shared({}, marks).check()
        with pytest.raises(Apart, match="does not see"):
            Shared({}, ((path, "another"),)).check()
    assert not list((tmp_path / "cache").rglob("*.partial"))
    monkeypatch.setattr(os, "geteuid", lambda: os.stat(tmp_path).st_uid + 1)
    with (
        pytest.raises(ConfigurationError, match=r"^this process sees files of another user in"),
        marked([tmp_path / "cache"]),
    ):
        pass
    assert not list((tmp_path / "cache").rglob("*.partial"))


def test_workers_elsewhere_take_a_relative_cache_as_the_command_does(
    running, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    go("s.zarr", "cache", kind=running, spring__stiffness=1)
    go("t.zarr", spring__stiffness=1)
    assert files(Path("s.zarr")) == files(Path("t.zarr"))
    assert list(tmp_path.glob("cache/cells/*.pack"))


def test_code_of_the_same_package_elsewhere_is_the_same(tmp_path, monkeypatch):
    digests = set()
    for place, text in (("one", "x = 1"), ("two", "x = 1"), ("three", "x = 2")):
        folder = tmp_path / place / "pack"
        folder.mkdir(parents=True)
        (folder / "__init__.py").write_text("")
        (folder / "inner.py").write_text(text)
        with monkeypatch.context() as patch:
            patch.syspath_prepend(folder.parent)
            package_digest.cache_clear()
            digests.add(package_digest("pack"))
    package_digest.cache_clear()
    assert len(digests) == 2 and "" not in digests and package_digest("no_such_pack") == ""
