"""Attributes and arrays of a store in the zarr 3 format: their metadata, and chunks as bytes.

The metadata are plain dictionaries and the chunks are encoded here, because a store has hundreds
of small arrays: zarr takes 1.4 ms to make and 1.2 ms to write each, and this 0.1 ms.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numcodecs.zstd import Zstd
from numpy.typing import NDArray

from sweeps.engine.declare.storable import DATES, NAT, encode_attrs, is_storable
from sweeps.engine.resolve.keys import digest

METADATA = "zarr.json"
SCALARS = "scalar_coordinates"  # attribute of a group
BOTH = "is_attribute"  # marks a scalar coordinate that is also an attribute of the group

# Prefixes of the names of chunks, one for each of zarr's two encodings. A changed array gets the
# other prefix, so that the old metadata never refer to new chunks.
CHUNK_PREFIXES = ("c.", "")

CHUNK_BYTES = 2**20
MAX_CONSTANT = 4096  # elements of an array that is read to find out whether all are equal
ZSTD_LEVEL = 1  # level 3 compresses results no better and takes three times as long

Region = tuple[slice, ...]

DATE_ATTRIBUTES = {
    "units": "nanoseconds since 1970-01-01",
    "calendar": "proleptic_gregorian",
    "_FillValue": NAT,
}

# Its import cannot wait: numcodecs' modules import each other, and a thread may be importing zarr.
CODEC = Zstd(level=ZSTD_LEVEL, checksum=True)


# arrays -------------------------------------------------------------------------------------------


@dataclass(eq=False)
class Array:
    """A variable or coordinate to be written; each of its chunks is a file."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: np.dtype[Any]  # numbers, bool (stored as int8), texts of fixed width, or `DATES`
    attrs: Mapping[str, Any]  # integers that count steps have `scale_factor` here
    # Returns the values of one chunk's region (a slice with start and stop for each dimension).
    read: Callable[[Region], NDArray[Any]]
    chunks: tuple[int, ...]
    fill: complex | str | None = None  # of elements that are not written; None: NaN, 0 or ""
    coordinate: bool = False
    # Returns bytes that determine the values of a region; by default the values.
    source_bytes: Callable[[Region], bytes] | None = None
    # Returns a picklable `read` of one region, for other processes.
    remote_read: Callable[[Region], Callable[[Region], NDArray[Any]]] | None = None

    @classmethod
    def from_values(
        cls,
        dims: tuple[str, ...],
        values: Any,
        attrs: Mapping[str, Any] | None = None,
        fill: complex | str | None = None,
        *,
        coordinate: bool = False,
    ) -> Array:
        """Return an array of values in memory, in chunks of a suggested shape.

        Texts of any numpy kind become as wide as the longest.
        """
        array = np.asarray(values)
        texts = array.ravel().tolist() if array.dtype.kind in "OTU" else []
        if all(isinstance(text, str) for text in texts) and array.dtype.kind in "OTU":
            array = np.array(texts, dtype=str).reshape(array.shape)
        chunks = suggest_chunks(array.shape, max(array.itemsize, 1))
        read = array.__getitem__
        return cls(dims, array.shape, array.dtype, attrs or {}, read, chunks, fill, coordinate)

    @property
    def stored_dtype(self) -> np.dtype[Any]:
        """Stored dtype: little-endian; unsigned integers widen to signed ones where they fit.

        Raises TypeError if there is none.
        """
        dtype = np.dtype(self.dtype)
        if dtype.kind == "b":
            return np.dtype(np.int8)
        if dtype.kind == "u" and dtype.itemsize < 8:  # NetCDF 3 has no unsigned integers
            return np.dtype(f"<i{2 * dtype.itemsize}")
        if dtype == DATES:
            return np.dtype("<i8")
        if dtype.itemsize and is_storable(dtype):
            return dtype.newbyteorder("<")
        raise TypeError(f"values of dtype {dtype} cannot be stored; only numbers and texts can")

    @property
    def attributes(self) -> dict[str, Any]:
        """Return the stored attributes, with the dtype that xarray converts integers to."""
        extra: dict[str, Any] = {"b": {"dtype": "bool"}, "M": DATE_ATTRIBUTES}
        return encode_attrs(self.attrs) | extra.get(np.dtype(self.dtype).kind, {})

    @property
    def fill_scalar(self) -> Any:
        """Stored value of elements that are not written."""
        if np.dtype(self.dtype).kind == "M":
            return np.int64(NAT)
        default = {"U": "", "f": math.nan, "c": complex(math.nan, math.nan)}
        fill = default.get(self.stored_dtype.kind, 0) if self.fill is None else self.fill
        return self.stored_dtype.type(fill)

    def digest(self, region: Region) -> str:
        """Return the hash of all that determines the chunk of a region."""
        sizes = [span.stop - span.start for span in region]
        layout = (
            self.stored_dtype.str,
            self.chunks,
            self.fill_scalar.tobytes().hex(),
            sizes,
            ZSTD_LEVEL,
        )
        if self.source_bytes is not None:
            content = self.source_bytes(region)
        else:
            content = np.asarray(self.read(region), self.stored_dtype).tobytes()
        return digest(repr(layout).encode() + content)

    def with_fill(self) -> Array:
        """Use the value of a small constant array as its fill value, so that it needs no chunk."""
        if self.chunks != self.shape or not 0 < math.prod(self.shape) <= MAX_CONSTANT:
            return self
        values = self.load()
        first = values.flat[0]
        # zarr's metadata can state only one NaN bit pattern. A scalar never has a chunk.
        equal = first == first and values.tobytes() == first.tobytes() * values.size
        if self.dims and not equal:
            return self
        return replace(self, fill=first, remote_read=None)  # no worker has anything to write

    def worker_part(self, region: Region) -> Array:
        """Return the part that another process needs to write the chunk of a region."""
        assert self.remote_read is not None
        read = self.remote_read(region)
        return replace(self, read=read, attrs={}, source_bytes=None, remote_read=None)

    def load(self) -> NDArray[Any]:
        """Return all values as they are stored; they stay in memory."""
        # In the order in which zarr reads them: the last bit of sums may depend on the order.
        everywhere = tuple(slice(0, size) for size in self.shape)
        values = np.asarray(self.read(everywhere), self.stored_dtype, order="C")
        self.read = values.__getitem__
        return values


