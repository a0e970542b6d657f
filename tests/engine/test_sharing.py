"""Who uses a cache, and what may be deleted of it."""

import errno
import json
import multiprocessing
import os
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from packed import whole, write_pack, written
from small_stores import files
from toys import SPRINGS

from sweeps.engine import sharing
from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.index import CellIndex
from sweeps.engine.packs import PACK, cells_of
from sweeps.engine.places import Objects, below
from sweeps.engine.run import Place, sweep
from sweeps.engine.schedule import Watch
from sweeps.engine.settings import read_choices
from sweeps.engine.sharing import RUNNING, Record, Use, using


def packs_of(cells):
    return {name for name in cells.sizes() if name.endswith(PACK)}


@settings(max_examples=20, deadline=None)
@given(
    sizes=st.lists(st.integers(0, 200), min_size=5, max_size=5),
    used=st.sets(st.integers(0, 4)),
    percent=st.integers(0, 100),
)
def test_the_oldest_packs_go_first(sizes, used, percent):
    """Against a plain model; what the sweep itself uses stays, though the limit is exceeded."""
    with tempfile.TemporaryDirectory() as name:
        cells = Objects(Path(name))
        kept = [
            write_pack(cells, "s", [n], [{"a": np.zeros(size, dtype="u1")}])
            for n, size in enumerate(sizes)
        ]
        for pack in kept:  # before the sweep began
            os.utime(cells.place / pack.path, (1, 1))
        total = sum(pack.size for pack in kept)
        limit = total * percent // 100
        stay = list(range(5))
        for n in [n for n in stay if n not in used]:
            if total > limit:
                total -= kept[n].size
                stay.remove(n)
        with using(cells) as use:
            use.leaving()
            use.take(kept[n].path for n in used)
            use.shrink(limit)
        assert packs_of(cells) == {kept[n].path for n in stay}
        assert not cells.sizes(RUNNING)


def test_nothing_goes_that_another_sweep_uses(place):
    """Neither what it has found, nor what is new since it began, nor all before it has looked."""
    cells = cells_of(place)
    found, unused = written(cells, 1), written(cells, 2)
    if isinstance(place, Path):
        os.utime(cells.place / found.path, (1, 1))
        os.utime(cells.place / unused.path, (2, 2))
    else:
        time.sleep(1.1)  # times of a bucket are whole seconds
    with using(cells) as other:
        other.leaving()
        with using(cells) as use:
            use.leaving()
            use.shrink(0)
            assert packs_of(cells) == {found.path, unused.path}
            other.take([found.path])
            new = written(cells, 3)
            use.since += 3600  # so that what is new is so for the other alone
            use.shrink(0)
            assert packs_of(cells) == {found.path, new.path}
    with using(cells) as use:
        use.leaving()
        use.since += 3600
        use.shrink(0)
    assert packs_of(cells) == set()


def test_what_is_about_to_go_is_not_read(place):
    """A sweep that begins while another deletes is seen by it, or sees what it deletes."""
    cells = cells_of(place)
    one, two = written(cells, 1), written(cells, 2)
    with using(cells) as use:
        use.leaving()
        use._deleting.append(one.path)
        use.renew()
        with using(cells) as other:
            index = CellIndex(cells, print, other)
            assert index.paths == [two.path]


class Beginning(Objects):
    """Packs of a cache in which another sweep begins when a record says what is to be deleted."""

    begun: Use

    def put(self, name, content):
        super().put(name, content)
        if name.startswith(RUNNING) and json.loads(content)[2]:
            object.__setattr__(self, "begun", Use(Objects(self.place)))
            self.begun.renew()


def test_a_sweep_that_begins_just_before_the_deletion_loses_nothing(tmp_path):
    cells = Beginning(tmp_path, make=True)
    pack = written(cells, 1)
    os.utime(tmp_path / pack.path, (1, 1))
    with using(cells) as use:
        use.leaving()
        use.shrink(0)
    assert cells.begun.leaving() == set() and packs_of(cells) == {pack.path}


@pytest.mark.parametrize("way", ["old", "fresh"])
def test_a_sweep_that_was_killed_keeps_nothing_for_ever(tmp_path, way):
    cells = cells_of(tmp_path)
    pack = written(cells, 1)
    os.utime(cells.place / pack.path, (1, 1))
    dead = Use(cells)
    dead.renew()
    if way == "old":
        moment = time.time() - sharing.LEASE - 60
        os.utime(cells.place / dead.name, (moment, moment))
    with using(cells) as use:
        use.leaving()
        use.shrink(0)
    assert (dead.name in cells.sizes()) == (way == "fresh")
    assert packs_of(cells) == ({pack.path} if way == "fresh" else set())


def test_a_sweep_that_runs_renews_its_record(tmp_path, monkeypatch):
    """However long it takes: another one deletes nothing."""
    monkeypatch.setattr(sharing, "RENEWED", 0.02)
    monkeypatch.setattr(sharing, "LEASE", 0.5)
    cells = cells_of(tmp_path)
    pack = written(cells, 1)
    os.utime(cells.place / pack.path, (1, 1))
    with using(cells), using(cells) as use:
        use.leaving()
        time.sleep(1)
        use.shrink(0)
    assert packs_of(cells) == {pack.path}


