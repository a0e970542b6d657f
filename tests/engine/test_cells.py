"""Finished cells on disk: what is written is read back, whatever else happens to the files."""

import errno
import hashlib
import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
import tracemalloc
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from sweeps.engine import results
from sweeps.engine.packs import (
    Pack,
    Spot,
    list_files,
    make_folder,
    read_cells,
    seal,
    write_pack,
)
from sweeps.engine.results import FADING, INDEX, open_index


def key(name) -> str:
    return hashlib.md5(str(name).encode()).hexdigest()


def small(name, outputs=2) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(int(key(name)[:8], 16))
    return {f"output {number}": rng.normal(size=number) for number in range(outputs)}


def written(folder: Path, *names, stage="render") -> Pack:
    return write_pack(folder, stage, [(key(name), small(name)) for name in names])


def same(cell, expected) -> bool:
    """Same names in the same order, and the same dtype, shape and bits of each."""
    return list(cell) == list(expected) and all(
        (cell[name].dtype, cell[name].shape, cell[name].tobytes())
        == (array.dtype, array.shape, array.tobytes())
        for name, array in expected.items()
    )


def whole(folder: Path, index, names) -> bool:
    """True if all cells are found, and read as they were written."""
    found = index.find([key(name) for name in names])
    cells = read_cells(folder, [found[key(name)] for name in names])
    return all(same(cell, small(name)) for cell, name in zip(cells, names, strict=True))


@pytest.fixture
def said():
    """Sentences of an index; opened with `say=said.append`."""
    return []


@pytest.fixture
def six(tmp_path, said) -> Path:
    """Folder of cells 0 to 5 in three packs, with an index."""
    with open_index(tmp_path, said.append) as index:
        index.add("render", [written(tmp_path, n, n + 1) for n in range(0, 6, 2)], 1.0)
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
        pack = write_pack(folder, "stage", [(key(n), cell) for n, cell in enumerate(contents)])
        assert pack.keys == tuple(map(key, range(len(contents))))
        assert pack.size == (folder / pack.path).stat().st_size
        found = read_cells(folder, [Spot(pack.path, row, pack.keys[row]) for row in asked])
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
    with pytest.raises(TypeError, match="output a has dtype"):
        write_pack(tmp_path, "stage", [(key(1), {"a": values})])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("step", ["pathlib.Path.replace", "builtins.open"])
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_nothing_is_left_of_a_failed_write(tmp_path, monkeypatch, step, error):
    def fail(*arguments, **others):
        raise error

    monkeypatch.setattr(step, fail)
    with pytest.raises(error):
        written(tmp_path, 1)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_every_changed_byte_is_noticed(tmp_path):
    """By its own cell alone if it is among the bytes of one, else by all cells."""
    made = [{"a": np.float64(n), "b": np.arange(n + 1)} for n in range(3)]
    pack = write_pack(tmp_path, "s", [(key(n), cell) for n, cell in enumerate(made)])
    path = tmp_path / pack.path
    spots = [Spot(pack.path, row, key(row)) for row in range(3)]
    content = path.read_bytes()
    start = content.index(b"\n") + 1
    ends = start + np.cumsum([0, 32, 32, 48])
    assert ends[-1] == len(content)
    for place in range(len(content)):
        owner = int(np.searchsorted(ends, place, side="right")) - 1
        flipped = bytearray(content)
        flipped[place] ^= 1 << place % 8
        path.write_bytes(flipped)
        found = read_cells(tmp_path, spots)
        assert [cell is None for cell in found] == [owner in (-1, row) for row in range(3)]
        assert all(cell is None or same(cell, one) for cell, one in zip(found, made, strict=True))


def test_what_is_cut_off_is_absent(tmp_path):
    pack = written(tmp_path, 0, 1, 2)
    path = tmp_path / pack.path
    spots = [Spot(pack.path, row, key(row)) for row in range(3)]
    content = path.read_bytes()
    for length in range(0, len(content), 7):
        path.write_bytes(content[:length])
        for number, cell in enumerate(read_cells(tmp_path, spots)):
            assert cell is None or same(cell, small(number))
        assert cell is None
    path.unlink()
    strange = [spots[0], Spot(".", 0, ""), Spot("nul\0", 3, "")]
    assert read_cells(tmp_path, strange) == [None] * 3