@dataclass(eq=False)
class ArrayGroup:
    """Variables and coordinates of one group, and its attributes."""

    arrays: dict[str, Array] = field(default_factory=dict)
    attrs: Mapping[str, Any] = field(default_factory=dict)

    @property
    def attributes(self) -> dict[str, Any]:
        """Return the attributes, including the list of coordinates that are not dimensions."""
        coordinates = {name: array for name, array in self.arrays.items() if array.coordinate}
        auxiliary = [name for name, array in coordinates.items() if array.dims != (name,)]
        extra = {"coordinates": " ".join(sorted(auxiliary))} if auxiliary else {}
        return encode_attrs(self.attrs) | extra

    def fold_scalars(self, reserved: Collection[str] = ()) -> ArrayGroup:
        """Return the group with scalar coordinates as attributes, as it is stored.

        The attribute `SCALARS` holds the attributes of each coordinate, for
        `tables.restore_scalars`. A coordinate stays an array if its name is `reserved`, or if the
        group has an attribute of that name with another value. Coordinates that are already
        attributes come first.
        """
        reserved = {*reserved, "coordinates", SCALARS}
        names = sorted(self.arrays.keys() - reserved, key=[*self.attrs, *self.arrays].index)
        scalars = {
            name: array
            for name in names
            if (array := self.arrays[name]).coordinate
            and not array.dims
            and array.dtype.kind in "biufU"
        }
        values = {name: array.load().astype(array.dtype).item() for name, array in scalars.items()}
        scalars = {
            name: array
            for name, array in scalars.items()
            if _is_json(values[name])
            if name not in self.attrs or _is_same(self.attrs[name], values[name])
        }
        if not scalars:
            return self
        scalar_values = {
            name: values[name] for name in scalars if values[name] == values[name]
        }  # not NaN
        scalar_attrs = {
            SCALARS: {
                name: array.attributes | {BOTH: 1} if name in self.attrs else array.attributes
                for name, array in scalars.items()
            }
        }
        arrays = {name: array for name, array in self.arrays.items() if name not in scalars}
        return ArrayGroup(arrays, {**self.attrs, **scalar_values, **scalar_attrs})


