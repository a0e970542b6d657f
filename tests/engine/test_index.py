"""The index of a cache finds the pack of each cell, and deletes the oldest packs on pruning."""

import stat
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from packed import keys, small, whole, write_pack, written

from sweeps.engine.cache import packs
from sweeps.engine.cache.index import MARKER, CellIndex
from sweeps.engine.cache.packs import Pack, PackWriter, open_packs
from sweeps.engine.objects import Objects


@pytest.fixture
def warnings():
    """Return a list that collects the warnings of an index."""
    return []


@pytest.fixture
def six(tmp_path) -> Objects:
    """Return a cache of three packs with the cells 0 to 5."""
    cells = open_packs(tmp_path)
    for n in range(0, 6, 2):
        written(cells, n, n + 1)
    return cells


def test_newest_duplicate_is_found_and_drop_removes_all(place, warnings):
    cells = open_packs(place)
    older, newer = written(cells, 1), written(cells, 1, 2)
    added = CellIndex(Objects(Path("none")), warnings.append)
    assert [added.add(older, keys(1)), added.add(newer, keys(1, 2))] == [0, 1]
    for index in (added, CellIndex(cells, warnings.append)):
        index.refresh()
        locations = index.find(keys(3, 2, 1))
        assert locations.pack.tolist() == [-1, 1, 1] and locations.row[1:].tolist() == [1, 0]
        assert index.packs == [older, newer] and locations.paths == [older.path, newer.path]
        index.drop(keys(1))
        assert index.find(keys(1, 2)).pack.tolist() == [-1, 1]


def test_recomputed_result_is_found_despite_clock_skew(tmp_path, warnings, monkeypatch):
    """The new result is found though the damaged one was written by a clock an hour ahead."""
    cells = open_packs(tmp_path)
    monkeypatch.setattr(packs, "time_ns", lambda: time.time_ns() + 3600 * 10**9)
    damaged = written(cells, 1)
    path = cells.path / damaged.path
    path.write_bytes(path.read_bytes()[:-1] + b"?")
    monkeypatch.undo()
    time.sleep(0.05)  # longer than a tick of the disk's clock
    written(cells, 1)
    index = CellIndex(cells, warnings.append)
    assert whole(cells, index, [1]) and warnings == []


@settings(deadline=None)
@given(st.data())
def test_index_lookup_matches_a_dict(data):
    """This holds for any cells in any packs; a key with only an equal first half is not found."""
    key = st.integers(0, 4).map(lambda n: (n * (2**62 - 1), n))
    some = st.lists(key, max_size=6)
    with tempfile.TemporaryDirectory() as name:
        index = CellIndex(Objects(Path(name)), print)
        expected = {}
        for number, pack in enumerate(data.draw(st.lists(some, max_size=4))):
            index.add(Pack(f"{number}"), np.array(pack, np.uint64).reshape(-1, 2))
            expected |= {key: (number, row) for row, key in enumerate(pack)}
            if data.draw(st.booleans()):
                index.refresh()
        index.refresh()
        queries = [*data.draw(some), (0, 1)]
        locations = index.find(np.array(queries, np.uint64).reshape(-1, 2))
        rows = [
            (n, row) if n >= 0 else None
            for n, row in zip(locations.pack, locations.row, strict=True)
        ]
        assert rows == [expected.get(key) for key in queries]


def test_costs_are_means_of_the_latest_packs(tmp_path, warnings):
    cells = open_packs(tmp_path)
    for seconds in (1000.0, *10 * [3.0]):
        pack = write_pack(cells, "a", range(6), map(small, range(6)), seconds)
    assert CellIndex(cells, warnings.append).costs() == {"a": (0.5, pack.size / 6)}


