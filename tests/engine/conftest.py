"""Fixtures of several tests of executors."""

import signal

import pytest
from executors import silent

from sweeps.engine import workers
from sweeps.engine.cluster import ClusterChoice, executor


@pytest.fixture(scope="module")
def at_a_terminal():
    """Interrupts are heard, as by a command that is typed: what runs in the background ignores
    them, and so would all that it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def local(at_a_terminal):
    # The environment of the user does not decide, whatever it holds.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMP_NUM_THREADS", "7")
        with executor(ClusterChoice(workers=2), say=silent) as run:
            yield run


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(workers, "ANSWER", 0.5)
