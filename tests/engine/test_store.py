"""Stores return values bit for bit, open with zarr and xarray, and reveal damage."""

import errno
import json
import os
import warnings

import numpy as np
import pytest
import xarray as xr
import zarr
from small_stores import COUNTS, DIMS, SHAPE, array, coordinate, files, opened

from sweeps.engine.cache.packs import seal
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.objects import Objects
from sweeps.engine.run.cluster import InlineExecutor
from sweeps.engine.store.arrays import Array, ArrayGroup
from sweeps.engine.store.manifest import MANIFEST, verify
from sweeps.engine.store.tables import from_dataset, restore_scalars
from sweeps.engine.store.targets import check_store_path
from sweeps.engine.store.writing import read_attributes, write_store

DTYPES = ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f2", "f4", "f8"]
SIGNED = {"u1": "i2", "u2": "i4", "u4": "i8"}
"""Signed dtypes that hold all values of unsigned ones, which NetCDF 3 lacks."""


def same_bits(*arrays):
    return len({(array.dtype, array.shape, array.tobytes()) for array in arrays}) == 1


def test_round_trip_of_every_dtype(tmp_path):
    random_bits = np.random.default_rng(1)
    values = {}
    for name in DTYPES:
        itemsize = np.dtype(name).itemsize
        # Random bits may be infinities, NaN of all kinds, subnormal numbers or -0.0.
        values[name] = np.frombuffer(random_bits.bytes(105 * itemsize), name).reshape(SHAPE)
    values["big_endian"] = COUNTS.astype(">f8")
    values["bool"] = COUNTS % 3 == 0
    values["fixed_width"] = COUNTS.astype("U3")
    path = tmp_path / "s.zarr"
    arrays = {name: array(value) for name, value in values.items()}
    for name, dtype in (("wide", "U9"), ("objects", object), ("variable", np.dtypes.StringDType())):
        values[name] = values["fixed_width"].astype(dtype)
        arrays[name] = Array.from_values(DIMS, values[name])
    write_store(path, {"g": ArrayGroup(arrays)}, {})

    results = opened(path, "g")
    assert set(results) == set(values)
    for name, value in values.items():
        block = zarr.open_array(path / f"g/{name}", mode="r")[...]
        if value.dtype.kind in "OTU":
            # texts of a fixed width, that of the longest, which can be plotted and learned
            assert same_bits(block, results[name].values, value.astype(object).astype("U3"))
        else:
            native = value.astype(SIGNED.get(name, value.dtype.newbyteorder("=")))
            stored = native.astype("i1" if value.dtype.kind == "b" else native.dtype)
            assert same_bits(results[name].values, native), name
            assert same_bits(block, stored), name


SCALARS = {
    "text": "{a: 1}",
    "truth": np.True_,
    "falsehood": np.False_,
    "whole": -(2**63),
    "beyond": np.uint64(2**64 - 1),
    "float": 0.1,
    "missing": np.nan,
    "endless": -np.inf,
}


def test_scalar_coordinates_round_trip(tmp_path):
    """They are stored as JSON attributes; values that these cannot hold are stored as arrays."""
    arrays = {name: coordinate((), np.array(value)) for name, value in SCALARS.items()}
    attrs = {"whole": SCALARS["whole"], "text": "another"}
    write_store(tmp_path / "s.zarr", {"g": ArrayGroup({"x": array(COUNTS), **arrays}, attrs)}, {})
    text = (tmp_path / "s.zarr/g/zarr.json").read_text()
    raw = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    attributes = raw["attributes"]
    assert {"beyond", "endless"}.isdisjoint(attributes) and attributes["float"] == 0.1
    stored = {"x", "beyond", "endless", "text"}
    assert {path.name for path in (tmp_path / "s.zarr/g").iterdir() if path.is_dir()} == stored
    results = restore_scalars(opened(tmp_path / "s.zarr", "g"))
    assert results.attrs == attrs
    for name, value in SCALARS.items():
        assert same_bits(results[name].values, np.array(value)), name


