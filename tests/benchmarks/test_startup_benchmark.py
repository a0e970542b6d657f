"""The benchmarks of the start of the command, and of its time by number of cells."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import growth, startup


def test_the_start_has_a_time_for_every_step(monkeypatch):
    """Of commands that only count: `tests/benchmarks/test_command_benchmark.py` runs the real."""
    counting = "print('a word', flush=True); sum(range(2 * 10**7))"  # long enough to be looked at
    monkeypatch.setattr(startup, "PROGRAM", ("-c", counting))
    monkeypatch.setattr(startup, "sweep", lambda *given: SimpleNamespace(run=watched()))
    report = startup.measure(repeats=1)
    assert [row["step"] for row in report.rows] == [startup.HELP, startup.AGAIN, startup.WORDS]
    assert all(row["wall_s"].low > 0 for row in report.rows)
    assert all(row["cpu_s"] > 0 for row in report.rows[:2])


def watched():
    return startup.watch([sys.executable, *startup.PROGRAM], cores=startup.CORES)


def test_the_command_itself_says_something():
    assert startup.first_words(["--help"]) > 0


def test_a_command_that_says_nothing_is_an_error(monkeypatch):
    monkeypatch.setattr(startup, "PROGRAM", ("-c", "pass"))
    with pytest.raises(RuntimeError, match="printed nothing"):
        startup.first_words(())


def test_the_slope_is_the_exponent_of_the_number_of_cells():
    cells = np.array([4, 16, 64])
    assert growth.slope(cells, 3 * cells**1.5) == pytest.approx(1.5)


def test_growth_is_of_1_4_16_and_64_times_the_cells(monkeypatch):
    monkeypatch.setattr(growth, "_ships", lambda count: 0.1 * count)
    report = growth.measure(repeats=1, toys=((1, 2), (1, 8)))
    assert [row["cells"] for row in report.rows[:2]] == [2, 8]
    ships = report.rows[2:]
    assert [row["cells"] / ships[0]["cells"] for row in ships] == [1, 4, 16, 64]
    assert ships[-1]["slope"] == pytest.approx(1.0)
    assert [np.prod(grid) / 1200 for grid in growth.TOYS] == [1, 4, 16, 64]
