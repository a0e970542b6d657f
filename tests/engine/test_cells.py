"""Finished cells on disk: what is written is read back, whatever else happens to the files."""

import errno
import hashlib
import os
import signal
import stat
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of
from running import python
from small_stores import files
from toys import Told, go

from sweeps.engine.packs import (
    KEY,
    ROW,
    CellIndex,
    Pack,
    Packing,
    Spots,
    described_pack,
    files_of,
    read_cells,
    seal,
    unseal,
)


def keys(*names) -> np.ndarray:
    texts = (hashlib.md5(str(name).encode()).digest() for name in names)
    return np.frombuffer(b"".join(texts), np.uint64).reshape(-1, 2)


def write_pack(folder: Path, stage: str, names, cells, seconds=0.0) -> Pack:
    packing = Packing()
    for cell in cells:
        packing.add(cell)
    return packing.write(folder, stage, keys(*names), seconds)


def spots(path: str, rows, names) -> Spots:
    """Cells of a pack, by row and key."""
    rows = np.array(rows, np.int32)
    return Spots([path], 0 * rows, rows, keys(*names))


def small(name, outputs=2) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(int(keys(name)[0, 0]))
    return {f"output {number}": rng.normal(size=number) for number in range(outputs)}


def written(folder: Path, *names, stage="render") -> Pack:
    return write_pack(folder, stage, names, map(small, names))


def same(cell, expected) -> bool:
    """Same names in the same order, and the same dtype, shape and bits of each."""
    return list(cell) == list(expected) and all(
        (cell[name].dtype, cell[name].shape, cell[name].tobytes())
        == (array.dtype, array.shape, array.tobytes())
        for name, array in expected.items()
    )


def whole(folder: Path, index, names) -> bool:
    """True if all cells are found, and read as they were written."""
    found = index.find(keys(*names))
    cells = read_cells(folder, found)
    return found.present.all() and all(
        same(cell, small(name)) for cell, name in zip(cells, names, strict=True)
    )


@pytest.fixture
def said():
    """Sentences of an index; opened with `say=said.append`."""
    return []


@pytest.fixture
def six(tmp_path) -> Path:
    """Folder of cells 0 to 5 in three packs."""
    for n in range(0, 6, 2):
        written(tmp_path, n, n + 1)
    return tmp_path


# packs --------------------------------------------------------------------------------------------

DTYPES = (
    arrays_of.scalar_dtypes()
    | arrays_of.unicode_string_dtypes()
    | st.sampled_from([np.dtype(np.longdouble), np.dtype("V5"), np.dtype("S3")])
)
SHAPES = arrays_of.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3)
LAYOUTS = st.dictionaries(st.text(max_size=4), st.tuples(DTYPES, SHAPES), max_size=3)


