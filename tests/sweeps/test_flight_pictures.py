"""Pictures of flights: drawn when a sweep ends, whole or not at all, of what the store holds."""

import shutil
import subprocess
import sys
from dataclasses import asdict

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from past_ships import SMALL, SWEEP, flown, sweep
from sweeping import command, contents

import ncti.ships
from sweeps.app import main
from sweeps.flight_schema import FlightConfig
from sweeps.report.flight_again import Place, draw_flight, flights_of, known_ship, scan_of
from sweeps.report.flight_stages import BRIGHTEST, draw_stages, stages
from sweeps.store import read_attributes, tables_folder

PICTURES = [
    "flight_roberts_3km_172deg.png",
    "flight_roberts_3km_175deg.png",
    "validation.png",
]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory, cache):
    """A sweep that draws, its folder, and what it said."""
    folder = tmp_path_factory.mktemp("drawn")
    done = sweep("irar.pictures=true", folder=folder, cache=cache)
    return folder, done


def pictures(folder):
    return sorted(path.name for path in folder.iterdir() if path.suffix != ".csv")


def test_every_flight_is_drawn_beside_the_tables(drawn):
    folder, done = drawn
    assert pictures(folder / "s-tables") == PICTURES
    for name in PICTURES:
        image = imread(folder / "s-tables" / name)
        assert min(image.shape[:2]) > 300
        assert image.std() > 0.1
    (told,) = [line for line in done.stdout.splitlines() if line.startswith("pictures")]
    assert "s-tables" in told and all(name in told for name in PICTURES)
    assert "pictures" in done.stderr and "100%" in done.stderr


def test_pictures_are_no_part_of_what_a_store_is_made_of(drawn, tmp_path, cache):
    """The same store without them, which may be gone on with to draw them."""
    folder, _ = drawn
    done = sweep(folder=tmp_path, cache=cache)
    assert "pictures" not in done.stdout
    assert contents(tmp_path / "s.zarr") == contents(folder / "s.zarr")
    sweep("irar.pictures=true", folder=tmp_path, cache=cache)
    assert pictures(tmp_path / "s-tables") == PICTURES


