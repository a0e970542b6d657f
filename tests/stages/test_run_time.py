"""Run time against error: errors beside the plain computation, times as what they are."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from commands import chosen, opened, swept
from hypothesis import given
from hypothesis import strategies as st

import ncti.ships
from ncti.ladar import RangeExtent, range_extent
from ncti.ladar.pulse import target_kernel
from ncti.ladar.reference import reference_range_extent
from ncti.render import EngineError, available_engines, line_image, range_image
from sweeps.engine.errors import ConfigurationError
from sweeps.experiment import EXPERIMENT
from sweeps.report import figures
from sweeps.stages import apart, run_time
from sweeps.stages.run_time import Look, changed, ifov_error, relative_error
from sweeps.stages.run_time_tables import at_error, costs, nominal
from sweeps.stages.views import Render

SMALL = (
    *("sensor=run_time", "grid.ship=[duncan,texas]", "grid.aspect=60", "render.samples=0"),
    *("grid.pulse_width=[10,30]", "grid.frame_count=16", "render.engine=[embree,lines]"),
    *("render.pixel=[1,2]", "render.roll=31.7", "ladar.spread=[0,0.5]", "run_time.repeats=2"),
)
SINGLE = ("range", "frame_count", "bin_width")
EDGES = np.arange(-125.0, 126.0)
VIEW = {"aspect": 60.0, "depression": 3.84}
PLACE = {"ship": "texas", "pixel": 1}


def empty(folder, cache):
    """A cache without results, which shares ships and compiled code with another."""
    found = folder / "cache"
    found.mkdir()
    for name in ("meshes", "compiled"):
        (cache / name).mkdir(parents=True, exist_ok=True)
        (found / name).symlink_to(cache / name, target_is_directory=True)
    return found


@pytest.fixture(scope="module")
def store(tmp_path_factory, cache):
    path = tmp_path_factory.mktemp("run_time") / "s.zarr"
    assert not swept(path, empty(path.parent, cache), *SMALL).failures
    return path


@pytest.fixture(scope="module")
def measured(store):
    return opened(store, "run_time").squeeze(SINGLE)


def areas(extent):
    return extent.fraction * (extent.ifov * extent.slant_range) ** 2


def test_errors_are_those_of_the_library_beside_the_reference(measured):
    ship = ncti.ships.load("texas")
    sight = {"slant_range": 100e3}
    exact = reference_range_extent(ship, **VIEW, **sight, bin_edges=EDGES, side=15.0)
    image = range_image(ship, **VIEW, **sight, pixel=1.0, roll=31.7, engine="embree")
    lines = line_image(ship, **VIEW, **sight, spacing=1.0, roll=31.7)
    kernel = target_kernel(pulse_width=30e-9, bin_width=1.0, bin_count=250) ** 2
    for engine, seen, spread in (
        ("embree", image, 0.5),
        ("embree", image, 0.0),
        ("lines", lines, 0),
    ):
        extent = range_extent(seen, spread=spread, **sight)
        found = measured.sel(PLACE | {"engine": engine, "spread": spread})
        p, q = areas(extent).sum(axis=0), exact.area.sum(axis=0)
        assert found.extent_error == pytest.approx(np.abs(p - q).sum() / q.sum(), rel=1e-5)
        after = np.abs(kernel @ (p - q)).sum() / (kernel @ q).sum()
        assert found.profile_error.sel(pulse_width=30) == pytest.approx(after, rel=1e-5)


def test_an_ifov_that_only_one_of_them_sees_counts_whole():
    def extent(cells, rows):
        place = {"down_range": np.zeros(2), "bin_width": 1.0, "ifov": 1.0, "slant_range": 1.0}
        return RangeExtent(fraction=np.array(rows), cell=np.array(cells), **place)

    exact = extent([[0, 0], [1, 0]], [[0.5, 0.5], [1.0, 0.0]])
    found = extent([[2, 0], [0, 0]], [[0.1, 0.0], [0.5, 0.25]])
    # 0.25 of the first, all of the second, and 0.1 that is not there: of 2 in all.
    assert ifov_error(found, exact) == pytest.approx((0.25 + 1.0 + 0.1) / 2.0)
    assert ifov_error(exact, exact) == 0.0


def test_single_ifovs_err_more_than_all_together(measured):
    """The triangle inequality; and a pulse, which adds bins up, never adds to the error."""
    assert (measured.ifov_error >= measured.extent_error * (1 - 1e-6)).all()
    assert (measured.profile_error <= measured.extent_error * 1.02).all()  # but for the window
    assert (measured.extent_error > 0).all()


@given(
    st.lists(st.floats(0.01, 10), min_size=3, max_size=3),
    st.lists(st.floats(-0.01, 0.01), min_size=3, max_size=3),
)
def test_the_error_is_that_of_what_was_added(exact, wrong):
    q, e = np.array(exact), np.array(wrong)
    assert relative_error(q + e, q) == pytest.approx(np.abs(e).sum() / q.sum(), abs=1e-14)


# Times --------------------------------------------------------------------------------------


def test_times_are_there_and_say_that_they_were_measured(measured):
    for name in ("run_time", "ratio"):
        assert (measured[name] > 0).all()
        assert "measured" in measured[name].attrs["comment"]
    assert measured.run_time.attrs["units"] == "s"
    assert "comment" not in measured.extent_error.attrs


def test_samplings_take_turns_beside_the_yardstick(monkeypatch):
    asked = []

    def stopwatch(look, mesh, sampling):
        asked.append((look.engine, sampling))
        return 2.0 if look.engine == "embree" else len(asked)

    monkeypatch.setattr(run_time, "_stopwatch", stopwatch)
    monkeypatch.setattr(Look, "extent", lambda *_: None)
    look = Look(0.0, 0.0, None, "lines", 0, 100e3, 150e-6, 1.0, 250.0)
    seconds, ratio = run_time._times(None, look, (1.0, 2.0), (0.0,), (0.0, 0.5), 2)
    unit = ("embree", (0.25, run_time.ROLL, 0.5))
    a, b, c, d = (("lines", (pixel, 0.0, spread)) for pixel in (1.0, 2.0) for spread in (0.0, 0.5))
    assert asked == [unit, a, b, unit, c, d, unit, d, c, unit, b, a]
    np.testing.assert_array_equal(ratio, seconds / 2.0)


def test_a_view_is_timed_on_one_thread(tmp_path, cache, monkeypatch):
    from ncti.render import threads

    found = []

    def times(mesh, look, pixel, roll, spread, repeats):
        found.append((threads.thread_count(), os.environ["OPENBLAS_NUM_THREADS"]))
        return np.ones((2, repeats, len(pixel) * len(roll) * len(spread)))

    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    monkeypatch.setattr(run_time, "_times", times)
    few = ("render.pixel=2", "ladar.spread=0")
    few = (*few, "grid.ship=duncan", "grid.pulse_width=30", "render.engine=lines")
    swept(tmp_path / "s.zarr", empty(tmp_path, cache), *SMALL, *few)
    assert found == [(1, "1")]


def test_what_was_measured_is_kept_and_what_is_computed_is_equal(store, measured, tmp_path, cache):
    """Another run of the same sweep measures nothing; one elsewhere measures anew."""
    swept(tmp_path / "again.zarr", store.parent / "cache", *SMALL)
    again = opened(tmp_path / "again.zarr", "run_time").squeeze(SINGLE)
    xr.testing.assert_identical(again, measured)
    part = ("grid.ship=texas", "render.engine=lines", "render.pixel=1")
    swept(tmp_path / "other.zarr", empty(tmp_path, cache), *SMALL, *part)
    other = opened(tmp_path / "other.zarr", "run_time").squeeze()
    here = measured.sel(PLACE | {"engine": "lines"}).squeeze()
    for name in ("extent_error", "ifov_error", "profile_error"):
        np.testing.assert_array_equal(other[name], here[name])
    assert not np.array_equal(other.run_time, here.run_time)


# Answers ------------------------------------------------------------------------------------


def test_answers_change_with_the_extents_and_not_else():
    rng = np.random.default_rng(3)
    exact = np.zeros((2, 2, 100))
    exact[..., 40:60] = rng.random((2, 2, 20))
    noise = 0.3 * rng.standard_normal((2, 2, 8, 100))
    there = np.ones((2, 2), dtype=bool)
    assert not changed({"signature": exact}, exact, noise, there).any()
    worse = exact.copy()
    worse[1] = exact[0]  # both ships look alike: the first one answers
    found = changed({"signature": worse}, exact, noise, there)
    assert found[1].mean() > 0.5
    there[1, 1] = False
    assert np.isnan(changed({"signature": exact}, exact, noise, there)[1, 1])


def test_the_noise_has_the_moments_of_frames():
    """Draws of the exact covariance: a sample of 4000 has its variances to some 2 % each."""
    cells = {"cell": np.zeros((1, 2), dtype=np.int64), "ifov": 1.0, "slant_range": 1.0}
    fraction = np.full((1, 40), 0.01)
    extent = RangeExtent(fraction=fraction, down_range=np.arange(40.0), bin_width=1.0, **cells)
    given = {"cnr": 1000.0, "target_free_ifovs": 100}
    _, covariance = run_time.library.frame_moments(
        extent, pulse_width=30e-9, frame_count=4, **given
    )
    draw = EXPERIMENT.by_name["profile_noise"]
    noise = draw(extent, 30.0, 4, 1000.0, 100, 4000, np.random.default_rng(0))
    # Five standard deviations of sqrt(2/4000) for each of 40 variances, and of 1/sqrt(4000).
    assert np.abs(noise.var(axis=0) / np.diag(covariance) - 1).max() < 5 * np.sqrt(2 / 4000)
    score = noise.mean(axis=0) / np.sqrt(np.diag(covariance) / 4000)
    assert np.abs(score).max() < 5


# Tables -------------------------------------------------------------------------------------


def test_the_cost_of_an_error_follows_the_power_law():
    pixel = np.array([0.125, 0.25, 0.5, 1.0])
    error, time = 0.02 * pixel**1.5, 0.003 * pixel**-2.0
    needed = (1e-3 / 0.02) ** (1 / 1.5)
    assert at_error(pixel, error, 1e-3) == pytest.approx(needed)
    assert at_error(time, error, 1e-3) == pytest.approx(0.003 * needed**-2.0)
    assert np.isnan(at_error(time, error, 1e-5))
    assert at_error(time, error, 0.5) == pytest.approx(0.003)  # the coarsest is good enough
    assert np.isnan(at_error(time, error * np.nan))


def test_tables_are_medians_and_worst_views(store, measured):
    table = opened(store, "tables/run_time").squeeze()
    here = measured.sel(spread=0.5)
    views = ("ship", "aspect")
    np.testing.assert_allclose(table.run_time, here.run_time.median(views))
    np.testing.assert_allclose(table.profile_error_worst, here.profile_error.max(views))
    np.testing.assert_allclose(table.changed, here.changed.mean(views))
    cost = opened(store, "tables/run_time_cost").squeeze()
    assert set(cost.data_vars) == {"run_time_needed", "ratio_needed", "pixel_needed"}
    assert costs(nominal(table.isel(pixel=0))).sizes["engine"] == 2  # one pixel is a table, too


def test_the_picture_has_a_curve_an_engine(store, measured):
    figure = figures.draw("runtime_vs_error", store)
    titles = ["no pulse", "10 ns pulse", "30 ns pulse"]
    assert [axes.get_title() for axes in figure.axes] == titles
    here = measured.sel(spread=0.5)
    for axes in figure.axes:
        curves = {line.get_label(): line for line in axes.lines if line.get_label()[0] != "_"}
        assert set(curves) == {"embree", "lines"}
    x, y = curves["lines"].get_data()
    of_lines = here.sel(engine="lines").median(("ship", "aspect"))
    np.testing.assert_allclose(x, 1e3 * of_lines.run_time)
    np.testing.assert_allclose(y, 100 * of_lines.profile_error.sel(pulse_width=30), rtol=1e-6)


# Engines ------------------------------------------------------------------------------------


def test_engines_that_are_not_here_are_named_and_left_out(monkeypatch):
    monkeypatch.setattr(run_time, "available_engines", lambda: ("embree",))
    choices = chosen("sensor=run_time", "grid.ship=duncan", "render.engine=[egl,embree,lines]")
    assert choices[Render.engine] == ("embree", "lines")
    said = EXPERIMENT.remarks(choices)
    assert [line.split()[4].strip(":") for line in said] == ["osmesa", "egl"]


WRONG = {
    "render.tolerance=0.01": "render.tolerance has 0.01, but must be null with the sensor run_time",
    "run_time.bin_width=2 grid.pulse_width=10": "grid.pulse_width has 10, but must be at least 18.9"
    " for run_time.bin_width 2 m",
    "run_time.bin_width=50": "run_time.bin_width has 50, but must be at most a tenth of "
    "ladar.window, 250 m",
    "render.pixel=5 grid.range=20": "render.pixel has 5, but must be at most 3 m, the width of an",
}


@pytest.mark.parametrize("overrides", WRONG)
def test_what_cannot_be_measured_is_refused(overrides):
    with pytest.raises(ConfigurationError) as caught:
        chosen("sensor=run_time", "grid.ship=duncan", "render.engine=lines", *overrides.split())
    assert str(caught.value).startswith(WRONG[overrides])


@pytest.mark.skipif("egl" not in available_engines(), reason="needs EGL")
def test_a_call_apart_is_the_call(monkeypatch):
    """In another process where this one has another OpenGL; errors come back, too."""
    monkeypatch.setattr(apart, "choose_engine", lambda name: "osmesa")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert apart.call_apart("lines", os.getpid) == os.getpid()
    other = apart.call_apart("egl", os.getpid)
    assert other == apart.call_apart("egl", os.getpid) != os.getpid()
    assert apart.call_apart("egl", os.getenv, "OMP_NUM_THREADS") == "1"
    with pytest.raises(ZeroDivisionError):
        apart.call_apart("egl", divmod, 1, 0)
    ship = ncti.ships.load("texas")
    look = Look(60.0, 3.84, 100e3, "egl", 0, 100e3, 150e-6, 1.0, 250.0)
    found = apart.call_apart("egl", Look.extent, look, ship, (2.0, 31.7, 0.5))
    cast = replace(look, engine="embree").extent(ship, (2.0, 31.7, 0.5))
    # Pixels at an outline may differ: a few of some hundred.
    assert relative_error(found.fraction.sum(axis=0), cast.fraction.sum(axis=0)) < 0.05
    with pytest.raises(EngineError, match="has ended"):
        apart.call_apart("egl", os._exit, 1)
    assert apart.call_apart("egl", os.getpid) != other