CONSTANT = {
    "scalar": np.array(complex(np.nan, 1.0)),
    "count": np.full((2, 3), 7),
    "text": np.full((2, 3), "ab"),
    "truth": np.full((2, 3), True),
    "negative_zero": np.full((2, 3), -0.0),
    "float": np.full((2, 3), 0.1, "f4"),
}


def test_constant_arrays_have_no_chunks(tmp_path):
    """If all values are equal, they are the fill value; an array with another value has chunks."""
    path = tmp_path / "s.zarr"
    for last in (False, True):
        values = {name: value.copy() for name, value in CONSTANT.items()}
        if last:
            values["count"][1, 2], values["negative_zero"][1, 2] = 8, 0.0
        arrays = {
            name: Array.from_values(DIMS[: value.ndim], value) for name, value in values.items()
        }
        write_store(path, {"g": ArrayGroup(arrays)}, {})
        results = opened(path, "g")
        for name, value in values.items():
            assert same_bits(results[name].values, value), name
        chunks = {name.split("/")[1] for name in files(path) if name.count("/") == 2}
        chunks -= {name for name in arrays if not any((path / "g" / name).glob("*[0-9]"))}
        assert chunks == ({"count", "negative_zero"} if last else set())


def test_tree_opens_with_coordinates_and_tables(tmp_path):
    path = tmp_path / "s.zarr"
    rule = coordinate((), np.array("otsu"))
    dimension = coordinate(("other",), np.arange(2.0))
    table = xr.Dataset(
        {"p": ("ship", [0.5, np.nan]), "n": ("ship", [3, 0], {"units": "1"})},
        coords={"ship": ["a", "b"], "range": ("ship", [1.0, 2.0])},
        attrs={"title": "table", "level": np.float32(0.5)},
    )
    groups = {
        "classification/acn": ArrayGroup({"x": array(COUNTS), "rule": rule, "alone": dimension}),
        "top": ArrayGroup({"x": array(COUNTS)}),
        "classification": ArrayGroup({}, attrs={"title": "all"}),
        "tables/accuracy": from_dataset(table),
        "classification/late": from_dataset(table),  # not after its parent's other groups
    }
    write_store(path, groups, {"seed": 3, "list": [1, None]})
    assert read_attributes(path) == {"seed": 3, "list": [1, None]}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tree = xr.open_datatree(path, engine="zarr")
        names = {*groups, "tables"}
        assert {node.path for node in tree.subtree} == {"/", *(f"/{name}" for name in names)}
        for name in names:
            read = xr.open_zarr(path, group=name, consolidated=True).load()
            xr.testing.assert_identical(tree[name].to_dataset(inherit=False).load(), read)
    assert tree.attrs == {"seed": 3, "list": "[1, null]"}
    assert tree["classification"].attrs == {"title": "all"}
    acn = tree["classification/acn"].to_dataset()
    assert set(acn.coords) == {"alone"} and acn.attrs["rule"] == "otsu"
    restored = restore_scalars(acn)
    assert set(restored.coords) == {"rule", "alone"} and restored.attrs == {}
    results = opened(path, "classification/late")
    assert results["ship"].values.tolist() == ["a", "b"]
    xr.testing.assert_identical(results.drop_vars("ship"), table.drop_vars("ship"))


UNFIT = {
    "datetime64[s]": np.zeros(SHAPE),
    "O": COUNTS,  # objects that are not texts
    "U": COUNTS.astype(str),  # a dtype without a width
}


@pytest.mark.parametrize("dtype", UNFIT)
def test_values_that_do_not_match_the_dtype_are_refused(tmp_path, dtype):
    refused = Array(DIMS, SHAPE, np.dtype(dtype), {}, lambda region: UNFIT[dtype], SHAPE)
    with pytest.raises(TypeError):
        write_store(tmp_path / "s.zarr", {"g": ArrayGroup({"x": refused})}, {})
    assert not list(tmp_path.iterdir())


