"""Fixtures of several tests of executors."""

import signal
import uuid

import buckets
import pytest
from executors import eventually, running_server, silent

from sweeps.engine.run import dask_cluster
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor


@pytest.fixture(scope="module")
def at_a_terminal():
    """Interrupts are heard, as by a command that is typed: what runs in the background ignores
    them, and so would all that it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module", autouse=True)
def no_server_of_other_tests():
    """A worker restarted while its cluster closes may start a fork server that outlives both."""
    eventually(no_server)


def no_server():
    """End the fork server of this process; return whether there is none."""
    if server := running_server():
        server.terminate()
    return server is None


@pytest.fixture(scope="module")
def local(no_server_of_other_tests, at_a_terminal):
    # The environment of the user does not decide, whatever it holds.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMP_NUM_THREADS", "7")
        with open_executor(ClusterChoice(workers=2), say=silent) as run:
            yield run


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(dask_cluster, "ANSWER_SECONDS", 0.5)


@pytest.fixture(scope="session")
def served():
    """The environment that leads to a server with a bucket."""
    if buckets.ABSENT:
        pytest.skip(buckets.ABSENT)
    with buckets.serving() as environment:
        yield environment


@pytest.fixture
def bucket(served, monkeypatch):
    """A new place in a bucket, as URL."""
    for name, value in served.items():
        monkeypatch.setenv(name, value)
    return f"s3://{buckets.BUCKET}/{uuid.uuid4().hex}"


@pytest.fixture(params=["folder", "bucket"])
def place(request, tmp_path):
    """A new place of either kind."""
    return tmp_path if request.param == "folder" else request.getfixturevalue("bucket")
