"""Packs: files on disk, each with finished results of many cells.

A pack is a sealed line with its stage, the keys of its cells, the checksums of their records and
their layout, followed by the records: the arrays of a cell, one after another. Packs and their
folders are made for this user alone, and files of other users are not read.
"""

from __future__ import annotations

import errno
import json
import math
import os
import re
import time
import uuid
import zlib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedReader
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

ROOM = "cells"
ALIGNED = 16  # bytes: arrays begin at multiples of this in a record
PRIVATE = 0o700  # mode of the folders of a cache

# Errors of this process or machine, not of a file: what they hide is not damaged.
SHORTAGES = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.EINTR})
PAUSES = (0.05, 0.2, 0.8)  # s before a file is opened again after one of them

Cell = dict[str, NDArray[Any]]

_NAME = re.compile(r"[0-9a-f]{32}\.(pack|partial)")


class Spot(NamedTuple):
    """A finished cell on disk: path of its pack, its row there, and its key."""

    path: str
    row: int
    key: str


def seal(document: Any) -> bytes:
    """Return a line of bytes of a JSON document, which begins with its checksum."""
    text = json.dumps(document, separators=(",", ":")).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def unseal(line: bytes) -> Any:
    """Return the document of a line made by `seal`; raise ValueError if the line was changed."""
    text = line[9:-1]
    if line != b"%08x %s\n" % (zlib.crc32(text), text):
        raise ValueError("its checksum differs")
    return json.loads(text)


@dataclass(frozen=True)
class Pack:
    """A file of finished cells: path relative to its folder, bytes, keys in the order of rows."""

    path: str
    size: int
    keys: tuple[str, ...]


def write_pack(
    folder: Path, stage: str, cells: Sequence[tuple[str, Mapping[str, NDArray[Any]]]]
) -> Pack:
    """Write cells, given by key (32 hexadecimal digits), to a new file below a folder.

    If this fails, nothing of the file is left. TypeError if an array holds objects, fields or
    strings of variable width.
    """
    layouts: dict[Any, int] = {}
    described = [_record(outputs) for _, outputs in cells]
    records = [record for _, record in described]
    keys = tuple(key for key, _ in cells)
    layout_of = [layouts.setdefault(layout, len(layouts)) for layout, _ in described]
    document = {
        "stage": stage,
        "keys": keys,
        "checksums": list(map(zlib.crc32, records)),
        "layout_of": layout_of,
        "layouts": list(layouts),
    }
    header = seal(document)
    # A name begins with the time, so that the newest of equal cells is known.
    path = f"{ROOM}/{time.time_ns():016x}{uuid.uuid4().hex[:16]}.pack"
    write_whole(folder, path, (header, *records))
    return Pack(path, len(header) + sum(map(len, records)), keys)


def _record(outputs: Mapping[str, NDArray[Any]]) -> tuple[Any, bytes]:
    """Return name, dtype and shape of each array of a cell, and the bytes of all."""
    layout, parts = [], []
    for name, values in outputs.items():
        array = np.asarray(values)
        if not _is_plain(array.dtype):
            raise TypeError(
                f"output {name} has dtype {array.dtype}, but must be of numbers, truth values, "
                "times or strings of fixed width"
            )
        layout.append((name, array.dtype.str, array.shape))
        parts += [array.tobytes(), bytes(-array.nbytes % ALIGNED)]
    return tuple(layout), b"".join(parts)


def make_folder(path: Path, mode: int) -> None:
    """Make a folder and its missing parents, with at most this mode; the umask may say less."""
    if path.is_dir():
        return
    for part in reversed((path, *path.parents)):
        if not part.is_dir():
            with suppress(FileExistsError):  # made by another process just now
                part.mkdir(mode)


def is_own(file: int | Path) -> bool:
    """Return whether a file, given by its path or descriptor, belongs to the user of this process.

    Another user might have written anything into it.
    """
    return not hasattr(os, "geteuid") or os.stat(file).st_uid == os.geteuid()


