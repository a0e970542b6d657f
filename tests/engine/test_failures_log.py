"""Failures can be looked into: traceback and arguments are in a log, and screens stay short."""

from pathlib import Path

import pytest
from toys import SPRINGS

from sweeps.engine.command import Command

PLACE = ["store=s.zarr", "cache=cache", "cluster=inline"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Where commands run."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_failed_cell_keeps_its_traceback_and_arguments(capsys):
    assert Command(SPRINGS).main([*PLACE, "spring.limit=1.5"]) == 1
    said = capsys.readouterr().err
    assert said.endswith("; tracebacks and arguments are in s-failures.log\n")
    text = Path("s-failures.log").read_text(encoding="utf-8")
    assert text.startswith("period stiffness=4 mass=1\n    ValueError: too [stiff]\n")
    assert "        limit = 1.5\n" in text and "        solver = {'rate': 2.0}\n" in text
    assert 'raise ValueError("too [stiff]")' in text and "toys.py" in text
