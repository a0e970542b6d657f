"""Helpers that write, find and compare packs and cells of a cache."""

import hashlib

import numpy as np

from sweeps.engine.cache.packs import Locations, Pack, PackWriter, open_packs, read_cells
from sweeps.engine.declare.stage import Output
from sweeps.engine.objects import Objects

SMALL = [Output(f"output {number}", ("row",), "f8") for number in range(2)]
"""The outputs that `small` returns."""


def keys(*names) -> np.ndarray:
    texts = (hashlib.md5(str(name).encode()).digest() for name in names)
    return np.frombuffer(b"".join(texts), np.uint64).reshape(-1, 2)


def write_pack(cells: Objects, stage: str, names, arrays, seconds=0.0) -> Pack:
    packing = PackWriter()
    for array in arrays:
        packing.add(array)
    return packing.write(cells, stage, keys(*names), seconds)


def locations(path: str, rows, names) -> Locations:
    """Return the locations of cells in one pack, given their rows and the names of their keys."""
    rows = np.array(rows, np.int32)
    return Locations([path], 0 * rows, rows, keys(*names))


def small(name) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(int(keys(name)[0, 0]))
    return {output.name: rng.normal(size=number) for number, output in enumerate(SMALL)}


def written(cells: Objects, *names, stage="render") -> Pack:
    return write_pack(cells, stage, names, map(small, names))


def same(cell, expected) -> bool:
    """Return whether names and their order, and dtype, shape and bits of each array are equal."""
    return list(cell) == list(expected) and all(
        (cell[name].dtype, cell[name].shape, cell[name].tobytes())
        == (array.dtype, array.shape, array.tobytes())
        for name, array in expected.items()
    )


def whole(cells: Objects, index, names) -> bool:
    """Return whether the index finds all cells and they are read as they were written."""
    index.refresh()
    cell_locations = index.find(keys(*names))
    read = read_cells(cells, cell_locations)
    return cell_locations.present.all() and all(
        same(cell, small(name)) for cell, name in zip(read, names, strict=True)
    )


def pack_files(cache):
    """Return the sorted paths of all packs of a cache in a folder."""
    return sorted(cell for cell in open_packs(cache).path.rglob("*.pack"))
