"""The proof of the engine counts cells, estimates the time of a loop and compares figures."""

import numpy as np
import pytest
import xarray as xr

from benchmarks.processes import Run
from docs._tables import operate, proof
from docs._tables.proof import LoneSetting, RepeatedSweep
from docs._tables.sweeping import choices_of

TINY = (
    "sensor=range",
    "classifier=correlation",
    "render.engine=lines",
    "render.pixel=1",
    "cluster=inline",
)
SMALL = (*operate.EXPERIMENT, "grid.ship=[duncan,horne,spruance,texas,connole,roberts]")


def test_loop_time_is_extrapolated_from_lone_settings():
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


def test_a_sweep_is_computed_once_and_then_read_from_its_cache(tmp_path):
    twice = proof.sweep_twice([*TINY, "grid.ship=duncan", "grid.aspect=[0,45]"], tmp_path / "new")
    assert (tmp_path / "new" / proof.STORE).is_dir()
    assert twice.cells > 2 and twice.warm.cpu > 0


@pytest.fixture
def twice(monkeypatch):
    """Replace sweeps by ones that take 7 and 2 s and store twice the numbers of the ships."""
    whole = xr.Dataset({"averaged": ("ship", [4.0, 6.0])}, {"ship": ["duncan", "texas"]})

    def sweep_twice(ships, folder):
        stored = whole.sel(ship=list(ships))
        stored.to_zarr(folder / proof.STORE, group="range_profile", consolidated=False)
        return RepeatedSweep(len(ships), *(Run(0.0, cpu, 0.0, 0.0, 0.0, "") for cpu in (9.0, 2.0)))

    monkeypatch.setattr(proof, "sweep_twice", sweep_twice)


@pytest.mark.usefixtures("twice")
def test_lone_settings_are_compared_with_the_whole_sweep():
    def same(whole, alone):
        return bool((whole.averaged.sel(ship=alone.ship) == alone.averaged).all())

    alone = [LoneSetting((ship,), same) for ship in ("duncan", "texas")]
    (profiles,), report = proof.prove_sweep(("duncan", "texas"), ["range_profile"], 4, alone)
    assert profiles.sizes["ship"] == 2
    shown = {row["what"]: row["value"] for row in report.rows}
    assert (shown["cells computed"], shown["cells of a loop over the settings"]) == ("2", "4")
    assert "Figures of 2 of them are also the sweep's" in report.notes[0]
    other = [LoneSetting(("duncan",), lambda whole, alone: False)]
    with pytest.raises(RuntimeError, match="`ncti-sweep duncan` differs from the whole sweep"):
        proof.prove_sweep(("duncan", "texas"), ["range_profile"], 4, other)


def test_each_fleet_size_is_computed_as_a_lone_setting():
    few = list(operate.lone_settings((*SMALL, "operate.fleet=[4,6]")))
    assert [one.same is not None for one in few] == [False, True]
    for one, ships in zip(few, (4, 6), strict=True):
        choices = choices_of(one.overrides)
        axes = (*operate.SENSOR_AXES, operate.Operate.fleet)
        assert all(len(choices[axis]) == 1 for axis in axes)
        assert choices[operate.Operate.fleet] == (ships,)
        named = np.array(choices[operate.Grid.ship])
        assert len(named) == ships and np.isin(operate.SHIPS, named).all()
