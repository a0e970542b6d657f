"""A tiny sweep of all classifiers of range profiles, and what is in its folder."""

import csv

import pytest
import xarray as xr
from threadpoolctl import threadpool_limits

from sweeps.app import main

SWEEP = [
    "grid.ship=[duncan,spruance]",
    "grid.aspect=[0,45,90]",
    "grid.pulse_width=[30,50]",
    "grid.frame_count=[2,4]",
    "grid.vigilance=[0.9,0.95]",
    "grid.replicate=2",
    "render.pixel=0.5",
    "render.samples=0",
    "render.engine=embree",
    "classifier=all",
    "classifier.training=[expected,noisy]",
    "classifier.left_out=[false,true]",
    "classifier.gain_sigma=[0,1]",
    "classifier.mnn.inputs=[raw,standardised]",
    "classifier.mnn.annealing=[true,false]",
    "classifier.mnn.epochs=40",
]
NAMES = ("acn", "mnn", "correlation", "likelihood")
OWN = {  # axes that each of them has several values on
    "acn": {"vigilance": [0.9, 0.95]},
    "mnn": {"inputs": ["raw", "standardised"], "annealing": [True, False]},
    "correlation": {"training": ["expected", "noisy"], "left_out": [False, True]},
    "likelihood": {"gain_sigma": [0, 1], "left_out": [False, True]},
}
SCALARS = {  # and axes of one value
    "acn": {"learning_rate"},
    "mnn": {"epochs", "grow_every", "mnn_learning_rate", "tolerance"},
    "correlation": set(),
    "likelihood": set(),
}
STATES = {name: "status" if name == "acn" else f"status_{name}" for name in NAMES}
BINS = ["0", "45", "90", "overall"]
SHAPE = {"replicate": 2, "frame_count": 2, "ship": 2, "aspect": 3}


def run(monkeypatch, folder, *given, cache, code=0):
    """The tiny sweep in this process, with other values of what is given."""
    keys = tuple(item.partition("=")[0] + "=" for item in given)
    tiny = [item for item in SWEEP if not item.startswith(keys)]
    monkeypatch.chdir(folder)
    arguments = [*tiny, *given, "cluster=inline", "store=s.zarr", f"cache={cache}"]
    monkeypatch.setattr("sys.argv", ["ncti-sweep", *arguments])
    # One thread, as a worker has: products then round alike.
    with threadpool_limits(1), pytest.raises(SystemExit) as exit_:
        main()
    assert exit_.value.code == code


def group(folder, name):
    return xr.open_zarr(folder / "s.zarr", group=name).load()


def rows_of(folder, name="classifiers"):
    with (folder / "s-tables" / f"{name}.csv").open(newline="") as file:
        return list(csv.DictReader(file))
