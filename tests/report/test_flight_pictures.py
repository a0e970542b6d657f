"""Reports draw flights from the store on request, and refuse ships that have changed."""

import shutil

import numpy as np
import pytest
from commands import opened, swept
from made import scores
from matplotlib.image import imread
from stores import FLIGHTS, SMALL, attributes_of, contents, reported, signed

import ncti.ships
from ncti.irar import Chain, Flight, fly, ship_heading
from sweeps.engine.store.tables import restore_scalars
from sweeps.report.flights import correction_stages, known_ship, scan_of
from sweeps.report.outputs import tables_folder

PICTURES = ["flight_duncan_3km_175deg.png", "flight_roberts_3km_175deg.png"]


@pytest.fixture
def store(sisters, tmp_path):
    """Return a copy of a store of flights, without tables."""
    shutil.copytree(sisters, tmp_path / "s.zarr")
    return tmp_path / "s.zarr"


def pictures(folder):
    return sorted(name for name in contents(folder) if not name.endswith(".csv"))


@pytest.mark.usefixtures("quick_layout")
def test_report_draws_pictures_only_on_request(store, monkeypatch, capsys):
    assert reported(monkeypatch, store) == 0
    assert pictures(tables_folder(store)) == []
    assert reported(monkeypatch, "--pictures", store) == 0
    assert pictures(tables_folder(store)) == PICTURES
    for name in PICTURES:
        image = imread(tables_folder(store) / name)
        assert min(image.shape[:2]) > 300
        assert image.std() > 0.1
    captured = capsys.readouterr()
    (summary,) = [line for line in captured.out.splitlines() if line.startswith("pictures")]
    assert "s-tables" in summary and all(name in summary for name in PICTURES)
    assert "pictures" in captured.err and "100%" in captured.err


def test_pictures_of_a_store_without_flights_are_refused(tmp_path, monkeypatch, capsys):
    path = tmp_path / "s.zarr"
    scores(mass=[1.0, 2.0]).to_zarr(path, group="tables/pears", consolidated=False)
    signed(path)
    assert reported(monkeypatch, "--pictures", path) == 2
    message = capsys.readouterr().err
    assert "has no flights" in message and message.count("\n") == 1


def test_ship_changed_since_the_sweep_is_not_drawn(sisters):
    attributes = attributes_of(sisters)
    changed = attributes | {"mesh_digests": attributes["mesh_digests"] | {"roberts": "0"}}
    with pytest.raises(ValueError, match="roberts has changed since"):
        known_ship(changed, "roberts")
    with pytest.raises(ValueError, match="mine was read from a file"):
        known_ship(attributes, "mine")


TOGETHER = "grid.zip=[[irar.azimuth,irar.mirror,irar.range_filter]]"
CHOICES = {
    "methods": [
        TOGETHER,
        "irar.azimuth=[line,none,pixel]",
        "irar.mirror=[rotation,exact,none]",
        "irar.range_filter=[median,mean,cluster]",
    ],
    "chains": ["irar.chain=[exact,printed,printed_pulse_rate]", "irar.autofocus=[false,true]"],
    "inputs": [
        "irar.segmentation_threshold=[null,20]",
        "ladar.reflectance=lambertian",
        "irar.transom_gain=0",
        "irar.mast_gain=3",
        "irar.jitter=100",
        "seed=[0,1]",
    ],
}


@pytest.mark.parametrize("chosen", CHOICES.values(), ids=CHOICES)
def test_last_drawn_correction_equals_the_stored_image(chosen, tmp_path):
    """For all choices of corrections, chains and inputs, the pixels and their places are equal."""
    overrides = [item for item in FLIGHTS if not item.startswith("grid.")]
    path, ship = tmp_path / "s.zarr", ("grid.ship=roberts", "grid.aspect=175")
    swept(path, tmp_path / "cache", *overrides, *ship, *chosen)
    attributes, flights = attributes_of(path), restore_scalars(opened(path, "validation")).squeeze()
    mesh = ncti.ships.load("roberts")
    axes = [name for name in flights.intensity.dims if name not in ("row", "column")]
    sizes = [flights.sizes[name] for name in axes]
    assert np.prod(sizes) >= 3
    for index in np.ndindex(*sizes):
        assert_drawn(flights.isel(dict(zip(axes, index, strict=True))), attributes, mesh)


def assert_drawn(flight, attributes, mesh):
    """Assert that a flight's last corrected stage is its stored image, with nothing cut off."""
    *_, (title, last), _ = correction_stages(mesh, **scan_of(attributes, flight, mesh)).items()
    assert "all corrections" in title
    stored = flight.intensity.transpose("row", "column").sel(row=last.row, column=last.column)
    assert np.count_nonzero(stored) > 100
    np.testing.assert_allclose(last.intensity, stored, rtol=1e-5)
    assert float(stored.sum()) == pytest.approx(float(flight.intensity.sum()), rel=1e-6)


def flown(cnr=20.0):
    """Return the ship's mesh, and a recorded scan of it."""
    mesh = ncti.ships.load("roberts")
    flight = Flight(
        slant_range=3000.0,
        ship_heading=ship_heading(aspect=175.0, sight=5.0),
        cnr=10 ** (cnr / 10),
        **SMALL | {"ifov": SMALL["ifov"] * 1e-6},
    )
    return mesh, fly(mesh, flight).record(np.random.default_rng(0))


def test_drawn_stages_omit_corrections_that_are_off():
    def titles(**chosen):
        return list(correction_stages(*flown(), Chain(**chosen)))[1:-1]

    averaged = "averaged, range corrected, segmented"
    assert titles() == [averaged, "shifted in azimuth", "sheared: all corrections"]
    assert titles(mirror="none") == [averaged, "shifted in azimuth: all corrections"]
    assert titles(azimuth="none", mirror="none") == [f"{averaged}: all corrections"]
    assert titles(form="printed") == ["all corrections as printed,\nf the line rate"]
