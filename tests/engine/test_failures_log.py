"""Failures can be looked into: traceback and arguments are in a log, and screens stay short."""

import logging
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toys import SPRINGS

from sweeps.engine.command import Command
from sweeps.engine.failures import LARGEST, Failure, FailureLog, described, traceback_of
from sweeps.engine.settings import Settings, count
from sweeps.engine.stage import Experiment, Output, stage

PLACE = ["store=s.zarr", "cache=cache", "cluster=inline"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Where commands run."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def logged() -> str:
    """Text of the log that the last command wrote."""
    [path] = Path("outputs").rglob("failures.log")
    return path.read_text(encoding="utf-8")


def test_a_failed_cell_keeps_its_traceback_and_arguments(capsys):
    assert Command(SPRINGS).main([*PLACE, "spring.limit=1.5"]) == 1
    said = capsys.readouterr().err
    path = re.search(r"; tracebacks and arguments are in (outputs/\S+/failures\.log)$", said, re.M)
    assert path and Path(path[1]).is_file()
    text = logged()
    assert text.startswith("period stiffness=4 mass=1\n    ValueError: too [stiff]\n")
    assert "        limit = 1.5\n" in text and "        solver = {'rate': 2.0}\n" in text
    assert 'raise ValueError("too [stiff]")' in text and "toys.py" in text


def test_a_command_without_failures_writes_no_log():
    assert Command(SPRINGS).main(PLACE) == 0
    assert not [*Path("outputs").rglob("*.log")]  # nor an empty one of Hydra's


def test_what_libraries_log_is_a_message_and_no_result(capsys):
    def logging_table(answers, choices):
        logging.getLogger("library").warning("compiling %s", "x" * 200)

    tables = (replace(SPRINGS.tables[0], make=logging_table),)
    assert Command(replace(SPRINGS, tables=tables)).main(PLACE) == 0
    printed = capsys.readouterr()
    assert f"springs: compiling {'x' * 200}\n" in printed.err and "compiling" not in printed.out
    assert not [*Path("outputs").rglob("*.log")]


class Few(Settings, key="few"):
    """Of a stage that always fails."""

    size = count(list(range(1, 301)), label="size")


@stage(Output("x", label="x"), uses=(Few,), group="all")
def hopeless(size, rng):
    """A failure that depends on the size in words only."""
    raise RuntimeError(f"no {size}")


@stage(Output("x", label="x"), uses=(Few,), group="all")
def alike(size):
    """The same failure for all."""
    raise RuntimeError("no")


@pytest.mark.parametrize("declared", [hopeless, alike])
def test_many_failures_are_a_few_lines_and_all_in_the_log(capsys, declared):
    assert Command(Experiment("few", "Few", (Few,), (declared,))).main(PLACE) == 1
    said = capsys.readouterr().err
    assert len(said.splitlines()) < 20 and "300 cells failed" in said and "and 295 more" in said
    assert "further failures are counted at the end" in said
    text = logged()
    named = re.findall(rf"^{declared.name} size=(\d+)$", text, re.M)
    assert sorted(map(int, named)) == list(range(1, 301))
    traces = text.count("Traceback (most recent call last)")
    assert traces == (1 if declared is alike else 300)
    assert text.count(f"traceback as of {declared.name} size=") == 300 - traces
    if declared is hopeless:
        assert "rng = " in text and "cell_rng(0, **{'stage': 'hopeless', 'few.size': 7})" in text


def test_tables_are_logged_too():
    def spoilt(answers, choices):
        raise KeyError("nothing")

    tables = (replace(SPRINGS.tables[0], make=spoilt),)
    assert Command(replace(SPRINGS, tables=tables)).main(PLACE) == 1
    assert "table tables/best\n    KeyError: 'nothing'\n" in logged() and "spoilt" in logged()


class Odd:
    """What cannot be shown."""

    def __repr__(self):
        raise ValueError("not me")


def test_arguments_are_described_briefly():
    text = described({"a": np.zeros((300, 2)), "b": Odd(), "c": "x" * 10**6, "d": "two\nlines"})
    first, second, third, fourth = text.split("\n")
    assert first.startswith("a = float64 (300, 2) array([[0., 0.]")
    assert second == "b = Odd without a representation (ValueError: not me)"
    assert len(third) < 250 and fourth == "d = 'two\\nlines'"


def test_a_long_traceback_loses_its_middle():
    error = ValueError("".join(map(str, range(LARGEST))))
    assert LARGEST < len(traceback_of(error)) + 10 < LARGEST + 20
    assert "\n...\n" in traceback_of(error)


def test_a_log_is_appended_to_and_a_full_disk_costs_nothing(tmp_path, monkeypatch):
    (tmp_path / "failures.log").write_text("mine\n")
    log = FailureLog(tmp_path)
    log.add(Failure("a", "b"))
    assert (tmp_path / "failures.log").read_text() == "mine\na\n    b\n\n" and log.written
    absent = FailureLog(tmp_path / "nowhere")
    absent.add(Failure("a", "b"))
    assert not absent.written
