"""The report of flights, run once."""

import pytest

from benchmarks import flights


def test_a_flight_is_the_sum_of_its_steps(monkeypatch):
    monkeypatch.setattr(flights, "FLIGHTS", (("roberts", 3900.0, 175.0, 160),))
    (row,) = flights.measure(repeats=1).rows
    assert 1e3 * row["whole"].median == pytest.approx(
        sum(row[f"{step}_ms"] for step in flights.STEPS)
    )
    assert row["overscan"] == pytest.approx(10, abs=0.1)
    assert row["lines"] > 10 * 31 / 0.8  # a mast of 31 m, pixels of 0.8 m, ten lines each
