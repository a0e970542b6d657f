"""Blocks of values read from a store again and again, faster than zarr opens an array."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from sweeps.engine.zarr_array import METADATA

KEPT_CHUNKS = 16  # decoded ones


def read_block(path: Path, group: str, name: str, index: tuple[int | slice, ...]) -> NDArray[Any]:
    """Values of an array of a store, as they are stored, at an index of one chunk.

    Parameters
    ----------
    path : Path
        The store, verified, which nobody replaces meanwhile.
    group, name : str
        Group and array.
    index : tuple of int or slice
        Place along each dimension; a slice takes all along one that chunks do not cut.

    Raises
    ------
    FileNotFoundError
        If there is no such array.
    """
    file = path / group / name
    status = (file / METADATA).stat()
    version = status.st_ino, status.st_mtime_ns  # another one if the store was replaced
    sizes = _open(file, version).chunks
    pairs = [
        (0, one) if isinstance(one, slice) else divmod(one, n)
        for one, n in zip(index, sizes, strict=True)
    ]
    return _chunk(file, version, tuple(place for place, _ in pairs))[
        tuple(inside for _, inside in pairs)
    ]


@lru_cache(maxsize=64)
def _open(file: Path, version: tuple[int, int]) -> Any:
    import zarr  # which takes long to import, and most sweeps read no store

    return zarr.open_array(file, mode="r")


@lru_cache(maxsize=KEPT_CHUNKS)
def _chunk(file: Path, version: tuple[int, int], place: tuple[int, ...]) -> Any:
    return _open(file, version).get_block_selection(place)
