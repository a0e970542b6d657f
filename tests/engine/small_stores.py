"""Helpers that make small stores and read their content."""

import errno
import itertools
import json
import math
import os
import warnings
from contextlib import contextmanager

import numpy as np
import pytest
import xarray as xr

from sweeps.engine.objects import Objects
from sweeps.engine.store.arrays import Array, ArrayGroup
from sweeps.engine.store.manifest import verify
from sweeps.engine.store.writing import zarr_store

SHAPE = (5, 7, 3)
CHUNKS = (2, 3, 3)
DIMS = ("ship", "aspect", "bin")
COUNTS = np.arange(105).reshape(SHAPE)


def array(values, fill=None, chunks=CHUNKS, read=None, **attrs):
    """Return an array of values, which `read` returns by region if it is given."""
    dims, read = DIMS[: values.ndim], read or values.__getitem__
    return Array(dims, values.shape, values.dtype, attrs, read, chunks, fill)


def coordinate(dims, values, **attrs):
    """Return a coordinate with these values."""
    return Array.from_values(dims, values, attrs, coordinate=True)


def below(place, name):
    """Return the path or URL of a name in a place."""
    return f"{place}/{name}" if isinstance(place, str) else place / name


def small(value):
    """Return groups of a store in which every value of x is `value`."""
    values = np.full((4, 6), value, dtype="f4")
    ships = coordinate(("ship",), np.array(["Ålesund", "b", "", "ddd"]), long_name="ship")
    x = array(values, fill=np.nan, chunks=(1, 6))
    return {name: ArrayGroup({"x": x, "ship": ships}) for name in ("one", "two/three")}


def files(path):
    """Return the contents of all files below a folder or URL, by relative name."""
    if isinstance(path, str):
        there = Objects(path)
        return {name: there.get(name) for name in there.sizes()}
    return {
        file.relative_to(path).as_posix(): file.read_bytes()
        for file in path.rglob("*")
        if file.is_file()
    }


def contents(path):
    """Return the metadata of all nodes of a store, and each chunk by array and index.

    Equal stores may differ in the names of their chunk files. Also assert that the store is
    undamaged and that its consolidated metadata agree with those of each node.
    """
    assert verify(path) == []
    there = files(path)
    root = json.loads(there["zarr.json"])
    tree = {"": root["attributes"]}
    for name, node in root["consolidated_metadata"]["metadata"].items():
        document = json.loads(there[f"{name}/zarr.json"])
        if node["node_type"] == "group":
            below = document["consolidated_metadata"]["metadata"]
            assert below == {
                inner.removeprefix(f"{name}/"): node
                for inner, node in root["consolidated_metadata"]["metadata"].items()
                if inner.startswith(f"{name}/")
            }
            tree[name] = document["attributes"]
            continue
        assert document == node
        encoding = document.pop("chunk_key_encoding")
        separator = encoding["configuration"]["separator"]
        begin = f"c{separator}" if encoding["name"] == "default" else ""
        tree[name], shape = document, document["chunk_grid"]["configuration"]["chunk_shape"]
        counts = map(math.ceil, np.divide(document["shape"], shape))
        for index in itertools.product(*map(range, counts)) if document["shape"] else ():
            chunk = begin + separator.join(map(str, index))
            tree[name, index] = there.get(f"{name}/{chunk}")
    return tree


class Killed(BaseException):
    """Exception that no writer catches."""


def full():
    """Return the error of a disk that is full."""
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "there")


@contextmanager
def ending_after(number, methods=("put", "_delete"), raised=Killed):
    """Let calls of some methods of `Objects` succeed, and later ones raise an exception."""
    calls = itertools.count(1)

    def counted(method):
        def call(*arguments):
            if next(calls) > number:
                raise raised()
            return method(*arguments)

        return call

    with pytest.MonkeyPatch.context() as patch:
        for name in methods:
            patch.setattr(Objects, name, counted(getattr(Objects, name)))
        yield


def opened(path, group):
    """Open and load a group as users do, with warnings as errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        place = zarr_store(path) if isinstance(path, str) else path
        return xr.open_zarr(place, group=group).load()