def test_only_the_asked_cells_are_read(tmp_path):
    made = [{"a": np.full(2**18, n)} for n in range(20)]
    pack = write_pack(tmp_path, "stage", [(key(n), cell) for n, cell in enumerate(made)])
    tracemalloc.start()
    found = read_cells(tmp_path, [Spot(pack.path, row, key(row)) for row in (3, 17)])
    assert tracemalloc.get_traced_memory()[1] < 3 * made[0]["a"].nbytes
    tracemalloc.stop()
    assert [cell["a"][0] for cell in found] == [3, 17]


# the index ----------------------------------------------------------------------------------------


def test_cells_are_found_until_they_are_forgotten(tmp_path, said):
    folder = tmp_path / "new" / "folder"
    with open_index(folder, said.append) as index:
        assert index.find([key(1)]) == {} and index.find([]) == {}
        packs = [written(folder, 1, 2), written(folder, *range(3, 300))]
        index.add("render", packs, 2.0)
        assert whole(folder, index, range(1, 300)) and index.find([key(300)]) == {}
    with open_index(folder, said.append) as index:
        assert whole(folder, index, range(1, 300)) and key(300) not in index.find([key(300)])
        assert index.summary() == [("render", 299, sum(pack.size for pack in packs))]
        index.forget([key(1)])
        assert index.find([key(1), key(2)]) == {key(2): Spot(packs[0].path, 1, key(2))}
    with open_index(folder, said.append) as index:
        assert index.find([key(1)]) == {}
        again = written(folder, 1)
        index.add("render", [again], 1.0)
        assert index.find([key(1)]) == {key(1): Spot(again.path, 0, key(1))} and whole(
            folder, index, [2]
        )
    assert said == []


def test_nothing_is_written_to_look(tmp_path, said):
    with open_index(tmp_path / "absent", said.append) as index:
        assert index.find([key(1)]) == {} and index.summary() == [] and index.costs() == {}
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("indexed", [True, False])
def test_the_newest_of_equal_cells_is_found_and_all_are_forgotten(tmp_path, said, indexed):
    with open_index(tmp_path, said.append) as index:
        older, newer = written(tmp_path, 1), written(tmp_path, 1, 2)
        index.add("render", [older, newer], 1.0)
        assert index.find([key(1)]) == {key(1): Spot(newer.path, 0, key(1))}
    if not indexed:
        (tmp_path / INDEX).unlink()
    with open_index(tmp_path, said.append) as index:
        assert index.find([key(1)]) == {key(1): Spot(newer.path, 0, key(1))}
        index.forget([key(1)])
        assert index.find([key(1)]) == {}


def test_costs_are_means_in_which_older_ones_fade(tmp_path, said):
    batches = [(2, 8.0, 100), (5, 5.0, 700), (1, 3.0, 20), (9, 2.0, 50)]
    weights = [FADING ** (len(batches) - 1 - n) for n in range(len(batches))]
    cells, seconds, size = np.transpose(batches) @ weights
    with open_index(tmp_path, said.append) as index:
        for number, (count, took, bytes_) in enumerate(batches):
            keys = tuple(key((number, one)) for one in range(count))
            index.add("a", [Pack(f"cells/{number}", bytes_, keys)], took)
        index.add("b", [Pack("cells/b", 15, (key("b"),))], 0.5)
    with open_index(tmp_path, said.append) as index:
        costs = index.costs()
    assert costs == {"a": pytest.approx((seconds / cells, size / cells)), "b": (0.5, 15.0)}


KILLED = """
import os, signal, sys
from pathlib import Path
import numpy as np
from sweeps.engine.results import open_index
from sweeps.engine.packs import write_pack
folder, keys = Path(sys.argv[1]), sys.argv[3:]
die = lambda *arguments: os.kill(os.getpid(), signal.SIGKILL)
with open_index(folder, print) as index:
    if sys.argv[2] == "writing":
        Path.replace = die
    made = [write_pack(folder, "stage", [(key, {"a": np.float64(4)})]) for key in keys]
    index.add("stage", made, 1.0)
    if sys.argv[2] == "saving":
        Path.replace = die
        index.save()
    die()
"""


