"""Profile and silhouette together: at least as good as the better of them, wherever one looks."""

import io

import numpy as np
import pytest
import xarray as xr
from rich.console import Console
from scipy import stats
from sweeping import command

from sweeps.axes import OF_SILHOUETTES
from sweeps.fusion import CHANNELS
from sweeps.report.fusion import AXES, fusion_rows, print_fusion


@pytest.fixture(scope="module")
def store(tmp_path_factory, cache):
    folder = tmp_path_factory.mktemp("fusion")
    (folder / "cache").mkdir()
    (cache / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "cache" / "meshes").symlink_to(cache / "meshes", target_is_directory=True)
    run = command(
        "+experiment=fusion",
        "grid.range=[50,100]",
        "grid.frame_count=[4,16]",
        "grid.aspect={start: 0, stop: 90, step: 6}",
        "grid.replicate=2",
        "classifier.gain_sigma=[1,0]",
        "infrared.frame_count=16",
        "infrared.phases=3",
        "infrared.super_resolution=[none,perfect]",
        "render.pixel=0.5",
        "store=s.zarr",
        folder=folder,
        cache=folder / "cache",
    )
    assert run.returncode == 0, run.stderr
    assert "both" in run.stdout and "Kish" in run.stdout
    return folder / "s.zarr"


def test_both_are_at_least_as_good_as_the_better_one(store):
    """In every bin, at every range, number of frames and resolution, within the interval."""
    tables = xr.open_zarr(store, group="tables/fusion").load()
    assert tables.accuracy.size == 3 * 2 * 2 * 2 * 2 * 4
    better = tables.accuracy.sel(channel=["range", "infrared"]).max("channel")
    assert (tables.ci_high.sel(channel="both") >= better).all()


def gain_over(correct, other):
    """(mean, standard error) of the share right by both sensors less that of other answers.

    Differences are paired and averaged over all that a view has in common, draws, ranges,
    numbers of frames and resolutions; the error is from their scatter over views.
    """
    paired = correct.sel(channel="both") - other
    of_view = paired.mean([name for name in paired.dims if name not in ("ship", "aspect")])
    return float(of_view.mean()), float(of_view.std(ddof=1)) / np.sqrt(of_view.size)


def test_both_lose_nothing_to_the_better_one_on_the_whole(store):
    """One-sided t at a level of 1e-3 over 64 views, each answered in 16 cells by 3 draws.

    The better sensor of a cell is the one with more right answers in it: where they are alike,
    choosing it by the same answers counts against both. The standard error is 0.6 points, the
    bound so some 2 points of loss; to heed the worse sensor alone costs many times that.
    """
    correct = xr.open_zarr(store, group="classification/fusion").load().correct.astype(float)
    alone = correct.sel(channel=["range", "infrared"])
    share = alone.mean(["draw", "ship", "aspect"])
    better, worse = (
        alone.isel(channel=choice) for choice in (share.argmax("channel"), share.argmin("channel"))
    )
    bound = stats.t.isf(1e-3, 64 - 1)
    assert correct.ship.size * correct.aspect.size == 64
    gain, error = gain_over(correct, better)
    assert gain >= -bound * error
    # The same statistic tells the worse sensor from the better one.
    heeding_it = correct.copy()
    heeding_it.loc[{"channel": "both"}] = worse.drop_vars("channel")
    loss, error = gain_over(heeding_it, better)
    assert loss < -bound * error


def test_at_50_km_and_16_frames_nearly_every_ship_is_named(store):
    tables = xr.open_zarr(store, group="tables/fusion").load()
    both = tables.accuracy.sel(channel="both", range=50, frame_count=16, aspect_bin="overall")
    assert (both > 0.95).all()


def test_draws_pair_replicates_with_phases(store):
    answers = xr.open_zarr(store, group="classification/fusion").load()
    assert answers.sizes["draw"] == 3
    alone = answers.predicted.sel(channel="range")
    # Profiles of draw 2 are those of draw 0 over again, whatever silhouettes go with them.
    np.testing.assert_array_equal(alone.isel(draw=0), alone.isel(draw=2))
    assert (alone == alone.isel(super_resolution=0)).all()
    seen = answers.predicted.sel(channel="infrared")
    assert (seen == seen.isel(frame_count=0)).all()
    # A silhouette of 15 m pixels tells little, a good profile much.
    weight = answers.sharpness.sel(channel=["range", "infrared"])
    assert np.isfinite(weight).all()
    assert np.isnan(answers.sharpness.sel(channel="both")).all()


def test_channels_are_the_store_s(store):
    answers = xr.open_zarr(store, group="classification/fusion")
    assert tuple(answers.channel.values) == CHANNELS


def test_what_the_gain_is_known_to_is_an_axis(store):
    """Not the first of a list; silhouettes have no gain. How they were made is told."""
    answers = xr.open_zarr(store, group="classification/fusion").load()
    assert answers.gain_sigma.values.tolist() == [1, 0]
    assert answers.correct.dims.index("gain_sigma") == answers.correct.dims.index("channel") + 1
    alone = answers.predicted.sel(channel="infrared")
    assert (alone.sel(gain_sigma=0) == alone.sel(gain_sigma=1)).all()
    by_profile = answers.predicted.sel(channel="range")
    assert (by_profile.sel(gain_sigma=0) != by_profile.sel(gain_sigma=1)).any()
    tables = xr.open_zarr(store, group="tables/fusion").load()
    rows = fusion_rows(tables)
    assert len(rows) == tables.accuracy.size
    for row in rows:
        place = {
            "range": row["range_km"],
            "aspect_bin": row["aspect_bin_deg"],
            "pulse_width": row["pulse_width_ns"],
            "gain_sigma": row["gain_sigma"],
            **{name: row[name] for name in AXES[AXES.index("super_resolution") :]},
        }
        stored = 100 * float(tables.accuracy.sel(place))
        assert row["percent_correct"] == pytest.approx(stored, abs=0.0501)
        ways = [row[name] for name in OF_SILHOUETTES]
        assert ways == [0.25, "matched", 0.5, "nearest"]
    screen = io.StringIO()
    print_fusion(rows, Console(file=screen))
    printed = screen.getvalue()
    assert printed.count("gain known") == printed.count("gain unknown by 100%") == 1
