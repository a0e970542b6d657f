"""Packs: objects of a cache, each with finished results of many cells.

A pack begins with its head: a line with its stage, the time that its cells took and the layouts of
their arrays; then the keys of the cells, the number of each cell's layout, and the digest of each
cell's record. The records follow: the arrays of a cell, one after another. The name of a pack has
the digest and size of its head, and so identifies its whole content. Nothing in a pack is executed,
and a name that does not match the head marks a damaged pack.
"""

from __future__ import annotations

import errno
import json
import math
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from itertools import chain
from time import time_ns
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.declare.paths import PathOrUrl, join
from sweeps.engine.declare.undeclared import Layout
from sweeps.engine.objects import PRIVATE_MODE, UNREACHABLE, Objects
from sweeps.engine.resolve.keys import Keys, digest, hash_bytes

CELLS_FOLDER = "cells"
ALIGNMENT = 16  # bytes: arrays begin at multiples of this in a record
NO_PACK = -1  # instead of the number of a pack
PACK = ".pack"
PACK_PATH = re.compile(r"(?:\w+/)?[0-9a-f]{16}([0-9a-f]{32})([0-9a-f]{8})\.pack")
KEY_DTYPE, LAYOUT_DTYPE = np.dtype(("<u8", 2)), np.dtype("<u4")
MAX_HEAD_BYTES = 2**30  # bytes of a head, enough for more cells than a sweep may have
DIGEST_BYTES = 8  # bytes of the digest of a record
MAX_GAP, READ_BYTES = 2**18, 2**22  # bytes: largest gap that is read, largest range
CACHED_HEADS = 16  # heads of packs that a process caches
CELLS_AT_ONCE = 4096  # cells that are read together

# Errors of this process, machine or network: they do not mean that a file is damaged.
RESOURCE_ERRORS = frozenset(
    (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.EINTR, UNREACHABLE)
)

Buffer = Any
"""Bytes-like object."""
Cells = NDArray[np.int64]
Arrays = dict[str, NDArray[Any]]
Numbers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Locations:
    """Locations of cells on disk: arrays of one shape, indexed together.

    Paths of packs; the number of each cell's pack, negative if none; its row there; and its key, on
    a last axis of length 2.
    """

    paths: Sequence[str]
    pack: Numbers
    row: Numbers
    keys: Keys

    def __getitem__(self, index: Any) -> Locations:
        pack, row = np.asarray(self.pack[index]), np.asarray(self.row[index])
        return Locations(self.paths, pack, row, self.keys[index])

    def __len__(self) -> int:
        return len(self.pack)

    @property
    def present(self) -> NDArray[np.bool_]:
        """Whether each cell is on disk."""
        return self.pack >= 0

    def reshape(self, *shape: int) -> Locations:
        """Return the locations in another shape."""
        pack, row = self.pack.reshape(shape), self.row.reshape(shape)
        return Locations(self.paths, pack, row, self.keys.reshape(*pack.shape, 2))

    def compact(self) -> Locations:
        """Return the locations without unused paths, for pickling."""
        numbers, pack = np.unique(self.pack, return_inverse=True)
        absent = int((numbers < 0).sum())
        pack = np.maximum(pack.reshape(self.pack.shape) - absent, NO_PACK)
        paths = [self.paths[number] for number in numbers[absent:].tolist()]
        return replace(self, paths=paths, pack=pack.astype(np.int32))


_NONE = np.empty(0, np.int32)
NO_LOCATIONS = Locations((), _NONE, _NONE, np.empty((0, 2), np.uint64))