@pytest.mark.parametrize("moment", ["writing", "before", "saving"])
def test_packs_of_a_killed_run_are_found(six, said, moment):
    keys = [key(("killed", n)) for n in range(3)]
    command = [sys.executable, "-c", KILLED, str(six), moment, *keys]
    root = Path(__file__).resolve().parents[2]
    assert subprocess.run(command, cwd=root, timeout=60).returncode == -signal.SIGKILL
    with open_index(six, said.append) as index:
        found = index.find(keys)
        assert sorted(found) == ([] if moment == "writing" else sorted(keys))
        assert all(cell["a"] == 4 for cell in read_cells(six, list(found.values())))
        assert whole(six, index, range(6))
        # The partial file goes once nobody can be writing to it.
        partials = list(list_files(six)[1])
        assert len(partials) == (moment != "before")
        index.shrink(2**40, 0.0)
        assert list(list_files(six)[1]) == partials
        for path in partials:
            os.utime(six / path, (0, time.time() - 86400 - 60))
        index.shrink(2**40, 0.0)
    assert not list_files(six)[1] and said == []


def test_packs_that_are_gone_or_unreadable(tmp_path, said):
    with open_index(tmp_path, said.append) as index:
        gone, stays, broken = (written(tmp_path, name) for name in "abc")
        index.add("render", [gone, stays], 1.0)
    (tmp_path / gone.path).unlink()
    (tmp_path / broken.path).write_bytes(b"broken")
    os.mkfifo(tmp_path / "cells" / f"{0:032x}.pack")
    with open_index(tmp_path, said.append) as index:
        assert list(index.find([key(name) for name in "abc"])) == [key("b")]
        assert index.summary() == [("(unreadable)", 0, 6), ("render", 1, stays.size)]
        index.shrink(0, time.time() + 60)
    assert said == [] and not list_files(tmp_path)[0]


def test_any_damage_to_the_index_leaves_all_cells_found(six, said):
    content = (six / INDEX).read_bytes()
    damaged = [b"", b"not an index", content[:-9], bytes(len(content)), content + b"\0"]
    for place in range(0, len(content), 3):
        flipped = bytearray(content)
        flipped[place] ^= 1 << place % 8
        damaged.append(bytes(flipped))
    for other in damaged:
        (six / INDEX).write_bytes(other)
        with open_index(six, said.append) as index:
            assert whole(six, index, range(6)) and index.costs() == {}
    assert said == []


MALFORMED = [
    *(
        None,
        1,
        [],
        {},
        [{}, {}, {}],
        [None, {}],
        [{}, None],
        [{"a": None}, {}],
        [{"a": [1, 2]}, {}],
    ),
    *([{"a": [0, 1, 1]}, {}], [{"a": ["1", 1, 1]}, {}], [{"a": [1, 1, -1]}, {}]),
    *([{"a": [1, float("nan"), 1]}, {}], [{}, {"PATH": None}], [{}, {"PATH": ["a", 1]}]),
    *([{}, {"PATH": [1, 1, []]}], [{}, {"PATH": ["a", 1, [1]]}], [{}, {"PATH": ["a", 1, "key"]}]),
]


@pytest.mark.parametrize("document", MALFORMED, ids=str)
def test_a_sealed_index_of_anything_else_leaves_all_cells_found(six, said, document):
    path = sorted(list_files(six)[0])[0]
    content = seal(json.loads(json.dumps(document).replace("PATH", path)))
    (six / INDEX).write_bytes(content)
    with open_index(six, said.append) as index:
        assert whole(six, index, range(6)) and index.costs() == {}
        index.shrink(0, 0.0)
        index.summary()


@pytest.mark.parametrize(
    "header", [None, [], {}, {"stage": "a"}, {"stage": 1, "keys": ["k"]}], ids=str
)
def test_a_sealed_pack_of_anything_else_has_no_cells(six, said, header):
    path = six / "cells" / f"{0:032x}.pack"
    path.write_bytes(seal(header))
    (six / INDEX).unlink()
    with open_index(six, said.append) as index:
        assert whole(six, index, range(6))
    assert read_cells(six, [Spot(f"cells/{path.name}", 0, "k")]) == [None] and said == []


def test_a_cache_is_made_for_this_user_alone(tmp_path, said):
    before = os.umask(0)
    try:
        with open_index(tmp_path / "home" / "cache", said.append) as index:
            index.add("a", [written(tmp_path / "home" / "cache", 1)], 1.0)
    finally:
        os.umask(before)
    made = [*(tmp_path / "home").rglob("*")]
    modes = {one.is_dir(): stat.S_IMODE(one.stat().st_mode) for one in made}
    assert len(made) == 4 and modes == {True: 0o700, False: 0o600}
    assert stat.S_IMODE((tmp_path / "home").stat().st_mode) == 0o700


def test_a_stricter_umask_stays(tmp_path):
    before = os.umask(0o377)
    try:
        make_folder(tmp_path / "cache", 0o700)
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "cache").stat().st_mode) == 0o400