@settings(max_examples=100, deadline=None)
@given(
    st.binary()
    | st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    ).map(lambda document: json.dumps(document).encode())
)
def test_a_record_that_says_nothing_uses_everything(content):
    record = Record.of(content)
    assert record.packs is None or isinstance(record.packs, frozenset)
    assert record.since is None or isinstance(record.since, float)
    assert set(record.deleting) or record.deleting is not None


class Full(Objects):
    """Packs of a cache on a disk that takes no record of what is to be deleted."""

    def put(self, name, content):
        if name.startswith(RUNNING) and json.loads(content)[2]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.place))
        super().put(name, content)


def test_what_others_cannot_be_told_is_not_deleted(tmp_path):
    cells = Full(tmp_path, make=True)
    pack = written(cells, 1)
    os.utime(tmp_path / pack.path, (1, 1))
    with using(cells) as use:
        use.leaving()
        with pytest.raises(OSError, match="No space"):
            use.shrink(0)
    assert packs_of(cells) == {pack.path}


def test_a_place_that_takes_no_records_stops_nothing(tmp_path):
    cells = Objects(tmp_path / "file" / "cells", make=True)
    (tmp_path / "file").write_bytes(b"")
    with using(cells) as use:
        use.take(["a"])
        with pytest.raises(OSError, match="Not a directory"):
            use.shrink(0)


def evict(cache, limit, turns, lost):
    """Sweep: find what is there, make what is not, use it and shrink the cache, many times."""
    cells = cells_of(cache)
    rng = np.random.default_rng(os.getpid())
    for _ in range(turns):
        with using(cells) as use:
            index = CellIndex(cells, lambda sentence: lost.put(sentence), use)
            wanted = rng.choice(12, 4, replace=False).tolist()
            there = [name for name in wanted if whole_if_found(cells, index, name)]
            index.used(index._found)
            for name in wanted:
                if name not in there:
                    index.add(written(cells, name))
            time.sleep(0.01 * rng.random())
            if not whole(cells, index, wanted):
                lost.put(f"{wanted} of which {there} were there")
            use.shrink(limit)


def whole_if_found(cells, index, name):
    from packed import SMALL, keys

    index.refresh()
    index._found = getattr(index, "_found", [])
    [pack] = index.find(keys(name), SMALL).pack.tolist()
    index._found.append(pack)
    return pack >= 0


def test_sweeps_that_share_a_small_cache_lose_nothing(place):
    """Several processes: what one has found stays until it ends, whatever the others delete."""
    context = multiprocessing.get_context("spawn")
    lost = context.Queue()
    turns = 30 if isinstance(place, Path) else 8
    runs = [context.Process(target=evict, args=(place, 1500, turns, lost)) for _ in range(3)]
    for run in runs:
        run.start()
    for run in runs:
        run.join(120)
    assert [run.exitcode for run in runs] == [0, 0, 0]
    assert lost.empty(), lost.get()
    cells = cells_of(place)
    assert not cells.sizes(RUNNING)
    assert len(packs_of(cells)) < 12 * 3, "something was deleted"


SHARED = [
    {"spring.stiffness": [1.0, 2.0]},
    {"spring.stiffness": [1.0, 2.0, 3.0], "measured.length": [2, 3]},
    {"spring.stiffness": [2.0, 3.0], "measured.length": [2, 3, 4]},
]


def swept(cache, folder, first, told):
    """Sweep some springs after others, all into new stores."""
    for turn in range(3):
        given = SHARED[(first + turn) % 3]
        choices = SPRINGS.check(read_choices(SPRINGS.declared, given))
        sentences = []
        place = Place(folder / f"{turn}.zarr", cache, ClusterChoice("inline"), cache_limit=10_000)
        finished = sweep(SPRINGS, choices, place, Watch(sentences.append))
        lost = [one for one in sentences if "damaged" in one or "cannot" in one]
        told.put((first, turn, lost, len(finished.failures)))


def test_two_commands_that_share_a_small_cache_lose_nothing(place, tmp_path):
    """At the same time, with values in common; each store is that of a sweep alone."""
    context = multiprocessing.get_context("spawn")
    told, cache = context.Queue(), below(place, "cache")
    for first in range(3):
        (tmp_path / str(first)).mkdir()
    swept(below(place, "alone"), tmp_path / "0", 0, told)
    clean = [files(tmp_path / "0" / f"{turn}.zarr") for turn in range(3)]
    for turn in range(3):
        assert told.get(timeout=60) == (0, turn, [], 0)
    runs = [
        context.Process(target=swept, args=(cache, tmp_path / str(first), first, told))
        for first in (1, 2)
    ]
    for run in runs:
        run.start()
    ended = [told.get(timeout=120) for _ in range(6)]
    for run in runs:
        run.join(60)
    assert sorted(ended) == [(first, turn, [], 0) for first in (1, 2) for turn in range(3)]
    for first in (1, 2):
        for turn in range(3):
            assert files(tmp_path / str(first) / f"{turn}.zarr") == clean[(first + turn) % 3]
    assert sum(cells_of(cache).sizes().values()) < 60_000, "something was deleted"
