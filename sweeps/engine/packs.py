"""Packs: files that keep the results of many cells.

A pack is a sealed line with its stage, the keys of its cells, the checksums of their records and
what these hold, followed by the records. A record is the arrays of a cell, one after another.
"""

from __future__ import annotations

import math
import os
import re
import time
import uuid
import zlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.sealed import seal, unseal

ROOM = "cells"
KEY = 32  # hexadecimal digits of a key
ALIGNED = 16  # bytes: arrays begin at multiples of this in a record

Cell = dict[str, NDArray[Any]]

_NAME = re.compile(r"[0-9a-f]{32}\.(pack|partial)")


@dataclass(frozen=True)
class Pack:
    """One file of finished cells.

    Attributes
    ----------
    path : str
        Path relative to the folder that it was written to.
    size : int
        Size of the file [byte].
    keys : tuple of str
        Keys of its cells, in the order of its rows.
    """

    path: str
    size: int
    keys: tuple[str, ...]


def write_pack(
    folder: Path, stage: str, cells: Sequence[tuple[str, Mapping[str, NDArray[Any]]]]
) -> Pack:
    """Write cells, given by key (32 hexadecimal digits), to a new file below a folder.

    Raises
    ------
    TypeError
        If an array holds objects, fields or strings of variable width.
    OSError
        If the file cannot be written; nothing of it is left.
    """
    layouts: dict[Any, int] = {}
    layout_of, records = [], []
    for _, outputs in cells:
        layout, record = _record(outputs)
        layout_of.append(layouts.setdefault(layout, len(layouts)))
        records.append(record)
    keys = tuple(key for key, _ in cells)
    header = seal(
        {
            "stage": stage,
            "keys": "".join(keys),
            "checksums": list(map(zlib.crc32, records)),
            "layouts": list(layouts),
            "layout_of": layout_of,
        }
    )
    # A name begins with the time, so that of equal cells the newest is known.
    path = f"{ROOM}/{time.time_ns():016x}{uuid.uuid4().hex[:16]}.pack"
    write_whole(folder, path, (header, *records))
    return Pack(path, len(header) + sum(map(len, records)), keys)


def write_whole(folder: Path, path: str, parts: Iterable[bytes]) -> None:
    """Write a file of a folder under another name first, so that readers see all or nothing."""
    partial = folder / ROOM / f"{uuid.uuid4().hex}.partial"
    partial.parent.mkdir(parents=True, exist_ok=True)
    try:
        with partial.open("xb") as file:
            file.writelines(parts)
        partial.replace(folder / path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def read_cells(folder: Path, requests: Sequence[tuple[str, int]]) -> list[Cell | None]:
    """Outputs of cells, given by path of a pack and row in it; each pack is opened once.

    Returns
    -------
    list of dict of str to ndarray, or None
        None for a cell that is absent or differs from its checksum; no content of a file makes
        this raise. Arrays are writable and share no element.
    """
    found: list[Cell | None] = [None] * len(requests)
    places: dict[str, list[tuple[int, int]]] = defaultdict(list)
    for place, (path, row) in enumerate(requests):
        places[path].append((row, place))
    for path, wanted in places.items():
        with suppress(Exception), (folder / path).open("rb") as file:
            header = _Header(file)
            for row, place in sorted(wanted):
                found[place] = header.read(row)
    return found


def read_keys(path: Path) -> tuple[str, str]:
    """Stage of a pack, and the keys of its cells one after another.

    Raises
    ------
    ValueError, OSError
        If it is damaged, or cannot be read.
    """
    with path.open("rb") as file:
        header = unseal(file.readline())
    return header["stage"], header["keys"]


def list_files(folder: Path) -> tuple[set[str], set[str]]:
    """Paths of all packs of a folder, and of files that are being written, relative to it."""
    packs: set[str] = set()
    partials: set[str] = set()
    with suppress(OSError), os.scandir(folder / ROOM) as entries:
        for entry in entries:
            if _NAME.fullmatch(entry.name) and entry.is_file():
                into = packs if entry.name.endswith(".pack") else partials
                into.add(f"{ROOM}/{entry.name}")
    return packs, partials


def _record(outputs: Mapping[str, NDArray[Any]]) -> tuple[Any, bytes]:
    """Name, dtype and shape of each array of a cell, and the bytes of all."""
    layout, parts = [], []
    for name, values in outputs.items():
        array = np.asarray(values)
        if array.dtype.hasobject or array.dtype.names:
            raise TypeError(
                f"output {name} has dtype {array.dtype}, but must be of numbers, truth values, "
                "times or strings of fixed width"
            )
        layout.append((name, array.dtype.str, array.shape))
        parts += [array.tobytes(), bytes(-array.nbytes % ALIGNED)]
    return tuple(layout), b"".join(parts)


class _Header:
    """Where and how the cells of an open pack are kept."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        header = unseal(file.readline())
        self._checksums, self._layout_of = header["checksums"], header["layout_of"]
        self._layouts = [list(map(_output, layout)) for layout in header["layouts"]]
        self._sizes = [sum(size for *_, size in layout) for layout in self._layouts]
        sizes = (self._sizes[number] for number in self._layout_of)
        self._starts = list(accumulate(sizes, initial=file.tell()))

    def read(self, row: int) -> Cell | None:
        """Arrays of a cell; None if they differ from its checksum."""
        number = self._layout_of[row]
        # Memory of its own for each cell: arrays are aligned, writable and apart.
        record = np.empty(self._sizes[number], dtype=np.uint8)
        self._file.seek(self._starts[row])
        read = self._file.readinto(record)  # type: ignore[attr-defined]
        if read != len(record) or zlib.crc32(record.data) != self._checksums[row]:
            return None
        cell: Cell = {}
        place = 0
        for name, dtype, shape, size in self._layouts[number]:
            cell[name] = np.ndarray(shape, dtype, record, place)
            place += size
        return cell


def _output(described: Any) -> tuple[str, np.dtype[Any], tuple[int, ...], int]:
    """Name, dtype, shape and bytes in a record of an array."""
    name, code, shape = described
    dtype = np.dtype(code)
    size = dtype.itemsize * math.prod(shape)
    return name, dtype, tuple(shape), size + -size % ALIGNED