def write_whole(folder: Path, path: str, parts: Iterable[bytes]) -> None:
    """Write a file of a folder under another name first, so that readers see all or nothing."""
    partial = folder / ROOM / f"{uuid.uuid4().hex}.partial"
    make_folder(partial.parent, PRIVATE)
    try:
        with open(partial, "xb", opener=_private) as file:
            file.writelines(parts)
        partial.replace(folder / path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def _private(name: str, flags: int) -> int:
    """Open a new file that others may neither read nor write."""
    return os.open(name, flags, 0o600)


@contextmanager
def open_own(path: Path) -> Iterator[BufferedReader]:
    """Open a file to read it; raise PermissionError if it is another user's.

    Try again if the process or the machine lacks something, such as file descriptors, meanwhile.
    """
    for pause in (*PAUSES, None):
        try:
            file = path.open("rb")
            break
        except OSError as error:
            if error.errno not in SHORTAGES or pause is None:
                raise
            time.sleep(pause)
    with file:
        if not is_own(file.fileno()):
            raise PermissionError(errno.EPERM, "belongs to another user", str(path))
        yield file


@contextmanager
def undamaged(*kinds: type[Exception]) -> Iterator[None]:
    """Suppress errors of absent or damaged files, but not of a process that lacks something."""
    try:
        yield
    except kinds as error:
        if isinstance(error, MemoryError) or getattr(error, "errno", None) in SHORTAGES:
            raise


def _is_plain(dtype: np.dtype[Any]) -> bool:
    """Return whether the bytes of an array of a dtype are its values: no pointers, no fields."""
    return not (dtype.hasobject or dtype.names or dtype.subdtype)


def read_cells(folder: Path, requests: Sequence[Spot]) -> list[Cell | None]:
    """Return outputs of cells; open each pack once.

    None for a cell that is absent, is another than that of its key, differs from its checksum or is
    in a file of another user; no content of a file makes it raise. Arrays are writable and share no
    element.

    Raises
    ------
    OSError
        If this process or machine lacks something, such as file descriptors, for a while.
    """
    found: list[Cell | None] = [None] * len(requests)
    places: dict[str, list[tuple[int, int, str]]] = defaultdict(list)
    for place, (path, row, key) in enumerate(requests):
        places[path].append((row, place, key))
    for path, wanted in places.items():
        with undamaged(Exception), open_own(folder / path) as file:
            header = unseal(file.readline())
            layouts = list(map(_laid_out, header["layouts"]))
            of, keys = header["layout_of"], header["keys"]
            starts = list(accumulate((layouts[number][1] for number in of), initial=file.tell()))
            end = os.fstat(file.fileno()).st_size
            for row, place, key in sorted(wanted):
                layout, size = layouts[of[row]]
                if keys[row] != key or starts[row] + size > end:
                    continue
                # Memory of its own for each cell: arrays are aligned, writable and apart.
                record = np.empty(size, dtype=np.uint8)
                file.seek(starts[row])
                whole = file.readinto(record) == size  # type: ignore[arg-type]
                if whole and zlib.crc32(record.data) == header["checksums"][row]:
                    found[place] = {
                        name: np.ndarray(shape, dtype, record, start)
                        for name, shape, dtype, start in layout
                    }
    return found


def _laid_out(described: Any) -> tuple[list[tuple[Any, ...]], int]:
    """Return name, shape, dtype and offset of each array, and the size of the record [byte]."""
    layout, place = [], 0
    for name, code, shape in described:
        dtype = np.dtype(code)
        if not _is_plain(dtype):
            raise ValueError(f"dtype {code}")
        layout.append((name, tuple(shape), dtype, place))
        size = dtype.itemsize * math.prod(shape)
        place += size + -size % ALIGNED
    return layout, place


def list_files(folder: Path) -> tuple[set[str], set[str]]:
    """Return paths of all packs of a folder and of partial files, relative to it."""
    packs: set[str] = set()
    partials: set[str] = set()
    with undamaged(OSError), os.scandir(folder / ROOM) as entries:
        for entry in entries:
            if _NAME.fullmatch(entry.name) and entry.is_file():
                into = packs if entry.name.endswith(".pack") else partials
                into.add(f"{ROOM}/{entry.name}")
    return packs, partials
