"""Small stores, and how to look into them."""

import warnings

import numpy as np
import xarray as xr

from sweeps.engine.zarr_array import Array, Group

SHAPE = (5, 7, 3)
CHUNKS = (2, 3, 3)
DIMS = ("ship", "aspect", "bin")
COUNTS = np.arange(105).reshape(SHAPE)


def array(values, fill=None, chunks=CHUNKS, read=None, **attrs):
    """An array of values, or of those that a function reads."""
    dims, read = DIMS[: values.ndim], read or values.__getitem__
    return Array(dims, values.shape, values.dtype, attrs, read, chunks, fill)


def coordinate(dims, values, **attrs):
    """A coordinate of values."""
    return Array.of(dims, values, attrs, coordinate=True)


def small(value):
    """Groups of a store whose every value tells which store it is of."""
    values = np.full((4, 6), value, dtype="f4")
    ships = coordinate(("ship",), np.array(["Ålesund", "b", "", "ddd"]), long_name="ship")
    x = array(values, fill=np.nan, chunks=(1, 6))
    return {name: Group({"x": x, "ship": ships}) for name in ("one", "two/three")}


def files(path):
    """Contents of all files below a folder, by relative name."""
    return {
        file.relative_to(path).as_posix(): file.read_bytes()
        for file in path.rglob("*")
        if file.is_file()
    }


def opened(path, group):
    """A group as its users open it; any warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return xr.open_zarr(path, group=group).load()
