"""Packs that are not what the index says, and processes that cannot open them just now."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest
from small_stores import files
from test_cells import key, same, small, written
from toys import Told, go

from sweeps.engine import packs
from sweeps.engine.packs import Spot, list_files, read_cells, seal, unseal
from sweeps.engine.results import INDEX, CellIndex, open_index


def exchange(one: Path, other: Path) -> None:
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)


def stage_of(path: Path) -> str:
    return str(unseal(path.read_bytes().partition(b"\n")[0] + b"\n")["stage"])


def test_a_cell_of_another_key_is_not_read(tmp_path):
    one, other = written(tmp_path, 1, 2), written(tmp_path, 3, 4)
    spots = [Spot(one.path, 0, key(1)), Spot(one.path, 1, key(2)), Spot(other.path, 0, key(3))]
    exchange(tmp_path / one.path, tmp_path / other.path)
    assert read_cells(tmp_path, spots) == [None] * 3
    [found] = read_cells(tmp_path, [Spot(other.path, 0, key(1))])
    assert same(found, small(1))


def test_exchanged_packs_under_an_intact_index_do_not_change_a_store(tmp_path):
    cache, told = tmp_path / "cache", Told()
    go(tmp_path / "s.zarr", cache)
    first = {stage_of(cache / path): cache / path for path in list_files(cache)[0]}
    go(tmp_path / "t.zarr", cache, seed=1)  # cells of the same shapes
    for path in (cache / path for path in list_files(cache)[0]):
        if path not in first.values():
            exchange(path, first[stage_of(path)])
    go(tmp_path / "again.zarr", cache, watch=told.watch)
    assert files(tmp_path / "again.zarr") == files(tmp_path / "s.zarr")
    assert any("are damaged and are computed again" in one for one in told.sentences)


@pytest.mark.parametrize("dtype", ["|O", "<f8,<i4", "(2,)<f8", "nonsense"])
def test_a_dtype_that_no_output_has_is_damage(tmp_path, dtype):
    """File bytes would be taken for pointers of objects."""
    pack = written(tmp_path, 1)
    line, record = (tmp_path / pack.path).read_bytes().split(b"\n", 1)
    document = unseal(line + b"\n")
    document["layouts"] = [[["a", dtype, [1]]]]
    (tmp_path / pack.path).write_bytes(seal(document) + record)
    assert read_cells(tmp_path, [Spot(pack.path, 0, key(1))]) == [None]


def test_a_size_beyond_the_file_takes_no_memory(tmp_path, monkeypatch):
    pack = written(tmp_path, 1)
    line, record = (tmp_path / pack.path).read_bytes().split(b"\n", 1)
    document = unseal(line + b"\n")
    document["layouts"] = [[["a", "<f8", [10**12]]]]
    (tmp_path / pack.path).write_bytes(seal(document) + record)
    monkeypatch.setattr(np, "empty", None)
    assert read_cells(tmp_path, [Spot(pack.path, 0, key(1))]) == [None]


class Short:
    """A process that has no file descriptors left to open packs, for some attempts."""

    def __init__(self, monkeypatch, attempts, number=errno.EMFILE):
        self.left, self.open = attempts, Path.open

        def opened(path, *arguments, **named):
            if path.suffix in (".pack", ".index") and arguments == ("rb",) and self.left > 0:
                self.left -= 1
                raise OSError(number, os.strerror(number), str(path))
            return self.open(path, *arguments, **named)

        monkeypatch.setattr(Path, "open", opened)
        monkeypatch.setattr(packs, "PAUSES", (0.0, 0.0, 0.0))


@pytest.mark.parametrize("number", [errno.EMFILE, errno.ENFILE, errno.ENOMEM])
def test_a_lack_of_descriptors_is_no_damage(tmp_path, monkeypatch, number):
    pack = written(tmp_path, 1)
    spots = [Spot(pack.path, 0, key(1))]
    Short(monkeypatch, 3, number)
    assert same(read_cells(tmp_path, spots)[0], small(1))  # tried again
    Short(monkeypatch, 99, number)
    with pytest.raises(OSError, match=os.strerror(number)):
        read_cells(tmp_path, spots)


@pytest.mark.parametrize("indexed", [True, False])
def test_an_index_without_descriptors_forgets_nothing(tmp_path, monkeypatch, indexed):
    with open_index(tmp_path, print) as index:
        index.add("render", [written(tmp_path, 1)], 1.0)
    if not indexed:
        (tmp_path / INDEX).unlink()
    with monkeypatch.context() as patch:
        Short(patch, 99)
        with pytest.raises(OSError, match="Too many open files"), open_index(tmp_path, print):
            pass
    with open_index(tmp_path, print) as index:
        assert list(index.find([key(1)])) == [key(1)]


def test_a_sweep_without_descriptors_recomputes_and_deletes_nothing(tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    go(tmp_path / "s.zarr", cache)
    before = files(cache)
    with monkeypatch.context() as patch:
        short = Short(patch, 0)

        def found(index, keys, find=CellIndex.find):
            short.left = 99  # from the first look-up on, after the index is read
            return find(index, keys)

        patch.setattr(CellIndex, "find", found)
        with pytest.raises(OSError, match="Too many open files"):
            go(tmp_path / "t.zarr", cache)
    assert files(cache) == before and not (tmp_path / "t.zarr").exists()
    go(tmp_path / "t.zarr", cache)
    assert files(tmp_path / "t.zarr") == files(tmp_path / "s.zarr")