def test_pruning_removes_leftovers_of_killed_writers(six, warnings):
    leftovers = [six.path / name for name in ("0.pack#1", f"0{MARKER}")]
    for path in leftovers:
        path.write_bytes(b"")
    (six.path / "peak#1").mkdir()  # a variable of a store may have such a folder
    index = CellIndex(six, warnings.append)
    assert index.prune(2**40) == (0, 0)
    assert not any(path.exists() for path in leftovers)
    assert whole(six, index, range(6)) and warnings == []


def test_invalid_packs_are_reported_and_have_no_cells(six, warnings):
    lost = written(six, "lost").path
    (six.path / lost).write_bytes(b"something else")
    (six.path / "notes.pack").write_text("of another version")
    index = CellIndex(six, warnings.append)
    assert whole(six, index, range(6)) and not index.find(keys("lost")).present
    cells, size = index.size()
    assert cells == 6 and index.costs().keys() == {"render"}
    assert index.prune(0) == (6, size) and not six.sizes()
    assert warnings == ["2 files of results in the cache are damaged, or of another version"]


@settings(max_examples=20, deadline=None)
@given(sizes=st.lists(st.integers(0, 200), min_size=5, max_size=5), percent=st.integers(0, 100))
@example(sizes=[1, 2, 3, 4, 5], percent=100)
def test_pruning_deletes_the_oldest_packs_first(sizes, percent):
    """Pruning deletes the same packs as a simple model does."""
    with tempfile.TemporaryDirectory() as name:
        cells = Objects(Path(name))
        packs = [
            write_pack(cells, "s", [n], [{"a": np.zeros(size, dtype="u1")}])
            for n, size in enumerate(sizes)
        ]
        stay, limit = [*packs], sum(pack.size for pack in packs) * percent // 100
        while sum(pack.size for pack in stay) > limit:
            stay.pop(0)
        gone = packs[: len(packs) - len(stay)]
        done = CellIndex(cells, print).prune(limit)
        assert done == (len(gone), sum(pack.size for pack in gone))
        assert cells.sizes().keys() == {pack.path for pack in stay}


def test_index_reads_only_packs_in_its_folders(tmp_path, warnings):
    """Packs in folders of other stages or other code are not read and may be damaged."""
    cells = open_packs(tmp_path)
    packing = PackWriter()
    packing.add(small(1))
    mine = packing.write(cells, "stage", keys(1), folder="a1")
    packing.write(cells, "stage", keys(2), folder="b2")
    cells.put("b2/bad.pack", b"")
    index = CellIndex(cells, warnings.append, ["a1", "absent"])
    assert index.packs == [mine] and warnings == []
    index.refresh()
    assert index.find(keys(1, 2)).present.tolist() == [True, False]
    assert index.costs().keys() == {"stage"}


# permissions --------------------------------------------------------------------------------------


def test_cache_is_created_private_to_the_user(tmp_path, umask, warnings):
    umask(0)
    cells = open_packs(tmp_path / "home" / "cache")
    written(cells, 1)
    paths = [tmp_path / "home", *(tmp_path / "home").rglob("*")]
    assert {stat.S_IMODE(path.stat().st_mode) for path in paths if path.is_dir()} == {0o700}
    assert whole(cells, CellIndex(cells, warnings.append), [1]) and warnings == []


# concurrent drivers -------------------------------------------------------------------------------


def drive(cache, driver):
    """Add packs as one of several drivers; return the warnings of its indices."""
    warnings = []
    cells = open_packs(cache)
    for number in range(2):
        index = CellIndex(cells, warnings.append)
        for name in (driver, "shared"):
            index.add(written(cells, (name, number)))
        assert whole(cells, index, [(driver, number), ("shared", number)])
    return warnings


def test_several_drivers_share_a_cache(place, warnings):
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(drive, [place] * 4, range(4))) == [[]] * 4
    cells = open_packs(place)
    index = CellIndex(cells, warnings.append)
    names = [(driver, number) for driver in [*range(4), "shared"] for number in range(2)]
    assert whole(cells, index, names)
    assert index.size()[0] == 16 and warnings == []
