"""Stores read back bit for bit, laid out as zarr itself would, whose damage is noticed."""

import json
import tracemalloc
import warnings

import numpy as np
import pytest
import xarray as xr
import zarr
from hypothesis import given
from hypothesis import strategies as st
from small_stores import CHUNKS, COUNTS, DIMS, SHAPE, array, files, opened, small
from zarr.codecs import ZstdCodec
from zarr.errors import UnstableSpecificationWarning

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.folders import MANIFEST, check_target, verify
from sweeps.engine.store import read_attributes, write_store
from sweeps.engine.tables import dataset_of, group_of
from sweeps.engine.zarr_array import CHUNK_BYTES, LEVEL, Array, Group, metadata, suggest_chunks

DTYPES = [
    *("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float16", "float32", "float64"),
]


SIGNED = {"uint8": "int16", "uint16": "int32", "uint32": "int64"}
"""Of unsigned integers, which NetCDF 3 has not: those that hold all of their values."""


def raw(path, name):
    """Values as they are stored."""
    return zarr.open_array(path / name, mode="r")[...]


def same_bits(one, other):
    return (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())


def test_round_trip_of_every_dtype(tmp_path):
    random_bits = np.random.default_rng(1)
    values = {}
    for name in DTYPES:
        itemsize = np.dtype(name).itemsize
        # Any bits: infinities, NaN of all kinds, subnormal numbers, -0.0.
        values[name] = np.frombuffer(random_bits.bytes(105 * itemsize), name).reshape(SHAPE)
    values["big_endian"] = COUNTS.astype(">f8")
    values["bool"] = COUNTS % 3 == 0
    values["fixed_width"] = COUNTS.astype("U3")
    values["objects"] = COUNTS.astype("U3").astype(object)
    values["variable_width"] = COUNTS.astype("U3").astype(np.dtypes.StringDType())
    path = tmp_path / "s.zarr"
    write_store(path, {"g": Group({k: array(v) for k, v in values.items()})}, {}, threads=2)

    found = opened(path, "g")
    assert set(found) == set(values)
    for name, value in values.items():
        block = raw(path, f"g/{name}")
        if value.dtype.kind in "OTU":
            # numpy's own texts, which can be plotted and learned, as wide as the longest
            assert same_bits(found[name].values, value.astype(object).astype("U3"))
            assert same_bits(block, found[name].values)
        else:
            native = value.astype(SIGNED.get(name, value.dtype.newbyteorder("=")))
            stored = native.astype("i1" if value.dtype.kind == "b" else native.dtype)
            assert same_bits(found[name].values, native), name
            assert same_bits(block, stored), name


FILLS = [
    *((dtype, fill) for dtype in ("f2", "f4", "f8") for fill in (None, -1, 0.1, np.inf, -np.inf)),
    *((dtype, fill) for dtype in ("i1", "i8", "u8") for fill in (None, 1)),
    *((dtype, -1) for dtype in ("i1", "i8")),
    ("U1", None),
    ("U300", "none"),
]


@pytest.mark.parametrize(("dtype", "fill"), FILLS)
def test_metadata_are_those_of_zarr(dtype, fill):
    none = {"f": np.nan, "U": ""}.get(np.dtype(dtype).kind, 0)
    warnings.simplefilter("ignore", UnstableSpecificationWarning)  # of texts of a fixed width
    by_zarr = zarr.create_array(
        zarr.storage.MemoryStore(),
        shape=SHAPE,
        chunks=CHUNKS,
        chunk_key_encoding={"name": "default", "separator": "."},
        dtype=dtype,
        fill_value=none if fill is None else fill,
        compressors=ZstdCodec(level=LEVEL, checksum=True),
        dimension_names=DIMS,
        attributes={"units": "m"},
    )
    ours = metadata(
        Array(DIMS, SHAPE, np.dtype(dtype), fill, {"units": "m"}, CHUNKS, lambda region: None)
    )
    buffer = by_zarr.metadata.to_buffer_dict(zarr.core.buffer.default_buffer_prototype())
    assert ours == json.loads(buffer["zarr.json"].to_bytes())


