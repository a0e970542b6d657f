"""A multirun is one sweep: its settings are crossed or run together, or its jobs stay apart."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from small_stores import files, opened
from toys import CALLS, SPRINGS, go

from sweeps.engine.command.line import Command
from sweeps.engine.store.writing import read_attributes


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Return a function that runs a command line in a new folder and returns its exit status."""
    monkeypatch.chdir(tmp_path)
    command = Command(replace(SPRINGS, conf=Path(__file__).with_name("conf")))

    def start(*arguments):
        CALLS.clear()
        return command.main(["cache=cache", *arguments])

    return start


def test_swept_settings_are_crossed_into_one_cube(command, tmp_path):
    arguments = ("spring.mass=2,1,5", "spring.limit=60,50", "spring.stiffness=[1,2],[2,4]")
    assert command("-m", "store=m.zarr", *arguments[:2]) == 0
    go(tmp_path / "s.zarr", spring__mass=[1, 2, 5], spring__limit=[50, 60])
    assert files(tmp_path / "m.zarr") == files(tmp_path / "s.zarr")
    # If jobs have lists of values, all values of these lists are crossed where possible.
    assert command("-m", "store=l.zarr", *arguments) == 0
    assert files(tmp_path / "l.zarr") == files(tmp_path / "s.zarr")


def test_config_group_choices_form_one_axis(command, tmp_path):
    assert command("-m", "store=m.zarr", "spring=hard,soft", "measured.draw=1") == 0
    springs = opened(tmp_path / "m.zarr", "springs")
    assert springs.period.dims == ("stiffness", "spring")
    assert springs.spring.values.tolist() == ["hard", "soft"]
    assert springs.limit.values.tolist() == [90, 50] and springs.mass.values.tolist() == [2, 1]
    go(tmp_path / "s.zarr", spring__limit=[50, 90], spring__mass=[1, 2], measured__draw=1)
    results = opened(tmp_path / "s.zarr", "springs")
    for name, limit, mass in (("hard", 90, 2), ("soft", 50, 1)):
        expected = results.period.sel(limit=limit, mass=mass).values
        np.testing.assert_array_equal(springs.period.sel(spring=name), expected)
    keys, points = ["spring.mass", "spring.limit"], [["2.0", "90.0"], ["1.0", "50.0"]]
    joint = read_attributes(tmp_path / "m.zarr")["joint"]
    assert joint == [["spring", keys, points, ["hard", "soft"]]]


def test_experiments_that_cannot_be_crossed_become_jobs(command, tmp_path):
    assert command("-m", "store=m.zarr", "+experiment=short,long", "measured.draw=1") == 0
    answers = opened(tmp_path / "m.zarr", "answers")
    assert answers.answer.dims == ("mass", "job")
    assert answers.length.values.tolist() == [2, 3, 4]
    assert answers.rule.values.tolist() == ["max", "mean", "mean"]
    labels = ["length=2,rule=max", "length=3,rule=mean", "length=4,rule=mean"]
    assert answers.job.values.tolist() == labels
    overrides = ("experiment=long", "measured.draw=1", "store=s.zarr")
    assert command("+" + overrides[0], *overrides[1:]) == 0
    job_answers = opened(tmp_path / "s.zarr", "answers").answer
    np.testing.assert_array_equal(answers.answer[:, 1:], job_answers)


def test_grid_zip_joins_settings_into_one_axis(command, tmp_path):
    pairs = ("spring.mass=[3,1,3]", "spring.limit=[9,9,5]", "grid.zip=[[mass,spring.limit]]")
    assert command("store=z.zarr", *pairs) == 0
    springs = opened(tmp_path / "z.zarr", "springs")
    assert springs.period.dims == ("stiffness", "mass_limit")
    assert springs.mass.values.tolist() == [1, 3, 3]
    assert springs.limit.values.tolist() == [9, 5, 9]
    labels = ["mass=1,limit=9", "mass=3,limit=5", "mass=3,limit=9"]
    assert springs.mass_limit.values.tolist() == labels
    point = springs.sel(mass_limit="mass=3,limit=5")
    assert (point.mass, point.limit) == (3, 5)
    assert CALLS["period"] == 3 * 3
    assert springs.energy.sizes == {"stiffness": 3, "mass_limit": 3}


# Commands, and the words that the messages refusing them must contain: key, value, bound.
ROWS = yaml.safe_load(Path(__file__).with_name("refused.yaml").read_text())
REFUSED, TOO_LARGE = ROWS["multirun"], ROWS["too large"]


@pytest.mark.parametrize("arguments", REFUSED)
def test_invalid_multiruns_and_zips_are_refused(command, tmp_path, capsys, arguments):
    assert command(*arguments.split(" ")) == 2
    (message,) = capsys.readouterr().err.splitlines()
    assert message.startswith("springs: ")
    assert not [word for word in REFUSED[arguments].split(" ") if word not in message]
    assert not list(tmp_path.glob("*.zarr")) and not (tmp_path / "cache").exists()


def test_hydra_launcher_runs_each_job_as_its_own_sweep(command, tmp_path):
    launched = ("-m", "hydra/launcher=basic", "hydra.sweep.dir=jobs")
    assert command(*launched, "spring.mass=0,3", "measured.draw=1") == 2
    (store,) = (tmp_path / "jobs").rglob("*.zarr")
    assert store == tmp_path / "jobs" / "1" / "sweep.zarr"
    assert opened(store, "springs").mass.values.tolist() == [3]


def test_interpolated_store_path_splits_jobs_into_stores(command, tmp_path):
    assert command("-m", "store=m${spring.mass}.zarr", "spring.mass=1,3", "spring.limit=50,60") == 0
    for mass in (1, 3):
        springs = opened(tmp_path / f"m{mass}.zarr", "springs")
        assert springs.mass.values.tolist() == [mass] and springs.limit.values.tolist() == [50, 60]


@pytest.mark.parametrize("arguments", TOO_LARGE)
def test_oversized_grids_are_refused(command, tmp_path, capsys, arguments):
    assert command("cluster=inline", "store=s.zarr", *arguments.split()) == 2
    (message,) = capsys.readouterr().err.splitlines()
    assert message.startswith("springs: ") and not list(tmp_path.iterdir())
    assert not [word for word in TOO_LARGE[arguments].split(" ") if word not in message]
