"""Packs: files on disk, each with finished results of many cells.

A pack has two sealed lines, one with its stage, the keys of its cells and the time that they took,
one with the place, checksum and layout of each, followed by the records: the arrays of a cell, one
after another. Packs and their folders are made for this user alone, and files of other users are
not read.
"""

from __future__ import annotations

import errno
import json
import os
import re
import uuid
import zlib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from io import BufferedReader
from pathlib import Path
from time import time_ns
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

ROOM = "cells"
ALIGNED = 16  # bytes: arrays begin at multiples of this in a record
PRIVATE = 0o700  # mode of the folders of a cache

# Errors of this process or machine, not of a file: what they hide is not damaged.
SHORTAGES = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.EINTR})

Cell = dict[str, NDArray[Any]]


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
    size: int = 0
    keys: tuple[str, ...] = ()
    stage: str = "(unreadable)"
    seconds: float = 0.0  # that all cells took


def write_pack(
    folder: Path,
    stage: str,
    cells: Sequence[tuple[str, Mapping[str, NDArray[Any]]]],
    seconds: float = 0.0,
) -> Pack:
    """Write cells, given by key (32 hexadecimal digits), to a new file below a folder.

    If this fails, nothing of the file is left. TypeError if an array holds objects, fields or
    strings of variable width.
    """
    layouts: dict[Any, int] = {}
    rows, records, end = [], [], 0
    for _, outputs in cells:
        layout, record = _record(outputs)
        number = layouts.setdefault(layout, len(layouts))
        rows.append((end, len(record), zlib.crc32(record), number))
        records.append(record)
        end += len(record)
    keys = tuple(key for key, _ in cells)
    header = seal([stage, seconds, keys]) + seal([rows, list(layouts)])
    # A name begins with the time, so that the newest of equal cells is known.
    path = f"{ROOM}/{time_ns():016x}{uuid.uuid4().hex[:16]}.pack"
    write_whole(folder, path, (header, *records))
    return Pack(path, len(header) + end, keys, stage, seconds)


def _record(outputs: Mapping[str, NDArray[Any]]) -> tuple[Any, bytes]:
    """Return name, dtype, shape and offset of each array of a cell, and the bytes of all."""
    layout, record = [], bytearray()
    for name, values in outputs.items():
        array = np.asarray(values)
        layout.append((name, _plain(array.dtype).str, array.shape, len(record)))
        record += array.tobytes() + bytes(-array.nbytes % ALIGNED)
    return tuple(layout), bytes(record)


@cache
def _plain(code: str | np.dtype[Any]) -> np.dtype[Any]:
    """Return a dtype; TypeError unless the bytes of an array are its values: no pointers."""
    dtype = np.dtype(code)
    if dtype.hasobject or dtype.names or dtype.subdtype:
        raise TypeError(f"arrays of dtype {dtype} cannot be kept")
    return dtype


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
        with open(partial, "xb", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
            file.writelines(parts)
        partial.replace(folder / path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


@contextmanager
def open_own(path: Path) -> Iterator[BufferedReader]:
    """Open a file to read it; raise PermissionError if it is another user's."""
    with path.open("rb") as file:
        if not is_own(file.fileno()):
            raise PermissionError(errno.EPERM, "belongs to another user", str(path))
        yield file


@contextmanager
def undamaged() -> Iterator[None]:
    """Suppress errors of absent or damaged files, but not of a process that lacks something."""
    try:
        yield
    except Exception as error:
        if isinstance(error, MemoryError) or getattr(error, "errno", None) in SHORTAGES:
            raise


def read_cells(folder: Path, requests: Sequence[Spot]) -> list[Cell | None]:
    """Return outputs of cells; open each pack once.

    None for a cell that is absent, is another than that of its key, differs from its checksum or is
    in a file of another user; no content of a file makes it raise. Arrays are writable and share no
    element.

    Raises
    ------
    OSError
        If this process or machine lacks something, such as file descriptors.
    """
    found: list[Cell | None] = [None] * len(requests)
    places: dict[str, list[tuple[int, int, str]]] = defaultdict(list)
    for place, (path, row, key) in enumerate(requests):
        places[path].append((row, place, key))
    for path, wanted in places.items():
        with undamaged(), open_own(folder / path) as file:
            (_, _, keys), (rows, layouts) = unseal(file.readline()), unseal(file.readline())
            first, last = file.tell(), os.fstat(file.fileno()).st_size
            for row, place, key in sorted(wanted):
                start, size, checksum, layout = rows[row]
                if keys[row] != key or first + start + size > last:
                    continue
                # Memory of its own for each cell: arrays are aligned, writable and apart.
                record = np.empty(size, dtype=np.uint8)
                file.seek(first + start)
                whole = file.readinto(record) == size  # type: ignore[arg-type]
                if whole and zlib.crc32(record.data) == checksum:
                    found[place] = {
                        name: np.ndarray(shape, _plain(code), record, offset)
                        for name, code, shape, offset in layouts[layout]
                    }
    return found


def described_pack(folder: Path, path: str, size: int) -> Pack:
    """Return what the first line of a pack says of it; no cells, if that cannot be read."""
    with undamaged(), open_own(folder / path) as file:
        stage, seconds, keys = unseal(file.readline())
        if not (seconds >= 0 and all(isinstance(key, str) for key in keys)):
            raise ValueError("it is not a pack")
        return Pack(path, size, tuple(keys), str(stage), seconds)
    return Pack(path, size)


def files_of(folder: Path, kind: str) -> dict[str, os.stat_result]:
    """Return status of the packs, or partial files, of a folder, by path relative to it."""
    found: dict[str, os.stat_result] = {}
    with undamaged(), os.scandir(folder / ROOM) as entries:
        for entry in entries:
            if re.fullmatch(rf"[0-9a-f]{{32}}\.{kind}", entry.name) and entry.is_file():
                with suppress(FileNotFoundError):  # deleted by another process just now
                    found[f"{ROOM}/{entry.name}"] = entry.stat()
    return found