def test_chunks_of_nothing_but_the_fill_value_are_no_files(tmp_path):
    values = np.full((4, 3), -1, dtype="i2")
    values[1, 2] = 5
    zeros = np.zeros((4, 3))
    zeros[2] = -0.0
    path = tmp_path / "s.zarr"
    arrays = {
        "answer": array(values, fill=-1, chunks=(1, 3)),
        "zero": array(zeros, fill=0, chunks=(1, 3)),
        "names": array(np.full((4, 3), ""), chunks=(1, 3)),
        "none": Array.of((), np.array("")),
        "scaled": array(values, chunks=(4, 3), scale_factor=0.5),
    }
    write_store(path, {"g": Group(arrays)}, {})
    chunks = {name for name in files(path) if "/c." in name}
    assert chunks == {"g/answer/c.1.0", "g/zero/c.2.0", "g/scaled/c.0.0"}
    found = opened(path, "g")
    assert same_bits(found["answer"].values, values)  # no -1 became NaN
    assert same_bits(found["zero"].values, zeros)
    assert (found["names"] == "").all() and found["none"] == ""
    np.testing.assert_array_equal(found["scaled"], values * 0.5)
    assert same_bits(raw(path, "g/answer"), values)


def test_tree_opens_with_coordinates_and_tables(tmp_path):
    path = tmp_path / "s.zarr"
    rule = Array.of((), np.array("otsu"))
    alone = Array.of(("other",), np.arange(2.0))
    groups = {
        "classification/acn": Group({"x": array(COUNTS)}, {"rule": rule, "alone": alone}),
        "top": Group({"x": array(COUNTS)}),
        "classification": Group({}, attrs={"title": "all"}),
        "classification/mnn": Group({"x": array(COUNTS + 1)}),
    }
    table = xr.Dataset(
        {"p": ("ship", [0.5, np.nan]), "n": ("ship", [3, 0], {"units": "1"})},
        coords={"ship": ["a", "b"], "range": ("ship", [1.0, 2.0])},
        attrs={"title": "table", "level": np.float32(0.5)},
    )

    # Names for which siblings are not written one after the other.
    late = ("tables/accuracy", "classification/late", "tables/more")
    groups |= {name: group_of(table) for name in late}
    write_store(path, groups, {"seed": 3, "list": [1, None]})
    assert read_attributes(path) == {"seed": 3, "list": [1, None]}
    assert verify(path) == []
    names = {*groups, "tables"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tree = xr.open_datatree(path, engine="zarr")
        assert {node.path for node in tree.subtree} == {"/", *(f"/{name}" for name in names)}
        for name in names:
            read = xr.open_zarr(path, group=name, consolidated=True).load()
            xr.testing.assert_identical(tree[name].to_dataset(inherit=False).load(), read)
    assert tree.attrs == {"seed": 3, "list": "[1, null]"}
    assert tree["classification"].attrs == {"title": "all"}
    assert set(tree["classification/acn"].coords) == {"rule", "alone"}
    assert tree["classification/acn"].attrs == {}
    np.testing.assert_array_equal(tree["classification/mnn"]["x"], COUNTS + 1)
    for name in late:
        found = opened(path, name)
        assert found["ship"].values.tolist() == ["a", "b"]
        xr.testing.assert_identical(found.drop_vars("ship"), table.drop_vars("ship"))


ODD = {
    "mapping": {"a": {"b": [1, None]}, "c": True},
    "flag": True,
    "null": None,
    "nothing": [],
    "words": ["a", "b"],
    "mixed": [1, "a"],
    "deep": [[1, 2], [3, 4]],
    "pair": (1, "ü"),
    "of_numpy": {"x": np.float32(0.5), "y": np.arange(2)},
    "huge": 2**70,
}
PLAIN = {"text": "[no list", "count": 3, "share": 0.5, "values": [1, 2.5], "bits": np.arange(3)}


def test_attributes_are_plain(tmp_path):
    """Texts, numbers and lists of numbers, so that any format takes them; others are JSON text."""
    path = tmp_path / "s.zarr"
    root = ODD | PLAIN | {"version": "1", "seed": [0, 1]}
    inner = Array.of((), 3.0, {"units": "m"} | ODD)
    groups = {"a/b": Group({"x": inner}, attrs=ODD | {"seed": 5})}
    write_store(path, groups, root, everywhere=("version", "seed"))
    tree = xr.open_datatree(path, engine="zarr")
    all_of = (tree.attrs, tree["a/b"].attrs, tree["a/b"].x.attrs)
    for found in all_of:
        assert {name: json.loads(found[name]) for name in ODD} == {
            **{name: json.loads(json.dumps(ODD[name])) for name in ODD if name != "of_numpy"},
            "of_numpy": {"x": 0.5, "y": [0, 1]},
        }
    assert {name: tree.attrs[name] for name in PLAIN} == PLAIN | {"bits": [0, 1, 2]}
    assert tree["a"].attrs == {"version": "1", "seed": [0, 1]}  # which has no variables
    assert (tree["a/b"].attrs["version"], tree["a/b"].attrs["seed"]) == ("1", 5)
    read = read_attributes(path)
    assert {name: read[name] for name in ("mapping", "nothing", "deep", "words", "text")} == {
        **{name: ODD[name] for name in ("mapping", "nothing", "deep", "words")},
        "text": "[no list",
    }
    for node in tree.subtree:
        node.to_dataset().to_netcdf(tmp_path / "s.nc", engine="scipy")


def test_an_attribute_that_has_no_text_is_refused(tmp_path):
    with pytest.raises(TypeError, match="cannot be an attribute"):
        write_store(tmp_path / "s.zarr", {}, {"what": [object()]})


def test_tables_see_groups_as_xarray_opens_them_once_they_are_written(tmp_path):
    random_bits, values = np.random.default_rng(2), {}
    for name in DTYPES:
        itemsize = np.dtype(name).itemsize
        values[name] = np.frombuffer(random_bits.bytes(105 * itemsize), name).reshape(SHAPE)
    values |= {"big_endian": COUNTS.astype(">f8"), "bool": COUNTS % 3 == 0}
    values["objects"] = COUNTS.astype("U3").astype(object)
    arrays = {name: array(value) for name, value in values.items()}
    arrays["scaled"] = array(COUNTS.astype("u1"), scale_factor=1 / 255, units="1")
    asked = []

    def read(region):
        asked.append(region)
        return (
            COUNTS.astype("i2").transpose(1, 0, 2)[region[1], region[0], region[2]].swapaxes(0, 1)
        )

    arrays["read"] = array(COUNTS.astype("i2"), read=read)
    arrays["unused"] = array(COUNTS, read=lambda region: pytest.fail("nobody uses it"))
    scalar = Array.of((), 3.0, {"units": "km"})
    labels = {"ship": Array.of(("ship",), np.array(list("abcde"))), "range": scalar}
    group = Group(arrays, labels, {"title": "all"})

    seen = dataset_of(group).drop_vars("unused")
    part = seen["read"].isel(aspect=[1, 3]).values
    assert len(asked) == 1 and (part == COUNTS[:, [1, 3]]).all()
    seen.load()
    assert len(asked) == 1  # once, whatever is used of it, and how often
    del arrays["unused"]
    path = tmp_path / "s.zarr"
    write_store(path, {"g": group}, {})
    assert len(asked) == 1  # not for writing, either
    found = opened(path, "g")
    xr.testing.assert_identical(seen, found)
    assert list(seen.variables) == list(found.variables)
    for name, variable in found.variables.items():
        one, other = seen[name], variable
        assert one.dtype == other.dtype
        assert same_bits(one.values, other.values)
        assert one.values.strides == other.values.strides  # sums take the same order


def test_consolidated_metadata_are_those_of_zarr(tmp_path):
    path = tmp_path / "s.zarr"
    write_store(path, small(1), {"seed": 1})
    ours = {name: json.loads(text) for name, text in files(path).items() if "zarr.json" in name}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for group in ("two/three", "two", "one", None):
            zarr.consolidate_metadata(path, path=group)
    for name, document in ours.items():
        assert json.loads((path / name).read_text()) == document, name


@pytest.mark.parametrize(
    ("values", "dtype", "error"),
    [
        (np.zeros((5, 7, 2)), "f8", ValueError),  # another shape
        (np.zeros(SHAPE), "datetime64[s]", TypeError),
        (COUNTS, "O", TypeError),  # no texts
        (COUNTS.astype(str), "U", TypeError),  # of no width
    ],
)
def test_values_that_do_not_fit_are_refused(tmp_path, values, dtype, error):
    refused = Array(DIMS, SHAPE, np.dtype(dtype), None, {}, SHAPE, lambda region: values)
    with pytest.raises(error):
        write_store(tmp_path / "s.zarr", {"g": Group({"x": refused})}, {})
    assert not list(tmp_path.iterdir())


def test_equal_input_makes_equal_bytes(tmp_path):
    for name, threads in (("one.zarr", 3), ("two.zarr", 1)):
        write_store(tmp_path / name, small(1), {"seed": 1}, threads=threads)
    assert files(tmp_path / "one.zarr") == files(tmp_path / "two.zarr")


@given(
    st.lists(st.integers(0, 2000), max_size=5).map(tuple),
    st.sampled_from([1, 2, 4, 8]),
    st.integers(0, 5),
)
def test_suggested_chunks(shape, itemsize, whole):
    chunks = suggest_chunks(shape, itemsize, whole=whole)
    full = tuple(max(size, 1) for size in shape)
    own = len(shape) - min(whole, len(shape))
    assert len(chunks) == len(shape)
    assert chunks[own:] == full[own:]
    cut = [k for k in range(own) if chunks[k] != full[k]]
    if cut:  # 1 before the last axis that is cut, and whole after it
        assert all(chunks[k] == 1 for k in range(cut[-1]))
    size = itemsize * int(np.prod(chunks))
    assert size <= max(CHUNK_BYTES, itemsize * int(np.prod(full[own:])))
    if cut and full[cut[-1]] >= 2 * chunks[cut[-1]]:  # near the target: not half as large
        assert 2 * size + size // chunks[cut[-1]] >= CHUNK_BYTES - size


def test_memory_holds_a_few_chunks_only(tmp_path):
    asked = []

    def read(region):
        asked.append(region)
        return np.full((1, 2**17), region[0].start, dtype="f8")  # 1 MiB

    large = Array(("a", "b"), (96, 2**17), np.dtype("f8"), np.nan, {}, (1, 2**17), read)
    tracemalloc.start()
    write_store(tmp_path / "s.zarr", {"g": Group({"x": large})}, {}, threads=2)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(asked) == 96
    assert peak < 16 * 2**20
    assert (raw(tmp_path / "s.zarr", "g/x")[95] == 95).all()


# damage -------------------------------------------------------------------------------------------


def test_each_changed_byte_missing_and_extra_file_is_noticed(tmp_path):
    path = tmp_path / "s.zarr"
    write_store(path, {"g": Group({"x": array(np.arange(3, dtype="i2"), chunks=(2,))})}, {})
    for name, content in files(path).items():
        file = path / name
        others = [content[:-1], content + b"\0"]
        for place, byte in enumerate(content):
            flipped = byte ^ 1 << place % 8
            others.append(content[:place] + bytes([flipped]) + content[place + 1 :])
        for other in [*others, None]:
            file.unlink()
            if other is not None:
                file.write_bytes(other)
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


@pytest.mark.parametrize("content", [b"", b"{}", b'{"files":3}', b"[" * 10**5, b"\xff"])
def test_a_foreign_manifest_is_one_sentence(tmp_path, content):
    path = tmp_path / "s.zarr"
    assert read_attributes(path) is None
    path.mkdir()
    (path / MANIFEST).write_bytes(content)
    for function in (verify, read_attributes, check_target):
        with pytest.raises(ConfigurationError, match=r"^store is '.*s.zarr', whose [^\n]*$"):
            function(path)
    assert files(path) == {MANIFEST: content}
