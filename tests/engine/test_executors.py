"""Executors of all kinds return equal results and errors, run one task a process, check code."""

import os
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import buckets
import executors
import numpy as np
import pytest
from distributed.security import Security
from running import python
from small_stores import contents, files
from threadpoolctl import threadpool_limits
from toys import go

from sweeps.engine.objects import Objects
from sweeps.engine.run import dask_cluster
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor
from sweeps.engine.store.arrays import METADATA, Array
from sweeps.engine.store.manifest import Manifest
from sweeps.engine.store.writing import _write_remotely, write_on_worker

pytestmark = pytest.mark.usefixtures("at_a_terminal")


@pytest.fixture
def inline(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    choice = ClusterChoice(kind="inline")
    with threadpool_limits(2), open_executor(choice, say=executors.silent) as run:
        before = executors.blas_threads()
        yield run
        assert executors.blas_threads() == before
    assert os.environ["OMP_NUM_THREADS"] == "7"


@pytest.fixture(scope="module")
def running(request, tmp_path_factory):
    """Run a separate scheduler with two workers of two threads each; yield its cluster choice.

    The workers can access the bucket if its server can run here.
    """
    variables = {} if buckets.ABSENT else request.getfixturevalue("served")
    folder = tmp_path_factory.mktemp("scheduler")
    with executors.cluster_at(folder, **variables) as (choice, _):
        with open_executor(choice, say=executors.silent) as run:
            executors.eventually(lambda: run.worker_count == 2)
        yield choice


@pytest.fixture(scope="module")
def remote(running):
    with open_executor(running, say=executors.silent) as run:
        yield run


@pytest.fixture(params=["inline", "local", "remote"])
def any_executor(request):
    return request.getfixturevalue(request.param)


def timed(number):
    """Return draws, and process, thread and times of this task; fail for odd numbers."""
    return executors.draw(executors.refuse_odd(number), 100), executors.span(0.02)


def test_executors_return_outcomes_and_run_one_task_per_process(any_executor):
    for number in range(20):
        any_executor.submit(10 + number, timed, number)
    outcomes = executors.gather(any_executor)
    assert sorted(outcomes) == list(range(10, 30))
    spans = []
    for number in range(20):
        result, error = outcomes[10 + number]
        if number % 2:
            assert isinstance(error, ValueError) and str(error) == f"{number} is odd"
        else:
            assert error is None
            np.testing.assert_array_equal(result[0], executors.draw(number, 100))
            spans.append(result[1])
    assert any_executor.wait() == []
    processes = {process for process, *_ in spans}
    assert len(processes) <= any_executor.worker_count
    for process in processes:
        tasks = sorted((span for span in spans if span[0] == process), key=lambda span: span[2])
        assert len({thread for _, thread, *_ in tasks}) == 1
        assert all(a[3] <= b[2] for a, b in pairwise(tasks))


def test_numerical_libraries_use_one_thread(any_executor):
    assert set(executors.result_of(any_executor, executors.blas_threads)) == {1}
    assert executors.result_of(any_executor, os.environ.get, "OMP_NUM_THREADS") == "1"


# -- a scheduler at an address


def test_remote_and_inline_runs_make_the_same_store(running, tmp_path):
    values = {"spring__limit": 1.5}  # the stiffest spring fails
    stores = {kind: tmp_path / f"{kind}.zarr" for kind in ("inline", "remote")}
    inline = go(stores["inline"], **values)
    remote = go(stores["remote"], kind=running, **values)
    assert inline.failures and sorted(inline.failures) == sorted(remote.failures)
    assert files(stores["inline"]) == files(stores["remote"])
    done = {name: progress.done for name, progress in remote.progress.items()}
    assert done["noisy"] and done["answers"]  # noisy draws numbers, answers gathers cells
    assert done == {name: progress.done for name, progress in inline.progress.items()}


def test_remote_workers_write_chunks_and_the_driver_writes_metadata(
    running, place, tmp_path, monkeypatch
):
    """Each chunk of cells is sent once, to one worker; the command writes manifest and metadata."""
    sent, local = Counter(), set()
    submit, put = dask_cluster.DaskExecutor.submit, Objects.put

    def submitted(run, number, function, *arguments):
        if function is write_on_worker:
            sent.update(name for name, *_ in arguments[1])
        submit(run, number, function, *arguments)

    def putting(objects, name, content):
        local.add(name)
        put(objects, name, content)

    monkeypatch.chdir(tmp_path)
    cache, store = tmp_path / "cache", Path("s.zarr") if place == tmp_path else f"{place}/s.zarr"
    go(store, cache, kind=running)
    before = files(store).keys()
    monkeypatch.setattr(dask_cluster.DaskExecutor, "submit", submitted)
    monkeypatch.setattr(Objects, "put", putting)
    go(store, cache, kind=running, spring__mass=[1, 2, 3])
    new = files(store).keys() - before
    chunks = {name for name in new if name.startswith(("springs/period/", "answers/answer/"))}
    assert chunks <= sent.keys() <= new and not sent.keys() & local
    assert set(sent.values()) == {1}
    assert {"manifest", METADATA, "springs/mass/zarr.json"} <= local
    go(tmp_path / "t.zarr", cache, spring__mass=[1, 2, 3])
    assert contents(store) == contents(tmp_path / "t.zarr")


def test_workers_write_only_chunks_pending_in_the_manifest(tmp_path):
    def read(region):
        Manifest().put(store)  # by another command, while the chunk is read
        return np.arange(3)

    store, array = (
        Objects(tmp_path / "s.zarr", create=True),
        Array.from_values(("x",), np.arange(3)),
    )
    names = [f"g/x/c.{k}" for k in range(4)]
    arrays = array, array, replace(array, read=read), array
    chunks = [(name, array, (slice(0, 3),)) for name, array in zip(names, arrays, strict=True)]
    assert write_on_worker(Objects(store.path), chunks[:2]) == {} and files(store.path) == {}
    Manifest(pending_chunks=names[1:]).put(store)
    assert write_on_worker(Objects(store.path), chunks).keys() == {"g/x/c.1"}
    assert sorted(files(store.path)) == ["g/x/c.1", "manifest"]


def test_departed_workers_are_sent_no_more_chunks(tmp_path):
    class Leaving:
        """Executor of four workers, of which one remains after the first answer."""

        worker_count, numbers = 4, []

        def submit(self, number, function, *arguments):
            self.numbers.append(number)

        def wait(self):
            self.worker_count = 1
            return [(self.numbers.pop(0), {}, None)]

    array = SimpleNamespace(remote_read=np.arange, worker_part=lambda region: None)
    chunks = [SimpleNamespace(name=f"c.{k}", array=array, region=()) for k in range(100)]
    assert _write_remotely(Objects(tmp_path), chunks, Leaving()) == {}
    assert Leaving.numbers == []


@pytest.mark.usefixtures("impatient")
def test_scheduler_rejects_unknown_or_missing_certificates(running, tmp_path):
    files = executors.written(Security.temporary(), tmp_path)
    stranger = ClusterChoice(kind="address", address=running.address, **files)
    unencrypted = ClusterChoice(kind="address", address=running.address.replace("tls:", "tcp:"))
    for choice in (stranger, unencrypted):
        executors.fails_with(
            choice, f"cluster.address is {choice.address}, but no scheduler answers there .*"
        )


def test_worker_with_different_code_is_refused(running, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "of_this_process.py").write_text("")
    executors.fails_with(
        running,
        rf"cluster.address is {running.address}, but its worker tls://127.0.0.1:\d+ has different "
        "code of of_this_process; it must have the code of this process",
        packages=("toys", "of_this_process"),
    )


class Elsewhere(Objects):
    """A folder that only this machine sees."""

    def put(self, name, content):
        """Write nothing, as workers would see the file."""


def test_workers_that_do_not_see_a_folder_are_refused(running, tmp_path):
    packs = Elsewhere(tmp_path / "cache")
    executors.fails_with(
        running,
        rf"cluster.address is {running.address}, but its worker tls://127.0.0.1:\d+ does not see "
        rf"the cache '{packs.path}' of this command; put it where all workers see it",
        packs=packs,
    )


# imports ------------------------------------------------------------------------------------------


IMPORTERS = """
import sys, threading, toys

importers = set()

def note(event, arguments):
    if event == "import" and arguments[0].partition(".")[0] in {"dask", "distributed"}:
        if not hasattr(sys.modules.get("sweeps.engine.run.dask_cluster"), "DaskExecutor"):
            importers.add(threading.get_ident())

sys.addaudithook(note)
toys.go("s.zarr", "cache", "local", 1)
print(len(importers))
"""


def test_no_two_threads_import_dask_at_once(tmp_path):
    """The modules of dask import each other: a second thread could see a half-imported one."""
    done = python("-c", IMPORTERS, cwd=tmp_path, PYTHONPATH=executors.IMPORTS)
    assert done.stdout.split()[-1] == "1"