def test_files_of_another_user_are_not_read(six, said, monkeypatch):
    with open_index(six, said.append) as index:
        spots = list(index.find([key(one) for one in range(6)]).values())
        assert spots and None not in read_cells(six, spots)
    monkeypatch.setattr(os, "geteuid", lambda: os.stat(six).st_uid + 1)
    assert not any(read_cells(six, spots))
    with open_index(six, said.append) as index:
        assert not index.find([key(one) for one in range(6)]) and index.costs() == {}


def test_an_index_that_cannot_be_saved_costs_nothing(six, said, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    more = written(six, 6)
    monkeypatch.setattr(results, "write_whole", full)
    with open_index(six, said.append) as index:
        index.add("render", [more], 1.0)
        assert whole(six, index, range(7))
    monkeypatch.undo()
    with open_index(six, said.append) as index:
        assert whole(six, index, range(7))
    (six / "file").write_text("no folder")
    with open_index(six / "file" / "cache", said.append) as index:
        index.add("render", [Pack("cells/absent", 1, (key(1),))], 1.0)
        index.used(["cells/absent"])
        assert list(index.find([key(1)])) == [key(1)]
    assert said == []


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
        folder, keys = Path(name), [key(n) for n in range(5)]
        with open_index(folder, print) as index:
            kept = [
                write_pack(folder, "s", [(one, {"a": np.zeros(size, dtype="u1")})])
                for one, size in zip(keys, sizes, strict=True)
            ]
            index.add("s", kept, 1.0)
            for pack, moment in zip(kept, last, strict=True):
                os.utime(folder / pack.path, (moment, moment))
            total = sum(pack.size for pack in kept)
            limit = total * percent // 100
            stay = sorted(range(5), key=last.__getitem__)
            while stay and total > limit and last[stay[0]] < keep_since:
                total -= kept[stay.pop(0)].size
            index.shrink(limit, float(keep_since))
            assert set(index.find(keys)) == {keys[n] for n in stay}
            assert list_files(folder)[0] == {kept[n].path for n in stay}


def test_what_was_used_stays(six, said):
    for path in list_files(six)[0]:
        os.utime(six / path, (1, 1))
    with open_index(six, said.append) as index:
        before = time.time() - 1
        index.used([path for path, *_ in index.find([key(2)]).values()])
        index.shrink(0, before)
        assert sorted(index.find([key(n) for n in range(6)])) == sorted([key(2), key(3)])


def test_clear_leaves_what_is_not_ours(six, said):
    others = [six / "a.npz", six / "cells" / "notes.txt", six / "x.pack"]
    for path in others:
        path.write_text("not ours")
    with open_index(six, said.append) as index:
        index.clear()
        assert index.find([key(0)]) == {}
    assert sorted(path for path in six.rglob("*") if path.is_file()) == sorted(others)
    others[1].unlink()
    with open_index(six, said.append) as index:
        index.clear()
    assert sorted(path.name for path in six.iterdir()) == ["a.npz", "x.pack"] and said == []


def test_packs_that_cannot_be_deleted_stay_known(six, said, monkeypatch):
    def refuse(path, missing_ok=False):
        raise PermissionError(13, "Permission denied")

    with open_index(six, said.append) as index:
        monkeypatch.setattr(Path, "unlink", refuse)
        index.shrink(0, time.time() + 60)
        assert whole(six, index, range(6)) and len(said) == 1
        index.clear()
        assert len(said) == 2


# several at once ----------------------------------------------------------------------------------


def drive(folder: Path, driver: int) -> list[str]:
    """Add packs as one of several drivers; sentences that were said."""
    said: list[str] = []
    for number in range(4):
        with open_index(folder, said.append) as index:
            for name in (driver, "shared"):
                index.add("render", [written(folder, (name, number))], 1.0)
            index.shrink(2**40, 0.0)
            assert whole(folder, index, [(driver, number), ("shared", number)])
    return said


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_several_drivers_share_a_folder(tmp_path, said, kind):
    if kind == "threads":
        pool = ThreadPoolExecutor(4)
    else:
        pool = ProcessPoolExecutor(2, mp_context=get_context("spawn"))
    with pool:
        assert list(pool.map(drive, [tmp_path] * 4, range(4))) == [[]] * 4
    with open_index(tmp_path, said.append) as index:
        names = [(driver, number) for driver in [*range(4), "shared"] for number in range(4)]
        assert whole(tmp_path, index, names)
        assert [kept[:2] for kept in index.summary()] == [("render", 32)] and said == []
