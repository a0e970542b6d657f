"""Groups of a store, as xarray opens them, are plotted and written as NetCDF unconverted."""

import warnings

import matplotlib.pyplot as plt
import pytest
import xarray as xr
from commands import groups_of

import ncti


@pytest.fixture(scope="module")
def groups(smoke_store):
    """Return all groups of a store; a warning of a library that opens them is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return groups_of(smoke_store)


def test_every_group_is_plotted_along_every_axis(groups):
    axes, plotted = plt.figure().subplots(), set()
    for group, dataset in groups.items():
        for variable in dataset.data_vars.values():
            new = [dim for dim in variable.dims if (group, dim) not in plotted]
            for dim in new:
                if variable.dtype.kind == "U":  # texts are axes, not curves
                    continue
                variable.isel(
                    {dimension: 0 for dimension in variable.dims if dimension != dim}
                ).plot.line(x=dim, ax=axes)
                plotted.add((group, dim))
                axes.clear()
    plt.close(axes.figure)
    lacking = {(group, dim) for group, data in groups.items() for dim in data.dims} - plotted
    assert lacking == set()
    assert len(plotted) > 100


def test_every_group_and_the_root_are_written_as_netcdf(smoke_store, tmp_path):
    """scipy writes NetCDF 3, which has no unsigned or long integers, and no groups."""
    root = xr.open_zarr(smoke_store)
    for node in xr.open_datatree(smoke_store, engine="zarr").subtree:
        dataset, file = node.to_dataset(inherit=False), tmp_path / "group.nc"
        assert dataset.attrs["seed"] == root.seed == 0, node.path
        assert dataset.attrs["version"] == root.version == f"ncti-sweep {ncti.__version__}"
        dataset.to_netcdf(file, engine="scipy")
        with xr.open_dataset(file, engine="scipy") as copy:
            assert copy.attrs == dataset.attrs
            xr.testing.assert_equal(copy, dataset)
