"""A store in the hands of other libraries: as xarray opens it, without a word of conversion."""

import warnings

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from commands import FAST, groups_of, swept
from sklearn.ensemble import RandomForestClassifier

import ncti


@pytest.fixture(scope="module")
def groups(smoke_store):
    """All groups of a store; a warning of a library that opens them is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return groups_of(smoke_store)


def test_every_group_is_plotted_along_every_axis(groups):
    axes, seen = plt.figure().subplots(), set()
    for group, dataset in groups.items():
        for variable in dataset.data_vars.values():
            new = [dim for dim in variable.dims if (group, dim) not in seen]
            for dim in new:
                if variable.dtype.kind == "U":  # texts are plotted along, not plotted
                    continue
                variable.isel({other: 0 for other in variable.dims if other != dim}).plot.line(
                    x=dim, ax=axes
                )
                seen.add((group, dim))
                axes.clear()
    plt.close(axes.figure)
    lacking = {(group, dim) for group, one in groups.items() for dim in one.dims} - seen
    assert lacking == set()
    assert len(seen) > 100


def test_texts_are_those_of_numpy(groups):
    for group, dataset in groups.items():
        for name, variable in dataset.variables.items():
            assert variable.dtype.kind in "Ufiub", (group, name, variable.dtype)
    assert groups["ships"].ship.dtype == "<U8"  # spruance


def test_names_of_ships_are_classes_of_a_classifier(smoke_store):
    profiles = xr.open_zarr(smoke_store, group="range_profile")
    views = profiles.averaged.sel(pulse_width=30, range=100).stack(
        view=("ship", "aspect", "frame_count")
    )
    found, ships = views.transpose("view", ...), views.ship
    forest = RandomForestClassifier(10, random_state=0).fit(found, ships)
    assert forest.classes_.tolist() == ["duncan", "spruance"]
    assert forest.score(found, ships) > 0.9
    along_ship = profiles.ship[np.arange(6) % 2]
    assert forest.fit(np.eye(6), along_ship).classes_.tolist() == ["duncan", "spruance"]


def test_every_group_and_the_root_are_written_as_netcdf(smoke_store, tmp_path):
    """By scipy, with which xarray writes NetCDF 3: no unsigned or long integers, and no groups."""
    root = xr.open_zarr(smoke_store)
    for node in xr.open_datatree(smoke_store, engine="zarr").subtree:
        dataset, file = node.to_dataset(inherit=False), tmp_path / "group.nc"
        assert dataset.attrs["seed"] == root.seed == 0, node.path
        assert dataset.attrs["version"] == root.version == f"ncti-sweep {ncti.__version__}"
        dataset.to_netcdf(file, engine="scipy")
        with xr.open_dataset(file, engine="scipy") as read:
            assert read.attrs == dataset.attrs
            xr.testing.assert_equal(read, dataset)


def test_every_table_is_a_frame(groups):
    for group, dataset in groups.items():
        if group.startswith("tables/"):
            frame = dataset.to_dataframe()
            assert len(frame) and set(dataset.data_vars) <= set(frame.columns)


def test_training_and_test_views_are_marked(tmp_path):
    views = ("grid.ship=[duncan,horne,spruance]", "grid.aspect=[0,20,30,40,60]", "grid.fresh=1")
    taught = ("classifier.unknown=[horne]", "classifier.template_spacing=[null,20]")
    small = ("sensor=both", "grid.pulse_width=30", "grid.frame_count=2", "infrared.frame_count=2")
    swept(tmp_path / "s.zarr", tmp_path / "cache", *views, *taught, *small, *FAST)
    for group in ("range_profile", "infrared"):
        found = xr.open_zarr(tmp_path / "s.zarr", group=group)
        drawn = ~np.isin(found.aspect, [0, 20, 30, 40, 60])
        assert drawn.sum() == 2  # one in 30 degrees
        assert found.learned.dtype == found.known.dtype == bool
        assert found.learned.sel(template_spacing=np.nan).values.tolist() == (~drawn).tolist()
        every = found.sel(template_spacing=20, drop=True)
        assert every.sel(aspect=every.learned).aspect.values.tolist() == [0, 20, 40, 60]
        tests = every.sel(aspect=~every.learned)
        assert sorted({30, *found.aspect.values[drawn]}) == tests.aspect.values.tolist()
        assert found.ship.values[found.known].tolist() == ["duncan", "spruance"]


def test_every_view_of_a_grid_is_learned_unless_said_otherwise(groups):
    for name in ("range_profile", "infrared"):
        assert groups[name].learned.dims == ("aspect",) and groups[name].learned.all()
        assert groups[name].known.dims == ("ship",) and groups[name].known.all()