@st.composite
def contents(draw):
    """Cells of one layout or of several."""
    layouts = draw(st.lists(LAYOUTS, min_size=1, max_size=3))
    chosen = draw(st.lists(st.sampled_from(layouts), min_size=1, max_size=6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return [
        {
            name: np.ndarray(shape, dtype, rng.bytes(int(np.prod(shape)) * dtype.itemsize))
            for name, (dtype, shape) in layout.items()
        }
        for layout in chosen
    ]


@settings(max_examples=60, deadline=None)
@given(contents=contents(), data=st.data())
def test_what_is_written_is_read_back_aligned_and_apart(contents, data):
    asked = data.draw(st.lists(st.integers(0, len(contents) - 1), max_size=8))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        names = range(len(contents))
        pack = write_pack(folder, "stage", names, contents)
        assert pack.size == (folder / pack.path).stat().st_size
        there, written = described_pack(folder, pack.path, pack.size)
        assert there == pack and np.array_equal(written, keys(*names))
        found = read_cells(folder, spots(pack.path, asked, asked))
    arrays = [array for cell in found for array in cell.values()]
    for row, cell in zip(asked, found, strict=True):
        assert same(cell, contents[row])
    for array in arrays:
        assert array.flags.aligned and array.flags.c_contiguous and array.flags.writeable
        assert not any(np.shares_memory(array, one) for one in arrays if one is not array)


@pytest.mark.parametrize(
    "values",
    [
        np.array([None]),
        np.zeros(2, dtype="f8,i4"),
        np.array(["a"], dtype=np.dtypes.StringDType()),
    ],
    ids=["objects", "fields", "text"],
)
def test_what_cannot_be_kept_is_refused(tmp_path, values):
    with pytest.raises(TypeError, match="cannot be kept"):
        write_pack(tmp_path, "stage", [1], [{"a": values}])
    assert list(tmp_path.iterdir()) == []


def test_every_changed_byte_is_noticed(tmp_path):
    """By its own cell alone if it is among the bytes of one, else by all cells."""
    made = [{"a": np.float64(n), "b": np.arange(n + 1)} for n in range(3)]
    pack = write_pack(tmp_path, "s", range(3), made)
    path = tmp_path / pack.path
    three = spots(pack.path, range(3), range(3))
    content = path.read_bytes()
    start = content.index(b"\n") + 1 + 3 * (KEY.itemsize + ROW.itemsize)  # behind line and tables
    ends = start + np.cumsum([0, 32, 32, 48])
    assert ends[-1] == len(content)
    for place in range(len(content)):
        owner = int(np.searchsorted(ends, place, side="right")) - 1
        flipped = bytearray(content)
        flipped[place] ^= 1 << place % 8
        path.write_bytes(flipped)
        found = read_cells(tmp_path, three)
        assert [cell is None for cell in found] == [owner in (-1, row) for row in range(3)]
        assert all(cell is None or same(cell, one) for cell, one in zip(found, made, strict=True))


def test_what_is_cut_off_is_absent(tmp_path):
    pack = written(tmp_path, 0, 1, 2)
    path = tmp_path / pack.path
    three = spots(pack.path, range(3), range(3))
    content = path.read_bytes()
    for length in range(0, len(content), 7):
        path.write_bytes(content[:length])
        for number, cell in enumerate(read_cells(tmp_path, three)):
            assert cell is None or same(cell, small(number))
        assert cell is None
    path.unlink()
    for strange in (pack.path, ".", "nul\0"):
        assert read_cells(tmp_path, spots(strange, [0, 3], [0, 1])) == [None] * 2


# packs that are not what they were ---------------------------------------------------------------


def exchange(one: Path, other: Path) -> None:
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)


def stage_of(path: Path) -> str:
    return str(unseal(path.read_bytes().partition(b"\n")[0] + b"\n")[0])


def test_a_cell_of_another_key_is_not_read(tmp_path):
    one, other = written(tmp_path, 1, 2), written(tmp_path, 3, 4)
    exchange(tmp_path / one.path, tmp_path / other.path)
    assert read_cells(tmp_path, spots(one.path, [0, 1], [1, 2])) == [None] * 2
    assert read_cells(tmp_path, spots(other.path, [0], [3])) == [None]
    [found] = read_cells(tmp_path, spots(other.path, [0], [1]))
    assert same(found, small(1))


def test_packs_exchanged_while_a_sweep_runs_do_not_change_its_store(tmp_path, monkeypatch):
    cache, told = tmp_path / "cache", Told()
    go(tmp_path / "s.zarr", cache)
    first = {stage_of(cache / path): cache / path for path in files_of(cache, "pack")}
    go(tmp_path / "t.zarr", cache, seed=1)  # cells of the same shapes

    def found(index, keys, find=CellIndex.find):
        if index.folder == cache and not told.failures:
            told.failures.append("exchanged")  # at the first look-up, after the index is read
            for path in (cache / path for path in files_of(cache, "pack")):
                if path not in first.values():
                    exchange(path, first[stage_of(path)])
        return find(index, keys)

    monkeypatch.setattr(CellIndex, "find", found)
    go(tmp_path / "again.zarr", cache, watch=told.watch)
    assert files(tmp_path / "again.zarr") == files(tmp_path / "s.zarr")
    again = [one for one in told.sentences if "are damaged and are computed again" in one]
    assert len(again) == 1, "one round mends the cells of all stages"


def described(folder, pack, row, layouts):
    """Write what a pack of one cell says of it again; return what is read of the cell."""
    line, _, rest = (folder / pack.path).read_bytes().partition(b"\n")
    stage, seconds, cells, (of_keys, _), _ = unseal(line + b"\n")
    table = np.array([row], ROW).tobytes()
    line = seal([stage, seconds, cells, [of_keys, crc32(table)], layouts])
    records = rest[KEY.itemsize + ROW.itemsize :]
    (folder / pack.path).write_bytes(line + rest[: KEY.itemsize] + table + records)
    return read_cells(folder, spots(pack.path, [0], [1]))


@pytest.mark.parametrize("dtype", ["|O", "<f8,<i4", "(2,)<f8", "nonsense"])
def test_a_dtype_that_no_output_has_is_damage(tmp_path, dtype):
    """File bytes would be taken for pointers of objects."""
    pack = write_pack(tmp_path, "stage", [1], [{"a": np.zeros(2)}])
    row, layout = (0, 16, crc32(bytes(16)), 0), ["a", "<f8", [2], 0]
    assert described(tmp_path, pack, row, [[layout]])[0]["a"].tolist() == [0, 0]
    layout[1] = dtype
    assert described(tmp_path, pack, row, [[layout]]) == [None]


def test_a_size_beyond_the_file_takes_no_memory(tmp_path, monkeypatch):
    pack = written(tmp_path, 1)
    monkeypatch.setattr(np, "empty", None)
    assert described(tmp_path, pack, (0, 10**12, 0, 0), [[]]) == [None]


@pytest.mark.parametrize("cells", [10**12, -1, "2", None])
def test_a_pack_of_more_cells_than_it_has_is_damaged(tmp_path, cells):
    path = written(tmp_path, 1).path
    line, _, rest = (tmp_path / path).read_bytes().partition(b"\n")
    (tmp_path / path).write_bytes(seal(["a", 0.0, cells, *unseal(line + b"\n")[3:]]) + rest)
    assert read_cells(tmp_path, spots(path, [0], [1])) == [None]
    pack, there = described_pack(tmp_path, path, 0)
    assert pack == Pack(path) and len(there) == 0


def test_a_sweep_without_descriptors_recomputes_and_deletes_nothing(tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    go(tmp_path / "s.zarr", cache)
    before = files(cache)
    with monkeypatch.context() as patch:
        opened, short = Path.open, False

        def refused(path, *arguments, **named):
            if short and path.suffix == ".pack" and arguments == ("rb",):
                raise OSError(errno.EMFILE, os.strerror(errno.EMFILE), str(path))
            return opened(path, *arguments, **named)

        def found(index, keys, find=CellIndex.find):
            nonlocal short
            short = True  # from the first look-up on, after the index is read
            return find(index, keys)

        patch.setattr(Path, "open", refused)
        patch.setattr(CellIndex, "find", found)
        with pytest.raises(OSError, match="Too many open files"):
            go(tmp_path / "t.zarr", cache)
    assert files(cache) == before and not (tmp_path / "t.zarr").exists()
    go(tmp_path / "t.zarr", cache)
    assert files(tmp_path / "t.zarr") == files(tmp_path / "s.zarr")


# the index ----------------------------------------------------------------------------------------


def test_the_newest_of_equal_cells_is_found_and_all_are_forgotten(tmp_path, said):
    older, newer = written(tmp_path, 1), written(tmp_path, 1, 2)
    added = CellIndex(tmp_path / "none", said.append)
    assert [added.add(older, keys(1)), added.add(newer, keys(1, 2))] == [0, 1]
    for index in (added, CellIndex(tmp_path, said.append)):
        index.refresh()
        found = index.find(keys(3, 2, 1))
        assert found.pack.tolist() == [-1, 1, 1] and found.row[1:].tolist() == [1, 0]
        assert index.packs == [older, newer] and found.paths == [older.path, newer.path]
        index.forget(keys(1))
        assert index.find(keys(1, 2)).pack.tolist() == [-1, 1]


@settings(deadline=None)
@given(st.data())
def test_an_index_finds_what_a_dictionary_finds(data):
    """Whatever is in how many packs; another key of the same first half is not found."""
    one = st.integers(0, 4).map(lambda n: (n * (2**62 - 1), n))
    some = st.lists(one, max_size=6)
    with tempfile.TemporaryDirectory() as name:
        index = CellIndex(Path(name), print)
        expected = {}
        for number, pack in enumerate(data.draw(st.lists(some, max_size=4))):
            index.add(Pack(f"{number}"), np.array(pack, np.uint64).reshape(-1, 2))
            expected |= {key: (number, row) for row, key in enumerate(pack)}
            if data.draw(st.booleans()):
                index.refresh()
        index.refresh()
        asked = [*data.draw(some), (0, 1)]
        found = index.find(np.array(asked, np.uint64).reshape(-1, 2))
        at = [(n, row) if n >= 0 else None for n, row in zip(found.pack, found.row, strict=True)]
        assert at == [expected.get(key) for key in asked]


def test_costs_are_means_of_the_latest_packs(tmp_path, said):
    for seconds in (1000.0, *10 * [3.0]):
        pack = write_pack(tmp_path, "a", range(6), map(small, range(6)), seconds)
    assert CellIndex(tmp_path, said.append).costs() == {"a": (0.5, pack.size / 6)}


KILLED = """
import os, signal, sys
from pathlib import Path
import numpy as np
from sweeps.engine.packs import Packing
done, killed = sys.argv[2:]
for key in (done, killed):
    if key == killed:
        Path.replace = lambda *arguments: os.kill(os.getpid(), signal.SIGKILL)
    packing = Packing()
    packing.add({"a": np.float64(4)})
    packing.write(Path(sys.argv[1]), "stage", np.frombuffer(bytes.fromhex(key), "u8")[None])
"""


def test_packs_of_a_killed_run_are_found(six, said):
    both = keys("done", "killed")
    given = (key.tobytes().hex() for key in both)
    assert python("-c", KILLED, six, *given, check=False).returncode == -signal.SIGKILL
    index = CellIndex(six, said.append)
    index.refresh()
    found = index.find(both)
    assert found.present.tolist() == [True, False]
    assert read_cells(six, found[:1])[0]["a"] == 4
    assert whole(six, index, range(6))
    # The partial file goes once nobody can be writing to it.
    [partial] = files_of(six, "partial")
    index.shrink(2**40, 0.0)
    assert list(files_of(six, "partial")) == [partial]
    os.utime(six / partial, (0, time.time() - 86400 - 60))
    index.shrink(2**40, 0.0)
    assert not files_of(six, "partial") and said == []


@pytest.mark.parametrize(
    "line", [None, 1, [], ["a", 1.0], ["a", -1, 0, [0, 0], []], ["a", 0.0, 1, [0, 0], []]]
)
def test_a_pack_that_says_something_else_has_no_cells_and_is_evicted(six, said, line):
    path = written(six, "lost").path
    content = (six / path).read_bytes().split(b"\n", 1)[1]
    (six / path).write_bytes(seal(line) + content)
    os.utime(six / path, (1, 1))
    index = CellIndex(six, said.append)
    index.refresh()
    assert whole(six, index, range(6)) and not index.find(keys("lost")).present
    cells, size = index.size()
    assert cells == 6
    assert index.costs().keys() == {"render"}
    index.shrink(size - 1, time.time() + 9)
    assert not (six / path).exists() and whole(six, index, range(6))
    assert len(said) == 1 and "damaged" in said[0]


def test_a_cache_is_made_for_this_user_alone(tmp_path, umask):
    umask(0)
    written(tmp_path / "home" / "cache", 1)
    made = [*(tmp_path / "home").rglob("*")]
    modes = {one.is_dir(): stat.S_IMODE(one.stat().st_mode) for one in made}
    assert len(made) == 3 and modes == {True: 0o700, False: 0o600}
    assert stat.S_IMODE((tmp_path / "home").stat().st_mode) == 0o700


def test_a_folder_of_another_user_is_not_read(six, said, monkeypatch):
    index = CellIndex(six, said.append)
    index.refresh()
    found = index.find(keys(*range(6)))
    assert found.present.all() and None not in read_cells(six, found)
    monkeypatch.setattr(os, "geteuid", lambda: os.stat(six).st_uid + 1)
    index = CellIndex(six, said.append)
    index.refresh()
    assert not index.find(keys(*range(6))).present.any() and index.costs() == {}
    assert said == [f"Results in {six} are not read: the folder belongs to another user."]


# eviction -----------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(
    sizes=st.lists(st.integers(0, 200), min_size=5, max_size=5),
    last=st.permutations(range(1, 6)),
    percent=st.integers(0, 100),
    keep_since=st.integers(1, 6),
)
def test_the_packs_not_used_for_longest_go_first(sizes, last, percent, keep_since):
    """Against a plain model; packs used since a moment stay, though the limit is exceeded."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        index = CellIndex(folder, print)
        kept = [
            write_pack(folder, "s", [n], [{"a": np.zeros(size, dtype="u1")}])
            for n, size in enumerate(sizes)
        ]
        for pack in kept:
            index.add(pack)
        index.refresh()
        for pack, moment in zip(kept, last, strict=True):
            os.utime(folder / pack.path, (moment, moment))
        total = sum(pack.size for pack in kept)
        limit = total * percent // 100
        stay = sorted(range(5), key=last.__getitem__)
        while stay and total > limit and last[stay[0]] < keep_since:
            total -= kept[stay.pop(0)].size
        index.shrink(limit, float(keep_since))
        assert set(np.flatnonzero(index.find(keys(*range(5))).present)) == set(stay)
        assert set(files_of(folder, "pack")) == {kept[n].path for n in stay}


# several at once ----------------------------------------------------------------------------------


def drive(folder: Path, driver: int) -> list[str]:
    """Add packs as one of several drivers; sentences that were said."""
    said: list[str] = []
    for number in range(4):
        index = CellIndex(folder, said.append)
        for name in (driver, "shared"):
            index.add(written(folder, (name, number)))
        index.shrink(2**40, 0.0)
        index.refresh()
        assert whole(folder, index, [(driver, number), ("shared", number)])
    return said


def test_several_drivers_share_a_folder(tmp_path, said):
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert list(pool.map(drive, [tmp_path] * 4, range(4))) == [[]] * 4
    index = CellIndex(tmp_path, said.append)
    index.refresh()
    names = [(driver, number) for driver in [*range(4), "shared"] for number in range(4)]
    assert whole(tmp_path, index, names)
    assert index.size()[0] == 32 and said == []
