"""Fixtures shared by the tests of the engine: executors, buckets and places."""

import signal
import uuid
from functools import partial

import buckets
import pytest
from executors import eventually, running_server, silent

import sweeps
from sweeps.engine.run import dask_cluster
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor


@pytest.fixture(scope="module")
def at_a_terminal():
    """Handle SIGINT as a command typed at a terminal does.

    Processes started in the background ignore SIGINT, and so do the processes they start.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module", autouse=True)
def no_server_of_other_tests():
    """End any fork server that a worker, restarted while its cluster closed, has left running."""

    def none_runs():
        if server := running_server():
            server.terminate()
        return server is None

    eventually(none_runs)


@pytest.fixture(scope="module")
def local(no_server_of_other_tests, at_a_terminal):
    # Workers must ignore the number of threads in the user's environment.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMP_NUM_THREADS", "7")
        with open_executor(ClusterChoice(workers=2), say=silent) as run:
            yield run


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(dask_cluster, "ANSWER_SECONDS", 0.5)


@pytest.fixture(scope="session")
def served():
    """Run a server with a bucket; yield the environment variables that clients of it need."""
    if buckets.ABSENT:
        pytest.skip(buckets.ABSENT)
    with buckets.serving() as environment:
        yield environment


@pytest.fixture
def bucket(served, monkeypatch):
    """Return the URL of a new place in a bucket."""
    for name, value in served.items():
        monkeypatch.setenv(name, value)
    return f"s3://{buckets.BUCKET}/{uuid.uuid4().hex}"


@pytest.fixture(params=["folder", "bucket"])
def place(request, tmp_path):
    """Return a new place: a folder, or a URL in a bucket."""
    return tmp_path if request.param == "folder" else request.getfixturevalue("bucket")


@pytest.fixture
def sweep(tmp_path, monkeypatch):
    """Return `sweeps.sweep` with a store and a cache in a new folder."""
    monkeypatch.chdir(tmp_path)
    return partial(sweeps.sweep, store="s.zarr", cache="c")
