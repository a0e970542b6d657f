"""The report of sweeps by number of views: what they sweep, and a small one."""

import sys

import pytest

from benchmarks import __main__ as command
from benchmarks import scale
from benchmarks.processes import watch
from sweeps.app import command as sweeping
from sweeps.engine.overrides import read_jobs
from sweeps.experiment import EXPERIMENT
from sweeps.stages.views import Grid


@pytest.mark.parametrize(("kind", "views", "aspects"), scale.grids()[:2] + scale.grids()[4:6])
def test_sweeps_have_as_many_views_as_they_say(kind, views, aspects):
    jobs = read_jobs(EXPERIMENT, [*scale.SCENE, *aspects], several=False)
    [(plan, _)] = sweeping().prepare(jobs)
    assert len(scale.SHIPS) * len(plan.choices[Grid.aspect]) == views
    assert (kind == scale.RANDOM) == ("grid.random_aspects=0" not in aspects)


def test_every_kind_has_a_sweep_of_the_least_number_of_views():
    kinds = {kind for kind, views, _ in scale.grids() if views <= scale.LEAST_VIEWS}
    assert kinds == {scale.LEARNED, scale.RANDOM}
    with pytest.raises(SystemExit):
        command.main(["scale", "--most", str(scale.LEAST_VIEWS - 1)])


def test_a_small_sweep_has_all_figures(monkeypatch):
    monkeypatch.setattr(scale, "SHIPS", ("duncan", "texas"))
    monkeypatch.setattr(scale, "STEPS", (45.0,))
    monkeypatch.setattr(scale, "DRAWN", ())
    coarse = (*scale.SCENE, "render.pixel=1", "cluster=inline")
    report = scale.measure(most=10, scene=coarse)
    [row] = report.rows
    assert set(row) == {column.key for column in report.columns}
    assert row["views"] == 6 and row["files"] > 20
    shares = [row[key] for key in ("extent", "averages", "matching", "others")]
    assert min(shares) > 0 and sum(shares) == pytest.approx(100)
    assert row["cpu_ms"] > 0
    assert row["driver_mib"] > 50


def test_watch_counts_the_time_of_processes_that_nobody_waits_for():
    """One that has computed for 0.6 s, and is there when the command that it belongs to ends."""
    child = (
        "import time; [None for _ in iter(lambda: time.process_time() < 0.6, False)];"
        "print('computed', flush=True); time.sleep(5)"
    )
    parent = (
        "import os, subprocess, sys, time;"
        f"busy = subprocess.Popen([sys.executable, '-c', {child!r}], stdout=subprocess.PIPE);"
        "busy.stdout.readline(); time.sleep(1); busy.kill(); os._exit(0)"
    )
    # User and system time are counted in hundredths of a second.
    assert watch([sys.executable, "-c", parent], cores=2).cpu > 0.6 - 2 * 0.01 - 0.01
