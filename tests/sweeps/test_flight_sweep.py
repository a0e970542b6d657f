"""A small sweep of flights from the command line: what is in its store, whoever made it."""

import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from past_ships import SWEEP, sweep
from sweeping import contents, fresh

from ncti.features import profile_vector
from sweeps import graph
from sweeps.app import main
from sweeps.axes import ERRORS, FLIGHT_AXES
from sweeps.flight_variables import FLIGHT_GROUPS
from sweeps.variables import DONE, FAILED, MISSING


@pytest.fixture(scope="module")
def made(tmp_path_factory, cache):
    """The folder of the sweep, run on two workers with a stage cache of its own."""
    folder = tmp_path_factory.mktemp("flown")
    sweep(folder=folder, cache=fresh(folder, cache))
    return folder


def opened(folder, group):
    return xr.open_zarr(folder / "s.zarr", group=group).load()


def run_here(monkeypatch, folder, *overrides, code=0):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(
        "sys.argv", ["ncti-sweep", *SWEEP, "cluster=inline", "store=s.zarr", *overrides]
    )
    with pytest.raises(SystemExit) as exit_:
        main()
    assert exit_.value.code == code


def test_store_opens_with_its_axes(made):
    tree = xr.open_datatree(made / "s.zarr", engine="zarr")
    assert {f"/{group}" for group in FLIGHT_GROUPS} <= set(tree.groups)
    flights = opened(made, "validation")
    cell = ("ship", "aspect", "range", "cnr", "error")
    assert flights.profile_correlation.dims == cell
    assert flights.profile.dims == (*cell, "source", "down_range")
    assert flights.intensity.dims == (*cell, "row", "column")
    assert flights.signature.dims == (*cell, "pulse_width", "kind", "down_range")
    assert flights.range.values.tolist() == [3.0]
    assert flights.error_parameter.values.tolist() == ["none", "aircraft_speed"]
    assert flights.error_value.values.tolist() == [0.0, 1.0]
    # An axis of one value is a scalar coordinate.
    assert flights.mast_gain.item() == 1.0 and flights.mirror.item() == "exact"
    assert flights.transom_gain.attrs["long_name"].startswith("input on the source's word")
    named = opened(made, "classification/measured")
    assert named.correct.dims == (
        *("pulse_width", "classifier", "vigilance", "range", "cnr", "error", "kind"),
        *("ship", "aspect"),
    )
    assert named.classifier.values.tolist() == ["acn", "correlation"]


def test_every_variable_has_units_and_a_name(made):
    tree = xr.open_datatree(made / "s.zarr", engine="zarr")
    for node in tree.subtree:
        for name, variable in node.to_dataset().variables.items():
            assert variable.attrs["long_name"], name
            if variable.dtype.kind not in "OTU":
                assert variable.attrs["units"], name
    coordinates = {name for node in tree.subtree for name in node.coords}
    assert {*FLIGHT_AXES, *ERRORS} <= coordinates


def test_flights_are_what_a_physicist_expects(made):
    """Bounds that a coarse image, 1.5 m a pixel, keeps; without an error of the speed."""
    flights = opened(made, "validation").sel(ship="roberts").isel(error=0)
    assert np.all(flights.profile_correlation.sel(cnr=20) > 0.9)
    assert np.all(np.abs(flights.hangar_spike_offset) < 1.0)
    assert np.all(np.abs(flights.noiseless_mast_tilt) < 1.0)
    assert np.all(flights.closing_speed_error == 0)
    assert np.all((flights.looks > 8) & (flights.looks < 11))  # 9.7 lines a pixel
    # Profiles are in noise powers.
    sums = flights.profile.sel(source="noiseless").sum("down_range")
    np.testing.assert_allclose(sums.sel(cnr=20) / sums.sel(cnr=10), 10.0, rtol=1e-5)
    # A hundredth too fast, and tops come to lie 4 m nearer or further than the waterline.
    wrong = opened(made, "validation").sel(ship="roberts").isel(error=1)
    np.testing.assert_allclose(wrong.closing_speed_error, 90 / 82.2 * 0.01, rtol=0.1)
    # Of 24 draws it costs 0.08 to 0.10, one of them scattering by 0.025 at 10 dB: four of them in
    # the mean by 0.012, so that 0.05 is three of these away.
    lost = flights.profile_correlation - wrong.profile_correlation
    assert np.all(lost > 0) and np.all(lost.sel(cnr=20) > 0.05)
    assert lost.mean() > 0.05


