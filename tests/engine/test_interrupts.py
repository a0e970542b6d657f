"""A signal is never lost, never interrupts clean-up, and ends a command with one sentence."""

import contextlib
import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest
from small_stores import files
from toys import SPRINGS, go, having

from sweeps.engine import sweeping as run
from sweeps.engine.command.line import Command
from sweeps.engine.declare.stage import Table
from sweeps.engine.run.interrupts import (
    Stopped,
    allow_interrupts,
    defer_signals,
    raise_if_stopped,
)
from sweeps.engine.store import writing as store

GIVEN = ["cache=cache", "cluster=inline", "store=s.zarr", "spring.stiffness=[1,2]", "spring.mass=1"]


def arrive(number=signal.SIGINT):
    """Send a signal to this process."""
    os.kill(os.getpid(), number)


@pytest.fixture(autouse=True)
def heard():
    """Set default handlers of SIGINT and SIGHUP, which the tests may have been started without."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGHUP)}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_signals_are_deferred_until_checked():
    with defer_signals():
        arrive()
        arrive(signal.SIGTERM)  # signals after the first change nothing
        with pytest.raises(Stopped) as stopped:
            raise_if_stopped()
        assert (stopped.value.message, stopped.value.status) == ("interrupted", 130)
        with pytest.raises(Stopped), allow_interrupts():
            pytest.fail("begun after a signal")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    raise_if_stopped()
    with defer_signals():
        raise_if_stopped()  # the signal of the earlier context is forgotten


def arriving(function):
    """Return a function that sends a signal and then calls `function`."""

    def called(*arguments, **keywords):
        arrive()
        return function(*arguments, **keywords)

    return called


def swallowing(*arguments, **keywords):
    """Send a signal, and suppress any exception that it raises."""
    with contextlib.suppress(BaseException):
        arrive()


WHERE = {  # step of the sweep during which the signal arrives
    "checking": lambda patch: replace(SPRINGS, check=swallowing),
    "computing": lambda patch: patch.setattr(run, "execute", arriving(run.execute)),
    "a table": lambda patch: having(
        SPRINGS, tables=(Table("tables/best", ("answers",), swallowing),)
    ),
    "the store": lambda patch: patch.setattr(store, "encode", arriving(store.encode)),
    "metadata": lambda patch: patch.setattr(store, "_commit", arriving(store._commit)),
}


@pytest.mark.parametrize("where", WHERE)
def test_interrupted_sweep_reports_one_line_and_resumes(where, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:
        experiment = WHERE[where](patch) or SPRINGS
        assert Command(experiment).main(GIVEN) == 130
    output = capsys.readouterr()
    sentence = "springs: interrupted; the same command resumes the sweep"
    assert output.err.splitlines()[-1] == sentence and output.err.count("interrupted") == 1
    assert "Traceback" not in output.err and "Exception" not in output.err
    assert not [path for path in Path().iterdir() if path.name.startswith(".")]
    assert Command(SPRINGS).main(GIVEN) == 0
    go(tmp_path / "t.zarr", spring__stiffness=[1, 2], spring__mass=1)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "t.zarr")
