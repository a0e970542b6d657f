"""The report of synthesis, run small."""

import contextlib
import io

import numpy as np

from benchmarks import synthesis
from benchmarks.processes import Run
from ncti.ladar import RangeExtent, frame_moments


def test_every_row_has_its_times(monkeypatch):
    monkeypatch.setattr(synthesis, "FRAME_COUNTS", (4,))
    monkeypatch.setattr(synthesis, "PULSES", (30e-9,))
    monkeypatch.setattr(synthesis, "RANGES", (1e5,))
    report = synthesis.measure("duncan", repeats=1, aspects=(90.0,))
    assert [row["part"] for row in report.rows] == [
        "frames",
        "covariance",
        *(f"image, 100 km, {way}" for way in ("none", "perfect", "shifted")),
    ]
    for row in report.rows:
        assert row["ms"].low > 0
        assert {"normals_ms", "plain_ms"} & set(row)


def test_the_plain_computations_are_of_the_same_things():
    """Equal normals: the rounding of float32; covariances: rounding of sums over 4,000 IFOVs."""
    fraction = np.zeros((2, 60))
    fraction[0, 20:30], fraction[1, 28] = 0.05, 0.7
    down_range = np.arange(60) - 29.5
    seen = RangeExtent(fraction, down_range, 1.0, np.zeros((2, 2), int), 150e-6, 1e5)
    frames = synthesis.frame_calls(seen, 30e-9, 40)
    again = synthesis.frame_calls(seen, 30e-9, 40)
    np.testing.assert_allclose(frames["ours"](), again["plain"](), rtol=1e-5)
    signal = {"cnr": synthesis.CNR, "target_free_ifovs": synthesis.TARGET_FREE}
    _, exact = frame_moments(seen, pulse_width=30e-9, **signal)
    plain = synthesis.covariance_calls(seen, 30e-9)["plain"]()
    np.testing.assert_allclose(plain, exact, atol=1e-12 * exact.max() * synthesis.TARGET_FREE)


def test_long_runs_have_their_memory(monkeypatch):
    def watched(command, *, cores):
        """Of the same call in this process: another takes seconds to start."""
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(command[-1], {})
        return Run(1.0, 1.0, 100.0, 100.0, 0.0, printed.getvalue())

    monkeypatch.setattr(synthesis, "watch", watched)
    monkeypatch.setattr(synthesis, "LONG_RUNS", (40,))
    for few in ("FRAME_COUNTS", "PULSES", "RANGES"):
        monkeypatch.setattr(synthesis, few, ())
    (row,) = synthesis.measure("duncan", repeats=1, aspects=(90.0,), long_runs=True).rows
    assert row["frames"] == 40
    assert row["ms"].low > 0
    assert row["mib"].median == 100.0