def test_every_cell_that_is_asked_for_is_done(made):
    status = opened(made, "status_measured").cell
    assert np.all(status.sel(kind=["learned", "test"]) == DONE)
    assert np.all(status.sel(kind="measured", ship="roberts") == DONE)
    assert np.all(status.sel(kind="measured", ship="duncan") == MISSING)
    assert np.all(opened(made, "status").view == DONE)


def test_tables_count_the_answers_of_ships_that_are_flown_past(made):
    tables = opened(made, "tables/measured").sel(aspect_bin="overall")
    answers = opened(made, "classification/measured").sel(ship="roberts")
    for mine, theirs in (("accuracy", "correct"), ("ship_accuracy", "ship_correct")):
        xr.testing.assert_allclose(
            tables[mine].drop_vars(["aspect_bin", "aspect_low"]),
            answers[theirs].mean("aspect").drop_vars("ship"),
        )
    assert np.all(tables.n == 2)
    assert np.all((tables.ci_low <= tables.accuracy) & (tables.accuracy <= tables.ci_high))


def test_measured_signatures_are_like_the_learned(made):
    """At 20 dB, and whatever the pulse: the source's claim in one number."""
    flights = opened(made, "validation").sel(ship="roberts", cnr=20, range=3).isel(error=0)
    vectors = profile_vector(flights.signature.transpose("kind", ...).values)
    learned, _, measured = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    assert np.all((learned * measured).sum(axis=-1) > 0.97)


def test_one_and_two_workers_make_the_same_store(made, tmp_path, cache):
    sweep(folder=tmp_path, cache=fresh(tmp_path, cache), workers=1)
    assert contents(tmp_path / "s.zarr") == contents(made / "s.zarr")


def test_a_sweep_that_was_killed_goes_on(made, tmp_path, monkeypatch):
    """After the first views: the same command makes the same store of it."""
    run_views = graph.run_views

    def killed(*args):
        yield next(run_views(*args))
        raise KeyboardInterrupt

    monkeypatch.setattr(graph, "run_views", killed)
    run_here(monkeypatch, tmp_path, f"cache={made / 'cache'}", code=130)
    assert opened(tmp_path, "status").view.values.ravel().tolist() == [DONE] + 3 * [MISSING]
    there = opened(tmp_path, "validation").profile.sel(source="measured")
    assert np.isfinite(there.isel(ship=0, aspect=0)).all()
    assert np.isnan(there.isel(ship=0, aspect=1)).all()
    monkeypatch.setattr(graph, "run_views", run_views)
    run_here(monkeypatch, tmp_path, f"cache={made / 'cache'}")
    assert contents(tmp_path / "s.zarr") == contents(made / "s.zarr")


def test_a_view_that_fails_is_named_and_the_rest_is_done(made, tmp_path, monkeypatch, capsys):
    view_flights = graph.view_flights

    def failing(view):
        if view.aspect == 172:
            raise ValueError("no wind")
        return view_flights(view)

    monkeypatch.setattr(graph, "view_flights", failing)
    run_here(monkeypatch, tmp_path, f"cache={made / 'cache'}", code=1)
    said = capsys.readouterr().err
    assert "ship=roberts aspect=172" in said and "no wind" in said
    status = opened(tmp_path, "status_measured").cell.sel(kind="measured", ship="roberts")
    assert np.all(status.sel(aspect=172) == FAILED)
    assert np.all(status.sel(aspect=175) == DONE)
    assert np.all(opened(tmp_path, "tables/measured").n.sel(aspect_bin="overall") == 1)


def test_report_reads_the_store(made, tmp_path):
    shutil.copytree(made / "s.zarr", tmp_path / "s.zarr")
    run = subprocess.run(
        [sys.executable, "-c", "from sweeps.report.command import main; main()", "s.zarr"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert run.returncode == 0, run.stderr
