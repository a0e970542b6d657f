"""Several jobs as one store, and a store that grows: with the numbers of a sweep of the whole."""

import numpy as np
import pytest
from commands import FAST, assert_slice, groups_of, opened, ran, swept
from small_stores import files

from sweeps.engine.store import read_attributes

TINY = (*FAST, "grid.frame_count=[2,4]")
GRID = ("grid.ship=[duncan,spruance]", "grid.aspect=[0,60]")
ALL = (*TINY, "classifier=all", "classifier.mnn.epochs=5")


def command(results, *arguments):
    assert ran(*arguments, *TINY, *GRID, f"cache={results}") == 0


def test_settings_that_run_together(folder, results):
    zipped = ("grid.pulse_width=[50,30]", "grid.zip=[[pulse_width,frame_count]]")
    swept(folder / "zip.zarr", results, *TINY, *GRID, *zipped)
    swept(folder / "crossed.zarr", results, *TINY, *GRID, zipped[0])
    together, crossed = groups_of(folder / "zip.zarr"), groups_of(folder / "crossed.zarr")
    profiles, tables = together["range_profile"], together["tables/acn"]
    dim = "pulse_width_frame_count"
    # As they were given, 50 ns with 2 frames, in ascending order.
    assert profiles.pulse_width.values.tolist() == [30, 50]
    assert profiles.frame_count.values.tolist() == [4, 2]
    assert profiles.frame_count.dims == (dim,) == tables.accuracy.dims[:1]
    assert profiles.pulse_width.attrs["units"] == "ns"
    for group, name in (("range_profile", "averaged"), ("tables/acn", "accuracy")):
        for place, at in enumerate(zip((30, 50), (4, 2), strict=True)):
            expected = crossed[group][name].sel(pulse_width=at[0], frame_count=at[1])
            found = together[group][name].isel({dim: place})
            np.testing.assert_array_equal(found.transpose(*expected.dims), expected)


def test_jobs_of_a_multirun_are_one_store(folder, results):
    receivers = ["ladar=full_profile,peak_pulse", "ladar.target_free_ifovs=0"]
    command(results, "-m", *receivers, "store=fused.zarr")
    command(
        *(results, "ladar.receiver=[full_profile,peak_pulse]", "ladar.target_free_ifovs=0"),
        "store=listed.zarr",
    )
    assert files(folder / "fused.zarr") == files(folder / "listed.zarr")
    assert opened(folder / "fused.zarr", "range_profile").receiver.dims == ("receiver",)


def test_what_a_choice_changes_together_is_one_dimension(folder, results):
    command(results, "-m", "ladar=peak_pulse,full_profile", "store=s.zarr")
    profiles = opened(folder / "s.zarr", "range_profile")
    assert profiles.ladar.values.tolist() == ["full_profile", "peak_pulse"]
    assert profiles.receiver.values.tolist() == ["full_profile", "peak_pulse"]
    assert profiles.target_free_ifovs.values.tolist() == [4000, 0]
    assert {"ladar"} == {*profiles.receiver.dims, *profiles.target_free_ifovs.dims}
    for name in ("full_profile", "peak_pulse"):
        command(results, f"ladar={name}", f"store={name}.zarr")
        assert assert_slice(folder / "s.zarr", folder / f"{name}.zarr", ladar=name) == {"ladar"}


def test_a_path_that_differs_is_a_store_each(folder, results):
    command(results, "-m", "ladar.cnr=26,32", "store=cnr-${ladar.cnr}.zarr")
    stores = sorted(path.name for path in folder.glob("*.zarr"))
    assert stores == ["cnr-26.zarr", "cnr-32.zarr"]
    for cnr in (26, 32):
        swept(folder / "own.zarr", results, *TINY, *GRID, f"ladar.cnr={cnr}")
        assert files(folder / f"cnr-{cnr}.zarr") == files(folder / "own.zarr")
        (folder / "own.zarr").rename(folder / f"own-{cnr}.zarr")
    one, other = (opened(folder / f"cnr-{cnr}.zarr", "range_profile").expected for cnr in (26, 32))
    assert (one != other).any()


WHOLE = ("grid.ship=[duncan,spruance]", "grid.aspect=[0,30,60]", "grid.pulse_width=[30,50]")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Store of a sweep with all classifiers of profiles."""
    folder = tmp_path_factory.mktemp("whole")
    swept(folder / "s.zarr", folder / "cache", *ALL, *WHOLE)
    return folder / "s.zarr"


def test_a_store_grows_by_what_is_new(whole, folder):
    """By a view in front and a longer pulse, after which it is that of the whole sweep."""
    store, cache = folder / "s.zarr", folder / "cache"
    before = ("grid.ship=[duncan,spruance]", "grid.aspect=[30,60]", "grid.pulse_width=30")
    first = swept(store, cache, *ALL, *before)
    grown = swept(store, cache, *ALL, *WHOLE)
    assert files(store) == files(whole)
    done = {name: (one.done, one.reused) for name, one in grown.progress.items()}
    # Of one place on the grid of IFOVs, what is tested is what is learned.
    assert done["seen_extent"] == (2, 4) and done["extent"] == (0, 4)
    assert done["expected"] == done["covariance"] == (2 * 3 * 2 - 4, 4)
    assert done["averaged"] == (2 * (2 * 3 * 2 - 4), 2 * 4)
    # Classifiers see all views, so all of their answers are new.
    for name in ("acn", "mnn", "correlation", "likelihood"):
        assert done[name] == (2 * 2, 0) and first.progress[name].done == 2
    again = swept(store, cache, *ALL, *WHOLE)
    assert not again.written and files(store) == files(whole)


def test_one_more_number_of_frames_answers_alone(whole, folder):
    """What does not look at the number of frames is not trained again."""
    store, cache = folder / "s.zarr", folder / "cache"
    swept(store, cache, *ALL, *WHOLE, "grid.frame_count=2")
    grown = swept(store, cache, *ALL, *WHOLE)
    assert files(store) == files(whole)
    done = {name: (one.done, one.reused) for name, one in grown.progress.items()}
    assert done["averaged"] == (12, 12) and done["expected"] == (0, 12)
    assert done["mnn_training"] == done["acn_training"] == (0, 2)
    for name in ("acn", "mnn", "correlation", "likelihood"):
        assert done[name] == (2, 2)


def test_the_order_in_which_values_are_given_does_not_matter(whole, folder):
    turned = ("grid.ship=[spruance,duncan]", "grid.aspect=[60,0,30]", "grid.pulse_width=[50,30]")
    named = "classifier.name=[mnn,likelihood,correlation,acn]"
    swept(folder / "s.zarr", folder / "cache", *ALL, *turned, "grid.frame_count=[4,2]", named)
    assert files(folder / "s.zarr") == files(whole)


def test_another_configuration_is_refused_by_its_keys(whole, folder, capsys):
    before = files(whole)
    arguments = (*ALL, *WHOLE, f"store={whole}", "cache=cache")
    assert ran(*arguments, "ladar.cnr=26", "grid.pulse_width=30") == 2
    told = capsys.readouterr().err
    assert "ladar.cnr is 26, but the store" in told or "grid.pulse_width is 30" in told
    assert "=[" in told and "to have both, or another store" in told
    assert files(whole) == before
    assert read_attributes(whole)["configuration"]["ladar"]["cnr"] == 32
