import json
import sys

import pytest

from benchmarks import __main__ as command
from benchmarks import engine, steps, views
from benchmarks.processes import watch
from benchmarks.reports import Column, Report, Sample
from ncti.render import available_engines

TINY = 2.0  # pixels [m]


LIKE_OTHERS = ("egl", "Mitsuba 3, llvm", "trimesh.ray", "pyrender on EGL, anew")
"""Methods that differ from others by a platform or a package alone; each takes a process."""


@pytest.fixture(scope="module")
def timed_views():
    with pytest.MonkeyPatch.context() as patch:
        for name in LIKE_OTHERS:
            patch.delitem(views.METHODS, name)
        return views.measure("duncan", repeats=1, aspects=(30.0,), pixel=TINY)


def lacks_peer(row):
    """Return whether a row says that an optional package is not installed."""
    said = "is missing: dependency group benchmark"
    return row["method"] in views.OPTIONAL and row.get("absent", "").endswith(said)


def test_every_method_has_figures_or_a_reason(timed_views):
    measured = [name for name in views.METHODS if name not in LIKE_OTHERS]
    assert [row["method"] for row in timed_views.rows] == measured
    for row in timed_views.rows:
        engine, _ = views.METHODS[row["method"]]
        if engine not in available_engines() or lacks_peer(row):
            assert row["absent"]
            continue
        assert "absent" not in row, row
        for key in ("wall_ms", "cpu_ms", "ratio", "no_pulse_percent"):
            assert row[key].n == 1
            assert 0 <= row[key].low <= row[key].median <= row[key].high


def test_all_methods_draw_the_same_view(timed_views):
    # A silhouette is a few pixels wide here; another scale, offset or turn would show.
    pixels = [row["pixels"] for row in timed_views.rows if "absent" not in row]
    assert max(pixels) - min(pixels) < 0.05 * min(pixels)


def test_pixel_methods_have_the_error_of_their_lattice(timed_views):
    """The depth of an orthographic camera is wrong in pyrender; lines err less than pixels."""
    error = {
        row["method"]: row["no_pulse_percent"].median
        for row in timed_views.rows
        if "absent" not in row
    }
    anew = {name: error.pop(name) for name in list(error) if "anew" in name}
    assert all(value > 100 for value in anew.values())
    assert 0 < error.pop("lines") < min(error.values()) / 2
    assert max(error.values()) < 1.02 * min(error.values())


def test_watch_sees_the_memory_of_a_child_process():
    # The grandchild holds 64 MiB; neither process holds it because of the other.
    child = "held = bytearray(64 * 2**20); import time; time.sleep(0.5)"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    run = watch([sys.executable, "-c", parent], cores=2)
    assert run.seconds > 0.5
    assert run.largest == run.worker > 64
    assert run.together > 64
    assert run.driver < run.worker


def test_cells_are_swept_by_workers(monkeypatch):
    monkeypatch.setattr(engine, "FEW", 2500)
    [row] = engine.measure(most=2500).rows
    assert row["cells"] == 2500 and all(0 < row[f"{step}_mib"] < 1000 for step in engine.STEPS)
    assert 0 < row["again"] < row["sweep"]


def test_command_prints_and_writes_json(monkeypatch, tmp_path, capsys):
    def measured(asked):
        row = {"ship": asked.ship, "ms": Sample.of(range(asked.repeats))}
        return Report("Time", (Column("ship", "ship"), Column("ms", "ms", ".1f")), [row])

    monkeypatch.setitem(command.REPORTS, "steps", ("time", measured))
    path = tmp_path / "figures.json"
    command.main(["steps", "--repeats", "2", "--ship", "spruance", "--json", str(path)])
    assert "spruance │ 0.5 (0.0–1.0)" in capsys.readouterr().out
    written = json.loads(path.read_text())
    assert set(written) == {"machine", "steps"} and written["machine"]["cores"]
    [row] = written["steps"]["rows"]
    assert row["ms"] == {"median": 0.5, "low": 0, "high": 1, "n": 2}


def test_each_step_is_timed_alone(monkeypatch):
    """Each part has one view: of a flight, of profiles, and of an image at each range."""
    monkeypatch.setattr(steps, "ASPECTS", (90,))
    monkeypatch.setattr(steps, "classifiers", lambda mesh: [])
    rows = steps.measure("duncan", repeats=1).rows
    assert len(rows) == len({(row["part"], row["step"]) for row in rows}) == 5 + 3 * 4 + 4
    assert all(row["ms"].low > 0 for row in rows)


@pytest.mark.parametrize(
    ("arguments", "named"), [(["--repeats", "0"], "--repeats is 0"), (["--ship", "ark"], "ark")]
)
def test_invalid_arguments_exit_with_a_one_line_error(arguments, named, capsys):
    with pytest.raises(SystemExit) as caught:
        command.main(arguments)
    assert caught.value.code == 2
    assert named in capsys.readouterr().err
