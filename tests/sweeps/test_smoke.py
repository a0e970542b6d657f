"""The smoke sweep: what its users find in the store, on the screen and in the CSV files."""

import csv
import re

import numpy as np
import xarray as xr

from ncti.features import profile_vector
from ncti.ladar import noise_floor
from sweeps.axes import AXES
from sweeps.flight_variables import FLIGHT_GROUPS
from sweeps.variables import GROUPS


def test_store_opens_as_the_readme_says(smoke_store):
    profiles = xr.open_zarr(smoke_store, group="range_profile")
    assert profiles.averaged.dims == (
        "ship",
        "aspect",
        "pulse_width",
        "frame_count",
        "range",
        "down_range",
    )
    assert profiles.expected.dims == ("ship", "aspect", "pulse_width", "range", "down_range")
    assert profiles.ship.values.tolist() == ["duncan", "spruance"]
    assert profiles.aspect.values.tolist() == [0, 15, 30, 45, 60, 75, 90]
    assert profiles.down_range.size == 250
    assert profiles.down_range.values[[0, -1]].tolist() == [-124.5, 124.5]
    one = profiles.averaged.sel(ship="duncan", aspect=30, pulse_width=30, frame_count=16, range=100)
    assert one.shape == (250,)


def test_whole_tree_opens_at_once(smoke_store):
    tree = xr.open_datatree(smoke_store, engine="zarr")
    # All ships are learned, so there is nothing to reject.
    there = {
        f"/{group}"
        for group in GROUPS
        if not group.startswith("tables/rejection") and group not in FLIGHT_GROUPS
    }
    assert there <= set(tree.groups)


def test_every_variable_has_units_and_a_name(smoke_store):
    tree = xr.open_datatree(smoke_store, engine="zarr")
    checked = 0
    for node in tree.subtree:
        for name, variable in node.to_dataset().variables.items():
            assert variable.attrs["long_name"], name
            if variable.dtype.kind not in "OTU":  # words have no unit
                assert variable.attrs["units"], name
                checked += 1
    assert checked > 25
    coordinates = {name for node in tree.subtree for name in node.coords}
    assert set(AXES) <= coordinates


def test_root_says_what_made_it(smoke_store):
    attributes = xr.open_datatree(smoke_store, engine="zarr").attrs
    assert attributes["seed"] == 0
    assert attributes["configuration"]["grid"]["aspect"] == [0, 15, 30, 45, 60, 75, 90]
    assert attributes["configuration"]["render"]["engine"] in ("osmesa", "egl", "embree")
    assert set(attributes["mesh_digests"]) == {"duncan", "spruance"}
    assert attributes["versions"]["numpy"] == np.__version__
    text = str(attributes)
    assert str(smoke_store.parent) not in text
    assert not re.search(r"/home/|/root/|/tmp/", text)


def test_every_cell_is_done(smoke_store):
    status = xr.open_zarr(smoke_store, group="status")
    assert status.attrs == {}
    assert np.all(status.view == 1)
    assert np.all(status.cell == 1)
    assert set(status.cell.dims) == {
        "ship",
        "aspect",
        "pulse_width",
        "frame_count",
        "range",
        "vigilance",
    }


def test_profiles_are_what_a_physicist_expects(smoke_store):
    profiles = xr.open_zarr(smoke_store, group="range_profile").load()
    floor = noise_floor() * float(profiles.target_free_ifovs)
    # The ends of the window hold noise alone: the floor of the target-free IFOVs, and that of
    # the few (at most 60) IFOVs on the ship.
    edge = profiles.expected.isel(down_range=0)
    assert np.all((edge >= floor) & (edge <= floor + 60 * noise_floor()))
    # From the bow the return is as long as the ship, 135.6 and 171.7 m, less what the houses
    # hide and plus the tails of the pulse; from the beam it is a house and its masts deep.
    vectors = profile_vector(profiles.expected.sel(pulse_width=30, range=100))
    for row, length in zip(vectors, (135.6, 171.7), strict=True):
        bow_on, beam_on = (np.ptp(np.flatnonzero(row[i] > 0.01)) for i in (0, -1))
        assert 0.75 * length < bow_on < length + 10
        assert beam_on < 40
    # Averages scatter about the expected profile, less so the more frames they hold.
    scatter = (profiles.averaged - profiles.expected).std(("down_range", "ship", "aspect"))
    ratio = scatter.sel(frame_count=4) / scatter.sel(frame_count=16)
    assert np.all(np.abs(ratio - 2) < 0.25)  # sqrt(16 / 4), from some 3,500 bins


def test_longer_pulses_form_fewer_categories(smoke_store):
    tables = xr.open_zarr(smoke_store, group="tables/acn").load()
    formed = tables.category_count.sel(range=100, vigilance=0.95)
    assert np.all(np.diff(formed.sel(pulse_width=[10, 30, 50]).values) < 0)
    assert np.all(tables.settled == 1)


def test_tables_agree_with_the_answers_in_the_store(smoke_store):
    tables = xr.open_zarr(smoke_store, group="tables/acn").load()
    answers = xr.open_zarr(smoke_store, group="classification/acn").load()
    ship = xr.DataArray(np.arange(answers.sizes["ship"]), dims="ship")
    xr.testing.assert_equal(answers.correct == 1, answers.predicted == ship)
    overall = tables.accuracy.sel(aspect_bin="overall")
    xr.testing.assert_allclose(
        overall.drop_vars(["aspect_bin", "aspect_low"]),
        answers.correct.mean(("ship", "aspect")),
        atol=1e-12,
    )
    assert np.all(tables.ci_low <= tables.accuracy)
    assert np.all(tables.accuracy <= tables.ci_high)
    assert tables.n.sel(aspect_bin="overall").values.max() == 14


def test_tables_are_written_as_csv(smoke_store):
    folder = smoke_store.with_name("sweep-tables")
    with (folder / "categories.csv").open() as file:
        categories = list(csv.DictReader(file))
    with (folder / "accuracy.csv").open() as file:
        accuracy = list(csv.DictReader(file))
    assert len(categories) == 3 * 2
    assert {row["source_categories"] for row in categories if row["vigilance"] == "0.95"} == {
        "26",
        "18",
        "16",
    }
    # 4 bins (overall one of them) x (training + 2 frame counts) x 3 pulses x 2 vigilances
    assert len(accuracy) == 4 * 3 * 3 * 2
    for row in accuracy:
        assert 0 <= float(row["ci_low"]) <= float(row["percent_correct"])
        assert float(row["percent_correct"]) <= float(row["ci_high"]) <= 100
