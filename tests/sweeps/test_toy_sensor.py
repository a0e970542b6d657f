"""One module, this one, can declare a sensor, a classifier and a table.

The sensor is a depth sounder, which measures the draught of a ship by echoes; the classifier names
the ship of the nearest draught. None of its words stands anywhere else in the project.
"""

import csv
import sys

import numpy as np
import pytest
import xarray as xr
from commands import opened, ran

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.settings import COORDINATE, DIMENSION, Settings, count, number
from sweeps.engine.declare.stage import STATE, Group, Output, Status, Stream
from sweeps.engine.store.writing import read_attributes
from sweeps.report import stores as report_stores
from sweeps.report.confusion import confusion_frame, read_predictions
from sweeps.report.frames import read_frames
from sweeps.stages.classifier import classifies_with
from sweeps.stages.views import STATUS, Grid, uses_sensor

SENSOR = NAME = "toy"
DRAUGHT = {"duncan": 4.5, "spruance": 6.3, "texas": 8.0}


class Toy(Settings, key="toy"):
    """The depth sounder."""

    echoes = count(4, 1, 100, label="echoes averaged", role=DIMENSION)
    scatter = number(0.5, 0, 10, unit="m", label="scatter of one echo", role=COORDINATE)


KEELS = Group("toy", uses_sensor(SENSOR), (Grid, Toy), status=STATUS)
ANSWERS = Group("classification/toy", classifies_with(NAME, SENSOR), (Grid,), status=Status("toy"))


@KEELS.stage(
    Output("depth", label="depth of the keel", unit="m"),
    along=(Toy.echoes,),
    stream=Stream((Grid.ship, Grid.aspect, Toy.scatter)),
)
def toy_depth(ship, echoes, scatter, rng):
    """Return the mean depth of the first echoes, (echoes,)."""
    depths = DRAUGHT[ship] + scatter * rng.standard_normal(max(echoes))
    return np.array([depths[:number].mean() for number in echoes])


@ANSWERS.stage(
    Output("predicted", ("ship", "aspect"), "i2", label="ship named, as an index"),
    Output("correct", ("ship", "aspect"), "i1", label="1 where the answer is right"),
    Output("cell", ("ship", "aspect"), "i1", label="state", role=STATE),
    gather=(Grid.ship, Grid.aspect),
)
def toy_namer(toy_depth, ship, valid):
    """Name the ship of the nearest draught."""
    draughts = np.array([DRAUGHT[name] for name in ship])
    predicted = np.abs(toy_depth[..., None] - draughts).argmin(axis=-1)
    right = predicted == np.arange(len(ship))[:, None]
    return {"predicted": predicted, "correct": right, "cell": valid}


def tabulate(answers, choices):
    """Return the share of the ships that are named right."""
    share = answers.correct.mean(("ship", "aspect"))
    share.attrs = {"units": "1", "long_name": "share of ships named right"}
    return xr.Dataset({"share": share})


def check(choices):
    """Refuse ships without a known draught."""
    for ship in choices[Grid.ship] if uses_sensor(SENSOR)(choices) else ():
        if ship not in DRAUGHT:
            raise ConfigurationError(f"grid.ship has {ship!r}, but toy knows {', '.join(DRAUGHT)}")
    return choices


TABLES = (ANSWERS.table("toy", tabulate),)

MODULES = (sys.modules[__name__],)
SWEEP = (
    *("sensor=toy", "classifier.name=toy", "grid.ship=[duncan,spruance,texas]"),
    *("grid.aspect=[0,90]", "toy.echoes=[1,9]", "toy.scatter=[0,2]", "store=s.zarr", "cache=cache"),
)


@pytest.fixture
def store(folder, capsys):
    assert ran(*SWEEP, modules=MODULES) == 0, capsys.readouterr().err
    capsys.readouterr()
    return folder / "s.zarr"


def test_it_has_axes_names_ships_and_is_reported(store):
    keels, answers, table = (
        opened(store, group) for group in ("toy", "classification/toy", "tables/toy")
    )
    assert keels.depth.dims == ("ship", "aspect", "echoes", "scatter")
    assert keels.scatter.attrs == {"units": "m", "long_name": "scatter of one echo"}
    exact = keels.depth.sel(scatter=0)
    for ship, draught in DRAUGHT.items():
        assert (exact.sel(ship=ship) == np.float32(draught)).all()
    one_echo, nine_echoes = (
        abs(keels.depth - exact).sel(echoes=number, scatter=2).mean() for number in (1, 9)
    )
    assert 0 < nine_echoes < one_echo
    assert answers.correct.dims == ("echoes", "scatter", "ship", "aspect")
    assert (answers.correct.sel(scatter=0) == 1).all() and not answers.correct.all()
    assert (opened(store, "status").view == 1).all()
    assert (opened(store, "status").toy == 1).all()
    xr.testing.assert_equal(table.share, answers.correct.mean(("ship", "aspect")))
    root = read_attributes(store)["configuration"]
    assert root["sensor"] == ["toy"] and root["toy"] == {"echoes": [1, 9], "scatter": [0, 2]}
    rows = list(csv.DictReader((store.with_name("s-tables") / "toy.csv").open()))
    assert len(rows) == 4
    assert [float(row["share"]) for row in rows if float(row["scatter_m"]) == 0] == [1, 1]
    matrix = confusion_frame(read_predictions(report_stores.open_store(store)), read_frames(store))
    assert set(matrix.rows.classifier) == {"toy"} and "channel" not in matrix.columns


def test_it_stands_beside_the_others(folder, results, capsys):
    overrides = (*SWEEP, "sensor=[range,toy]", "classifier.name=[acn,toy]", "render.pixel=1")
    assert ran(*overrides, "grid.frame_count=2", f"cache={results}", modules=MODULES) == 0
    assert {"range_profile", "toy"} <= {path.name for path in (folder / "s.zarr").iterdir()}
    assert "nothing to do" not in capsys.readouterr().err


def test_it_is_described_and_checked_like_the_others(capsys):
    assert ran("--settings", "toy.scatter", modules=MODULES) == 0
    output = capsys.readouterr().out
    assert output.startswith("toy.scatter=0.5 [m]\n") and "to 10 m" in output
    for overrides, message in {
        "toy.scatter=11": "toy.scatter has 11",
        "grid.ship=horne": "toy knows duncan",
        "toy.volume=1": "toy.volume is not a key of the configuration; toy has echoes, scatter",
        "toy.cnr=1": "did you mean ladar.cnr",
    }.items():
        assert ran(*SWEEP, overrides, modules=MODULES) == 2
        assert message in capsys.readouterr().err


def test_a_ship_need_not_fit_into_the_window_of_a_radar_that_is_not_there(folder, capsys):
    short = (*SWEEP, "ladar.window=60", "dry_run=true")
    assert ran(*short, modules=MODULES) == 0
    assert ran(*short, "sensor=[range,toy]", "classifier.name=toy", modules=MODULES) == 2
    assert "ladar.window has 60" in capsys.readouterr().err
