"""Another process compiles loops ahead of their first call."""

import os
import sys
import time
from pathlib import Path

import pytest

from ncti import machine_code
from ncti.machine_code import CompiledLoops, compiling_ahead
from ncti.render.loops import PIECES

NAP = 600  # s


def sleep():
    Path(os.environ["NUMBA_CACHE_DIR"], "asleep").touch()
    time.sleep(NAP)


def eventually(holds):
    while not holds():
        time.sleep(0.01)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Yield an empty folder for machine code."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(machine_code, "processor_count", lambda: 2)
    for function in (machine_code.folder, machine_code.folder_of):
        function.cache_clear()
    yield tmp_path
    for function in (machine_code.folder, machine_code.folder_of):
        function.cache_clear()


def test_loops_are_compiled_once_in_another_process(monkeypatch):
    assert PIECES.are_missing()
    with compiling_ahead(PIECES):
        pass
    assert not PIECES.are_missing()
    monkeypatch.setattr(machine_code.subprocess, "Popen", None)  # nothing starts again
    with compiling_ahead(PIECES):
        pass


def test_nothing_is_compiled_ahead_on_one_processor(monkeypatch):
    monkeypatch.setattr(machine_code, "processor_count", lambda: 1)
    monkeypatch.setattr(machine_code.subprocess, "Popen", None)
    with compiling_ahead(PIECES):
        assert PIECES.are_missing()


@pytest.mark.parametrize("executable", ["/nowhere/python", "/bin/false"])
def test_a_process_that_fails_is_ignored(monkeypatch, executable):
    monkeypatch.setattr(sys, "executable", executable)
    with compiling_ahead(PIECES):
        pass
    assert PIECES.are_missing()


def test_error_terminates_the_compiler_process_at_once(folder, monkeypatch):
    paths = [str(Path(__file__).parent), *sys.path]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    start = time.monotonic()

    def fail():
        with compiling_ahead(CompiledLoops("naps", PIECES.names, sleep)):
            eventually(lambda: (folder / "asleep").exists())
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert time.monotonic() - start < NAP