def reported(folder, *arguments):
    return subprocess.run(
        [sys.executable, "-c", "from sweeps.report.command import main; main()", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_the_report_draws_when_it_is_told_to(drawn, tmp_path):
    shutil.copytree(drawn[0] / "s.zarr", tmp_path / "s.zarr")
    assert reported(tmp_path, "s.zarr").returncode == 0
    assert pictures(tmp_path / "s-tables") == []
    done = reported(tmp_path, "--pictures", "s.zarr")
    assert done.returncode == 0, done.stderr
    for name in PICTURES:
        again, first = (where / "s-tables" / name for where in (tmp_path, drawn[0]))
        np.testing.assert_array_equal(imread(again), imread(first))


def test_a_store_without_flights_has_no_such_pictures(tmp_path, cache):
    done = command(
        *("grid.ship=duncan", "grid.aspect=[0,90]", "grid.pulse_width=30", "grid.frame_count=4"),
        *("render.pixel=0.5", "render.engine=embree", "cluster=inline", "store=s.zarr"),
        folder=tmp_path,
        cache=cache,
    )
    assert done.returncode == 0, done.stderr
    done = reported(tmp_path, "--pictures", "s.zarr")
    assert done.returncode == 2
    assert "has no flights" in done.stderr and done.stderr.count("\n") == 1


def run_here(drawn, tmp_path, monkeypatch, cache):
    """Draw of the finished store, in this process; the exit status."""
    shutil.copytree(drawn[0] / "s.zarr", tmp_path / "s.zarr")
    monkeypatch.chdir(tmp_path)
    arguments = [*SWEEP, "cluster=inline", "store=s.zarr", f"cache={cache}", "irar.pictures=true"]
    monkeypatch.setattr("sys.argv", ["ncti-sweep", *arguments])
    with pytest.raises(SystemExit) as exit_:
        main()
    return exit_.value.code


def test_without_matplotlib_a_sweep_is_as_good(drawn, tmp_path, monkeypatch, capsys, cache):
    for name in ("matplotlib", "matplotlib.figure"):
        monkeypatch.setitem(sys.modules, name, None)
    assert run_here(drawn, tmp_path, monkeypatch, cache) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if "matplotlib" in line]
    assert told == [
        "ncti-sweep: pictures are not drawn: matplotlib is missing: install ncti-sweep[plot]"
    ]
    assert pictures(tmp_path / "s-tables") == []
    assert (tmp_path / "s-tables" / "flights.csv").is_file()


def test_a_picture_that_is_not_finished_is_not_there(drawn, tmp_path, monkeypatch, capsys, cache):
    def failing(self, target, **how):
        target.write_bytes(b"\x89PNG half")
        assert target.is_file()
        raise PermissionError("no more room")

    monkeypatch.setattr(Figure, "savefig", failing)
    assert run_here(drawn, tmp_path, monkeypatch, cache) == 0
    assert "pictures are not drawn: no more room" in capsys.readouterr().err
    assert pictures(tmp_path / "s-tables") == []


def test_a_ship_that_is_no_longer_the_same_is_not_drawn(drawn):
    attributes = read_attributes(drawn[0] / "s.zarr")
    other = attributes | {"mesh_digests": attributes["mesh_digests"] | {"roberts": "0"}}
    with pytest.raises(ValueError, match="roberts has changed since"):
        known_ship(other, "roberts")
    with pytest.raises(ValueError, match="mine was read from a file"):
        known_ship(attributes, "mine")


def test_titles_say_which_of_several_flights_is_drawn(drawn):
    attributes = read_attributes(drawn[0] / "s.zarr")
    places = flights_of(attributes)
    assert places == [Place("roberts", 172.0, 3.0), Place("roberts", 175.0, 3.0)]
    figure = draw_flight(attributes, places[0])
    assert figure.get_suptitle() == "Roberts at 3 km, aspect 172°, cnr 10 dB, no error"
    assert tables_folder(drawn[0] / "s.zarr").is_dir()


def attributes_of(config):
    """Of a store of one flight, as far as the picture of it depends on them."""
    return {
        "configuration": {
            "irar": asdict(config),
            "grid": {"ship": ["roberts"], "aspect": [175.0], "replicate": [0]},
            "ladar": {"reflectance": "projected_area"},
            "seed": 0,
        },
        "mesh_digests": {"roberts": ncti.ships.digest("roberts")},
    }


def recorded(config):
    """The ship, its raw images and its corrections."""
    attributes, mesh = attributes_of(config), ncti.ships.load("roberts")
    return mesh, *scan_of(attributes, flights_of(attributes)[0], mesh)


CHOICES = {
    "default": {},
    "other methods": {"azimuth": "line", "mirror": "rotation", "range_filter": "median"},
    "no methods": {"azimuth": "none", "mirror": "none", "range_filter": "mean"},
    "printed": {"chain": "printed"},
    "printed with the pulse rate": {"chain": ["printed_pulse_rate", "exact"]},
    "autofocus, threshold, gains": {
        "autofocus": True,
        "segmentation_threshold": 20.0,
        "transom_gain": 0.0,
        "mast_gain": 3.0,
        "jitter": 100.0,
    },
}


@pytest.mark.parametrize("chosen", CHOICES.values(), ids=CHOICES)
def test_the_last_correction_drawn_is_the_image_stored(chosen, cache):
    """Whatever the choices: the same pixels, in the same place."""
    found, plan = flown(cache, replicates=1, **chosen)
    last = stages(*recorded(plan.config))[-2]
    assert "all corrections" in last.title
    window = plan.window
    stored = found["intensity"].reshape(-1, window.rows, window.columns)[0]
    left, _, bottom, _ = (round(edge + 0.5) for edge in last.extent)
    rows = bottom + np.arange(last.intensity.shape[0]) - window.bottom
    columns = left + np.arange(last.intensity.shape[1]) - window.left
    row, column = ((k >= 0) & (k < n) for k, n in zip((rows, columns), stored.shape, strict=True))
    ours = last.intensity[np.ix_(row, column)]
    theirs = stored[np.ix_(rows[row], columns[column])]
    there = np.isfinite(theirs) & (theirs > 0)
    assert there.sum() > 100
    np.testing.assert_allclose(ours[there], theirs[there], rtol=1e-5)
    # All of the ship is in the picture.
    assert there.sum() > 0.95 * np.count_nonzero(stored > 0)


def test_stages_are_those_of_the_source_unless_something_is_left_out():
    def titles(**chosen):
        found = stages(*recorded(FlightConfig(range=3.0, **SMALL, **chosen)))
        return [stage.title for stage in found][1:-1]

    averaged = "averaged, range corrected, segmented"
    assert titles() == [averaged, "shifted in azimuth", "sheared: all corrections"]
    assert titles(mirror="none") == [averaged, "shifted in azimuth: all corrections"]
    assert titles(azimuth="none", mirror="none") == [f"{averaged}: all corrections"]
    assert titles(chain="printed") == ["all corrections as printed,\nf the line rate"]


@pytest.mark.parametrize("cnr", [-10.0, 0.0, 10.0, 40.0])
def test_one_shade_is_one_intensity_and_few_pixels_saturate(cnr):
    flight = recorded(FlightConfig(range=3.0, cnr=cnr, **SMALL))
    figure, every = draw_stages(*flight, title=""), stages(*flight)
    shown = [axes for axes in figure.axes if axes.get_title(loc="left")]
    assert len(shown) == len(every)
    (ends,) = {axes.images[0].get_clim() for axes in shown}
    assert ends[0] == 0
    for axes, stage in zip(shown[1:], every[1:], strict=True):
        lit = stage.intensity[np.nan_to_num(stage.intensity) > 0]
        assert (lit > ends[1]).sum() <= (1 - BRIGHTEST / 100) * lit.size + 1
        # Pixels without a look are covered, and no others.
        over = axes.images[1].get_array() if stage.unseen.any() else np.ma.masked_all((1, 1))
        assert np.array_equal(~np.ma.getmaskarray(over), stage.unseen) or not stage.unseen.any()
    # As bright as the truth says, where it is bright enough to tell from the noise.
    if cnr == 40.0:
        seen, truth = (
            np.median(k[k > 0.1 * k.max()]) for k in (every[-2].intensity, every[-1].intensity)
        )
        assert 0.5 < seen / truth < 2.0
