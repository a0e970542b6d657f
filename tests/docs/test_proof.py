"""The proof of the engine counts cells, estimates the time of a loop and compares figures."""

import itertools
import time

import numpy as np
import pytest
from commands import ran

from benchmarks.commands import SUMMARY, SweepCost
from benchmarks.processes import Run
from docs._tables import operate, proof
from docs._tables.proof import LoneSetting, RepeatedSweep
from docs._tables.sweeping import choices_of

TINY = (
    "sensor=range",
    "classifier=correlation",
    "render.engine=lines",
    "render.pixel=1",
)
GRID = (*TINY, "grid.ship=[duncan,texas]", "grid.aspect=[0,45,90]", "grid.frame_count=[4,8]")
SMALL = (*operate.EXPERIMENT, "grid.ship=[duncan,horne,spruance,texas,connole,roberts]")


def test_a_loop_takes_as_long_as_its_settings():
    """Two of 100 settings take 7 and 9 s: 800 s for all, 8 times 100, standard error 1 s in 8."""

    def twice(cells, cold, warm):
        return RepeatedSweep(cells, *(Run(0.0, cpu, 500.0, 0.0, 0.0, "") for cpu in (cold, warm)))

    report = proof.engine_report(
        (), 100, twice(600, 120, 20), [twice(29, 9, 2), twice(31, 12, 3)], 0
    )
    shown = {row["what"]: row["value"] for row in report.rows}
    assert shown["cells of a loop over the settings"] == "3,000"
    assert shown["results reused"] == "80 %"
    assert shown["cells a second of it"] == "5"
    loop = shown["processor time of a loop over the settings"]
    assert loop == "0.222 h, 8 ± 2 times as long"


@pytest.fixture
def in_this_process(monkeypatch, capsys):
    """Sweep in this process after the first command, as a process takes ten seconds to start."""
    calls, command = itertools.count(), proof.sweep

    def sweep(overrides, folder):
        if next(calls) == 0:
            return command([*overrides, "cluster=inline"], folder)
        begun = time.process_time()
        status = ran(*overrides, f"cache={folder / 'cache'}", f"store={folder / proof.STORE}")
        printed = capsys.readouterr().err
        assert status == 0, printed
        made = int(SUMMARY.search(printed)["done"].replace(",", ""))
        run = Run(0.0, time.process_time() - begun, 500.0, 0.0, 0.0, printed)
        return SweepCost(run, made, 0.0)

    monkeypatch.setattr(proof, "sweep", sweep)


@pytest.mark.usefixtures("in_this_process")
def test_settings_alone_are_of_the_sweep_and_figures_are_equal(monkeypatch):
    """A loop computes all cells that one setting needs, for each of four settings."""

    def same(whole, alone):
        at = {name: alone[name] for name in ("ship", "frame_count")}
        return bool((whole.averaged.sel(at) == alone.averaged).all())

    alone = [
        LoneSetting((*GRID, f"grid.ship=[{ship}]", f"grid.frame_count=[{frames}]"), same)
        for ship, frames in (("duncan", 4), ("texas", 8))
    ]
    (profiles,), report = proof.prove_sweep(GRID, ["range_profile"], 4, alone)
    assert profiles.sizes["ship"] == 2
    shown = {row["what"]: row["value"] for row in report.rows}
    computed, loop = (
        int(shown[name].replace(",", ""))
        for name in ("cells computed", "cells of a loop over the settings")
    )
    assert computed < loop < 4 * computed
    other = LoneSetting(alone[0].overrides, lambda whole, alone: False)
    nothing = RepeatedSweep(1, *[Run(0.0, 1.0, 1.0, 0.0, 0.0, "")] * 2)

    def stored(overrides, folder):  # in place of two more sweeps
        profiles.to_zarr(folder / proof.STORE, group="range_profile")
        return nothing

    monkeypatch.setattr(proof, "sweep_twice", stored)
    with pytest.raises(RuntimeError, match="differs"):
        proof.prove_sweep(GRID, ["range_profile"], 4, [other])


def test_each_number_of_ships_of_the_sensors_is_computed_alone():
    few = list(operate.lone_settings((*SMALL, "operate.fleet=[4,6]")))
    assert [one.same is not None for one in few] == [False, True]
    for one, ships in zip(few, (4, 6), strict=True):
        choices = choices_of(one.overrides)
        axes = (*operate.SENSOR_AXES, operate.Operate.fleet)
        assert all(len(choices[axis]) == 1 for axis in axes)
        assert choices[operate.Operate.fleet] == (ships,)
        named = np.array(choices[operate.Grid.ship])
        assert len(named) == ships and np.isin(operate.SHIPS, named).all()