def suggest_chunks(shape: tuple[int, ...], itemsize: int, *, whole: int = 0) -> tuple[int, ...]:
    """Return a shape of chunks of at most `CHUNK_BYTES`, or as large as the last `whole` axes.

    These axes are never split. One axis before them is split into parts whose length does not
    depend on the axis length, so that appended values leave other chunks unchanged. Along earlier
    axes, chunks have length 1.
    """
    chunks: list[int] = []
    budget = max(CHUNK_BYTES // itemsize, 1)  # factor by which a chunk may still grow
    for axis, size in enumerate(reversed(shape)):
        full = max(size, 1)
        cut = axis >= whole and size > budget
        chunks.append(budget if cut else full)
        # Once an axis is cut, chunks have length 1 along the axes before it.
        budget = 1 if chunks[-1] < full else max(budget // full, 1)
    return tuple(reversed(chunks))


def iter_chunks(array: Array) -> Iterator[tuple[str, Region]]:
    """Yield index and region of every chunk of an array; none if it has no dimensions."""
    if not array.dims:
        return
    parts = [
        [slice(start, min(start + chunk, size)) for start in range(0, size, chunk)]
        for size, chunk in zip(array.shape, array.chunks, strict=True)
    ]
    for chunk in itertools.product(*map(enumerate, parts)):
        yield ".".join(str(number) for number, _ in chunk), tuple(r for _, r in chunk)


def metadata(array: Array, prefix: str = CHUNK_PREFIXES[0]) -> dict[str, Any]:
    """Return the zarr 3 metadata of an array, whose chunks have a prefix."""
    stored = array.stored_dtype
    serializer: dict[str, Any] = {"name": "bytes"}
    kind: Any = stored.name
    if stored.kind == "U":  # opens as numpy's own texts, which can be plotted and learned
        kind = {"name": "fixed_length_utf32", "configuration": {"length_bytes": stored.itemsize}}
    if stored.itemsize > 1:
        serializer["configuration"] = {"endian": "little"}
    return {
        "shape": list(array.shape),
        "data_type": kind,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": list(array.chunks)}},
        "chunk_key_encoding": {
            "name": "default" if prefix else "v2",
            "configuration": {"separator": "."},
        },
        "fill_value": _encode_fill(array.fill_scalar),
        "codecs": [
            serializer,
            {"name": "zstd", "configuration": {"level": ZSTD_LEVEL, "checksum": True}},
        ],
        "attributes": array.attributes,
        **({"dimension_names": list(array.dims)} if array.dims else {}),
        "zarr_format": 3,
        "node_type": "array",
        "storage_transformers": [],
    }


def _encode_fill(value: Any) -> Any:
    """Return a fill value in the form of zarr's metadata."""
    if value.dtype.kind == "c":
        return [_encode_fill(value.real), _encode_fill(value.imag)]
    if value.dtype.kind != "f":
        return value.item()
    words = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}
    return words.get(str(float(value)), float(value))


def encode(array: Array, region: Region) -> bytes | None:
    """Return the bytes of the chunk that covers a region; None if it holds only the fill value."""
    values = np.asarray(array.read(region))
    chunk = np.full(array.chunks, array.fill_scalar, array.stored_dtype)
    empty = chunk.tobytes()
    chunk[tuple(map(slice, values.shape))] = values  # the last chunk extends past the axis
    content = chunk.tobytes()  # compared bit by bit: NaN is NaN, and -0.0 is not 0.0
    return None if content == empty else bytes(CODEC.encode(content))


def _is_same(first: Any, second: Any) -> bool:
    """Return whether values have one type and are equal."""
    return type(first) is type(second) and bool(first == second)


def _is_json(value: Any) -> bool:
    """Return whether an attribute can hold a value: NaN, but no infinity; integers of 64 bits."""
    return not (isinstance(value, float) and math.isinf(value)) and (
        not isinstance(value, int) or -(2**63) <= value < 2**63
    )
