"""Groups of a store, as xarray opens them, are written as NetCDF unconverted."""

import warnings

import xarray as xr

import ncti


def test_every_group_and_the_root_are_written_as_netcdf(smoke_store, tmp_path):
    """scipy writes NetCDF 3, which has no unsigned or long integers, and no groups."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        root = xr.open_zarr(smoke_store)
        tree = xr.open_datatree(smoke_store, engine="zarr")
    for node in tree.subtree:
        dataset, file = node.to_dataset(inherit=False), tmp_path / "group.nc"
        assert dataset.attrs["seed"] == root.seed == 0, node.path
        assert dataset.attrs["version"] == root.version == f"ncti-sweep {ncti.__version__}"
        dataset.to_netcdf(file, engine="scipy")
        with xr.open_dataset(file, engine="scipy") as copy:
            assert copy.attrs == dataset.attrs
            xr.testing.assert_equal(copy, dataset)