# damage -------------------------------------------------------------------------------------------


def test_missing_extra_or_resized_files_are_detected(tmp_path):
    path = tmp_path / "s.zarr"
    write_store(path, {"g": ArrayGroup({"x": array(np.arange(3, dtype="i2"), chunks=(2,))})}, {})
    for name, content in files(path).items():
        file = path / name
        for damaged in (content[:-1], content + b"\0", None):
            file.unlink()
            if damaged is not None:
                file.write_bytes(damaged)
            if name == MANIFEST:
                with pytest.raises(ConfigurationError, match=MANIFEST):
                    verify(path)
            else:
                assert verify(path) == [name]
            if name == "zarr.json":
                with pytest.raises(ConfigurationError, match=r"whose zarr\.json cannot be read"):
                    read_attributes(path)
        file.write_bytes(content)
    assert verify(path) == []
    (path / "g/x/c.7").write_bytes(b"")
    assert verify(path) == ["g/x/c.7"]


def test_changed_chunk_bytes_never_yield_wrong_values(tmp_path):
    """The chunk's checksum reveals the change; a reserved bit may leave the values unchanged."""
    path = tmp_path / "s.zarr"
    values = np.random.default_rng(1).integers(0, 2**15, 40).astype("i2")
    write_store(path, {"g": ArrayGroup({"x": array(values, chunks=values.shape)})}, {})
    (name,) = (name for name in files(path) if name.startswith("g/x/c"))
    content, noticed = files(path)[name], 0
    for place, byte in enumerate(content):
        flipped = byte ^ 1 << place % 8
        (path / name).write_bytes(content[:place] + bytes([flipped]) + content[place + 1 :])
        try:
            read = xr.open_zarr(path, group="g")["x"].values
        except Exception:
            noticed += 1
        else:
            np.testing.assert_array_equal(read, values)
    assert noticed > 0.9 * len(content)


def test_too_many_open_files_is_not_reported_as_damage(tmp_path, monkeypatch):
    path = tmp_path / "s.zarr"
    write_store(path, {"g": ArrayGroup({"x": array(COUNTS)})}, {})

    def refused(objects, name):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr(Objects, "get_versioned", refused)
    for read in (verify, read_attributes, check_store_path):
        with pytest.raises(OSError, match="Too many open files"):
            read(path)


FOREIGN = [b"", b"{}", b"[" * 10**5, b"\xff", seal(None), seal([]), seal({"a": None})]


@pytest.mark.parametrize("content", FOREIGN)
def test_invalid_manifest_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "s.zarr"
    assert read_attributes(path) is None
    path.mkdir()
    (path / MANIFEST).write_bytes(content)
    for function in (verify, read_attributes, check_store_path):
        with pytest.raises(ConfigurationError, match=r"^store is '.*s.zarr', whose [^\n]*$"):
            function(path)
    assert files(path) == {MANIFEST: content}


class Failing(InlineExecutor):
    """Executor that raises OSError for its first answers, and then works."""

    lost = 0

    def wait(self):
        answers = super().wait()
        if not self.lost:
            self.lost = 1
            raise OSError("lost")
        return answers


def test_nothing_is_written_after_a_rollback(tmp_path):
    """A write that fails waits for running tasks before it undoes its changes."""
    values, writers = np.arange(1.0, 9.0), Failing()

    def remote_read(region):
        return values.__getitem__

    read = values.__getitem__
    chunked = Array(("x",), (8,), values.dtype, {}, read, (1,), remote_read=remote_read)
    with pytest.raises(OSError, match="lost"):
        write_store(tmp_path / "s.zarr", {"g": ArrayGroup({"x": chunked})}, {}, writers=writers)
    assert writers.lost and writers.wait() == []
    assert files(tmp_path) == {}