def seal(document: Any) -> bytes:
    """Serialise a JSON document as one line of bytes that begins with its checksum."""
    text = json.dumps(document, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def unseal(line: bytes) -> Any:
    """Return the document of a line made by `seal`; raise ValueError if the line was changed."""
    text = line[9:-1]
    if line != b"%08x %s\n" % (zlib.crc32(text), text):
        raise ValueError("its checksum differs")
    return json.loads(text)


def open_packs(cache: PathOrUrl, *, create: bool = True) -> Objects:
    """Return the packs of a cache; a new folder is private."""
    return Objects(join(cache, CELLS_FOLDER), create=create, mode=PRIVATE_MODE, remove_empty=False)


@dataclass(frozen=True)
class Pack:
    """A pack of finished cells: its name, bytes, number of cells."""

    path: str
    size: int = 0
    cells: int = 0
    stage: str = "(unreadable)"
    seconds: float = 0.0  # time of all cells


class Head(NamedTuple):
    """Verified head of a pack: key, layout number, and first and end byte of each cell's record.

    A layout has the name, dtype, shape and offset of every array of a record.
    """

    pack: Pack
    keys: Keys
    numbers: NDArray[np.uint32]
    begins: NDArray[np.int64]
    ends: NDArray[np.int64]
    layouts: list[list[tuple[str, np.dtype[Any], tuple[int, ...], int]]]
    digests: bytes

    @classmethod
    def parse(cls, path: str, content: bytes) -> Head:
        """Return the head of a pack from its bytes; raise an exception of any kind if it is bad."""
        if digest(content) != _parse_path(path)[0]:
            raise ValueError("it was changed")
        begin = content.index(b"\n") + 1
        stage, seconds, layout_specs = json.loads(content[:begin])
        cell_bytes = KEY_DTYPE.itemsize + LAYOUT_DTYPE.itemsize + DIGEST_BYTES
        cells = (len(content) - begin) // cell_bytes
        layouts, sizes = [], []
        for arrays in layout_specs:
            layout, size = [], 0
            for name, code, shape in arrays:
                dtype = _validate_dtype(code)
                layout.append((name, dtype, tuple(shape), size))
                length = math.prod(shape) * dtype.itemsize
                size += length + -length % ALIGNMENT
            layouts.append(layout)
            sizes.append(size)
        keys = np.frombuffer(content, KEY_DTYPE.base, 2 * cells, begin).reshape(cells, 2)
        numbers = np.frombuffer(content, LAYOUT_DTYPE, cells, begin + keys.nbytes)
        record_sizes = np.array(sizes, np.int64)[numbers]
        ends = len(content) + np.cumsum(record_sizes)
        digests = content[begin + keys.nbytes + numbers.nbytes :]
        columns = keys, numbers, ends - record_sizes, ends, layouts, digests
        size = int(ends[-1]) if cells else 0
        return cls(Pack(path, size, cells, stage, seconds), *columns)

    def arrays(self, row: int, record: Buffer) -> Arrays | None:
        """Return the arrays of a record, copied; None if its digest differs."""
        begin = DIGEST_BYTES * row
        if hash_bytes(record, DIGEST_BYTES) != self.digests[begin : begin + DIGEST_BYTES]:
            return None
        content, layout = bytearray(record), self.layouts[self.numbers[row]]
        return {
            name: np.ndarray(shape, dtype, content, offset) for name, dtype, shape, offset in layout
        }


@dataclass
class PackWriter:
    """Writer of a pack: collects the records of its cells."""

    layouts: dict[Any, int] = field(default_factory=dict)
    numbers: list[int] = field(default_factory=list)
    digests: list[bytes] = field(default_factory=list)
    parts: list[bytes] = field(default_factory=list)

    def add(self, outputs: Mapping[str, NDArray[Any]]) -> None:
        """Add a cell; TypeError if an array holds objects, fields or texts of variable width."""
        layout, record = [], b""
        for name, values in outputs.items():
            array = values if type(values) is np.ndarray else np.asarray(values)
            layout.append((name, array.dtype.str, array.shape))
            record += array.tobytes() + bytes(-array.nbytes % ALIGNMENT)
        number = self.layouts.get(key := tuple(layout))
        if number is None:
            for array in outputs.values():
                _dtype_code(np.asarray(array).dtype)
            number = self.layouts[key] = len(self.layouts)
        self.numbers.append(number)
        self.digests.append(hash_bytes(record, DIGEST_BYTES))
        self.parts.append(record)

    def write(
        self, objects: Objects, stage: str, keys: Keys, seconds: float = 0.0, folder: str = ""
    ) -> Pack:
        """Write the cells, whose keys are (cell, 2), as a new pack; OSError if that fails.

        The write is atomic. `folder` has the packs of one stage and code.
        """
        line = json.dumps([stage, seconds, list(self.layouts)], separators=(",", ":")).encode()
        numbers = np.array(self.numbers, LAYOUT_DTYPE).tobytes()
        head = b"".join(
            (line, b"\n", keys.astype(KEY_DTYPE.base).tobytes(), numbers, *self.digests)
        )
        # A name begins with the time, since a bucket dates packs by whole seconds.
        path = f"{folder}/{time_ns():016x}{digest(head)}{len(head):08x}.pack".lstrip("/")
        size, parts = sum(map(len, self.parts)), self.parts
        step = READ_BYTES * len(parts) // (size + 1) + 1  # parts per block of about READ_BYTES
        blocks = (b"".join(parts[k : k + step]) for k in range(0, len(parts), step))
        objects.put(path, chain((head,), blocks))
        return Pack(path, len(head) + size, len(keys), stage, seconds)


def _parse_path(path: str) -> tuple[str, int]:
    """Return digest and size of the head of a pack from its path; ValueError if it has none."""
    name = PACK_PATH.fullmatch(path)
    if name is None or int(name[2], 16) > MAX_HEAD_BYTES:
        raise ValueError("it is not a pack")
    return name[1], int(name[2], 16)


@cache
def _dtype_code(dtype: np.dtype[Any]) -> str:
    """Return the code of a dtype, as `_validate_dtype` reads it."""
    return _validate_dtype(dtype).str


@lru_cache(maxsize=256)
def _validate_dtype(code: str | np.dtype[Any]) -> np.dtype[Any]:
    """Return a dtype; raise TypeError if its arrays hold pointers or fields, not plain values."""
    dtype = np.dtype(code)
    if dtype.hasobject or dtype.names or dtype.subdtype:
        raise TypeError(f"arrays of dtype {dtype} cannot be cached")
    return dtype


@contextmanager
def ignore_damage() -> Iterator[None]:
    """Suppress errors of absent or damaged files, but not a lack of resources."""
    try:
        yield
    except Exception as error:
        raise_resource_error(error)


def raise_resource_error(error: BaseException) -> None:
    """Re-raise errors of exhausted resources, which do not mean damage."""
    if isinstance(error, MemoryError) or getattr(error, "errno", None) in RESOURCE_ERRORS:
        raise error


@lru_cache(maxsize=CACHED_HEADS)
def _read_head(objects: Objects, path: str) -> Head:
    """Return the head of a pack; raise an exception of any kind if it is bad."""
    return Head.parse(path, bytes(objects.read_range(path, 0, _parse_path(path)[1])))


def read_cells(objects: Objects, locations: Locations) -> list[Arrays | None]:
    """Return the outputs of cells, (cell,), in one pass over each pack.

    A cell is None if it is absent, has another key, or does not match its digest. Damaged packs
    never raise. Arrays are writable and share no memory.

    Raises
    ------
    OSError
        If a resource is exhausted or unreachable, such as file descriptors or the network.
    """
    outputs: list[Arrays | None] = [None] * len(locations)
    order = np.lexsort((locations.row, locations.pack))
    order = order[locations.pack[order] >= 0]
    group_starts = np.flatnonzero(np.diff(locations.pack[order], prepend=-1))
    for indices in np.split(order, group_starts[1:]) if order.size else ():
        rows, path = locations.row[indices], locations.paths[locations.pack[indices[0]]]
        with ignore_damage():
            head = _read_head(objects, path)
            in_range = np.flatnonzero(rows < len(head.keys))
            equal = head.keys[rows[in_range]] == locations.keys[indices[in_range]]
            matching = in_range[equal.all(axis=1)]
            begins, ends = head.begins[rows[matching]], head.ends[rows[matching]]
            gaps, blocks = begins[1:] - ends[:-1], np.diff(begins // READ_BYTES)
            splits = np.flatnonzero((gaps > MAX_GAP) | (blocks != 0))
            for run in np.split(matching, splits + 1):
                _read_run(objects, path, head, rows[run], indices[run], outputs)
    return outputs


def distinct_layouts(objects: Objects, locations: Locations) -> list[Layout]:
    """Return the distinct layouts of cells, (cell,), by first appearance; skip damaged packs."""
    first_indices: dict[Any, int] = {}
    for pack in np.unique(locations.pack).tolist():
        indices = np.flatnonzero(locations.pack == pack)
        with ignore_damage():
            head = _read_head(objects, locations.paths[pack])
            numbers, first = np.unique(head.numbers[locations.row[indices]], return_index=True)
            for number, index in zip(numbers.tolist(), indices[first].tolist(), strict=True):
                layout = tuple((name, code, shape) for name, code, shape, _ in head.layouts[number])
                first_indices[layout] = min(first_indices.get(layout, index), index)
    return sorted(first_indices, key=first_indices.__getitem__)


def iter_cells(objects: Objects, locations: Locations) -> Iterator[Arrays | None]:
    """Yield the outputs of cells, as `read_cells` does, holding `CELLS_AT_ONCE` in memory."""
    for first in range(0, len(locations), CELLS_AT_ONCE):
        yield from read_cells(objects, locations[first : first + CELLS_AT_ONCE])


def _read_run(
    objects: Objects,
    path: str,
    head: Head,
    rows: Numbers,
    indices: Cells,
    outputs: list[Arrays | None],
) -> None:
    """Read one range of a pack, for ascending rows, into `outputs`."""
    if not len(rows):
        return
    first = int(head.begins[rows[0]])
    content = objects.read_range(path, first, int(head.ends[rows[-1]]))
    begins, ends = (head.begins[rows] - first).tolist(), (head.ends[rows] - first).tolist()
    for index, row, begin, end in zip(indices.tolist(), rows.tolist(), begins, ends, strict=True):
        outputs[index] = head.arrays(row, content[begin:end])


def read_pack(objects: Objects, path: str, size: int) -> tuple[Pack, Keys]:
    """Return the description and keys of a pack; no cells if its head cannot be read."""
    with ignore_damage():
        head = _read_head.__wrapped__(objects, path) if _parse_path(path)[1] <= size else None
        if head is None or head.pack.size != size:
            raise ValueError("it is longer or shorter than it was")
        return head.pack, head.keys.copy()
    return Pack(path, size), np.empty((0, 2), np.uint64)
