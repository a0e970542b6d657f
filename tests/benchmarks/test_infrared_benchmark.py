"""The reports of infrared images, run small."""

import pytest

from benchmarks import images


def test_every_range_and_resolution_has_a_rate():
    report = images.measure("duncan", repeats=1, aspects=(90.0,))
    found = [(row["range_km"], row["super_resolution"]) for row in report.rows]
    assert len(set(found)) == len(found) == 9
    for row in report.rows:
        whole = sum(row[f"{step}_us"] for step in images.STEPS)
        assert row["per_second"] == pytest.approx(1e6 / whole)
