"""Packs return the cells that were written, and never cells that were changed on disk."""

import errno
import json
import os
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of
from packed import keys, locations, same, write_pack, written

from sweeps.engine.cache import packs
from sweeps.engine.cache.index import CellIndex
from sweeps.engine.cache.packs import Pack, open_packs, read_cells, read_pack
from sweeps.engine.objects import UNREACHABLE, Objects
from sweeps.engine.resolve.keys import digest, hash_bytes

HEAD = re.compile(r"([0-9a-f]{16})[0-9a-f]{32}([0-9a-f]{8})[.]pack")


@pytest.fixture(autouse=True)
def clear_head_cache():
    """Clear the cache of heads of packs."""
    packs._read_head.cache_clear()


DTYPES = (
    arrays_of.scalar_dtypes()
    | arrays_of.unicode_string_dtypes()
    | st.sampled_from([np.dtype(np.longdouble), np.dtype("V5"), np.dtype("S3")])
)
SHAPES = arrays_of.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3)
LAYOUTS = st.dictionaries(st.text(max_size=4), st.tuples(DTYPES, SHAPES), max_size=3)


@st.composite
def contents(draw):
    """Draw cells of one layout or several."""
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
def test_packs_round_trip_into_aligned_unshared_arrays(contents, data):
    rows = data.draw(st.lists(st.integers(0, len(contents) - 1), max_size=8))
    with tempfile.TemporaryDirectory() as name:
        cells, names = Objects(Path(name)), range(len(contents))
        pack = write_pack(cells, "stage", names, contents)
        assert pack.size == Path(name, pack.path).stat().st_size
        there, pack_keys = read_pack(cells, pack.path, pack.size)
        assert there == pack and np.array_equal(pack_keys, keys(*names))
        outputs = read_cells(cells, locations(pack.path, rows, rows))
    arrays = [array for cell in outputs for array in cell.values()]
    for row, cell in zip(rows, outputs, strict=True):
        assert same(cell, contents[row])
    for array in arrays:
        assert array.flags.aligned and array.flags.c_contiguous and array.flags.writeable
        assert not any(np.shares_memory(array, other) for other in arrays if other is not array)


@pytest.mark.parametrize("code", ["O", "f8,i4", "T"])
def test_uncacheable_dtypes_are_refused(tmp_path, code):
    with pytest.raises(TypeError, match="cannot be cached"):
        write_pack(Objects(tmp_path), "stage", [1], [{"a": np.zeros(2, dtype=code)}])
    assert list(tmp_path.iterdir()) == []


def test_every_changed_byte_is_noticed(tmp_path):
    """A changed byte of one cell makes this cell absent; any other byte makes all cells absent."""
    records = [{"a": np.float64(n), "b": np.arange(n + 1)} for n in range(3)]
    cells = Objects(tmp_path)
    pack = write_pack(cells, "s", range(3), records)
    path = tmp_path / pack.path
    three = locations(pack.path, range(3), range(3))
    content = path.read_bytes()
    ends = int(HEAD.fullmatch(pack.path)[2], 16) + np.cumsum([0, 32, 32, 48])
    assert ends[-1] == len(content)
    for place in range(len(content)):
        owner = int(np.searchsorted(ends, place, side="right")) - 1
        flipped = bytearray(content)
        flipped[place] ^= 1 << place % 8
        path.write_bytes(flipped)
        packs._read_head.cache_clear()
        outputs = read_cells(cells, three)
        assert [cell is None for cell in outputs] == [owner in (-1, row) for row in range(3)]
        assert all(
            cell is None or same(cell, content)
            for cell, content in zip(outputs, records, strict=True)
        )


MIXED = [
    {"a": np.arange(3.0), "b": np.arange(4).reshape(2, 2)},
    {"a": np.arange(2.0), "b": np.zeros((0, 5), int)},
    {"a": np.arange(3.0) + 1, "b": np.arange(4).reshape(2, 2)},
]


@st.composite
def changed(draw, content):
    """Draw bytes of which some, at up to three places, are replaced by others."""
    for _ in range(draw(st.integers(0, 3))):
        start, length = draw(st.integers(0, len(content))), draw(st.integers(0, 20))
        content = content[:start] + draw(st.binary(max_size=20)) + content[start + length :]
    return content


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_corrupt_header_with_valid_digest_never_overreads(data):
    with tempfile.TemporaryDirectory() as name:
        cells = Objects(Path(name))
        pack = write_pack(cells, "s", range(3), MIXED)
        content = Path(name, pack.path).read_bytes()
        size = int(HEAD.fullmatch(pack.path)[2], 16)
        path = sealed_as(Path(name), data.draw(changed(content[:size])), content[size:])
        read_pack(cells, path, Path(name, path).stat().st_size)
        for cell in read_cells(cells, locations(path, range(3), range(3))):
            assert sum(array.nbytes for array in (cell or {}).values()) <= len(content)


def sealed_as(folder: Path, head: bytes, records: bytes) -> str:
    """Write a pack whose name fits its head; return the name."""
    path = f"{16 * '0'}{digest(head)}{len(head):08x}.pack"
    (folder / path).write_bytes(head + records)
    return path


def test_missing_or_invalid_packs_are_absent(tmp_path):
    cells = Objects(tmp_path)
    pack = written(cells, 0, 1, 2)
    (tmp_path / pack.path).unlink()
    for strange in (pack.path, ".", "nul\0"):
        assert read_cells(cells, locations(strange, [0, 3], [0, 1])) == [None] * 2


# exchanged and damaged packs ---------------------------------------------------------------------


def test_a_cell_of_another_key_is_not_read(tmp_path):
    cells = Objects(tmp_path)
    first, second = written(cells, 1, 2), written(cells, 3, 4)
    assert read_cells(cells, locations(first.path, [0, 1], [3, 1])) == [None] * 2
    content = (tmp_path / first.path).read_bytes()
    (tmp_path / second.path).replace(tmp_path / first.path)
    (tmp_path / second.path).write_bytes(content)
    assert read_cells(cells, locations(first.path, [0, 1], [1, 2])) == [None] * 2
    assert read_cells(cells, locations(second.path, [0, 0], [1, 3])) == [None] * 2


LINE = ["s", 0.5, [[["a", "<f8", [2]]]]]


def of_line(cells: Objects, line, number=0, key=1) -> Pack:
    """Write a pack of one cell with a header line; return the pack and the cell as read."""
    record = np.arange(2.0).tobytes()
    text = line if isinstance(line, bytes) else json.dumps(line).encode()
    tables = keys(key).tobytes() + np.array([number], "<u4").tobytes() + hash_bytes(record, 8)
    path = sealed_as(cells.path, text + b"\n" + tables, record)
    pack, pack_keys = read_pack(cells, path, len(text) + 1 + len(tables) + len(record))
    assert len(pack_keys) == pack.cells
    [cell] = read_cells(cells, locations(path, [0], [key]))
    return pack, cell


def test_header_gives_stage_and_computing_time(tmp_path):
    pack, cell = of_line(Objects(tmp_path), LINE)
    assert (pack.stage, pack.seconds, pack.cells) == ("s", 0.5, 1)
    assert cell["a"].tolist() == [0, 1]
    pack, cell = of_line(Objects(tmp_path), LINE, number=1)  # a layout that it does not have
    assert cell is None and pack.cells == 0


HUGE = 2**62


@pytest.mark.parametrize(
    "line",
    [
        *(None, [], {}, b"", b"[", 10_000 * b"[", b"\xff", [1, 2, 3]),
        *(["s", 0, [[["a", "<f8", [2]]]], 0], ["s", 0, None]),
        *(["s", 0, layouts] for layouts in ([], ["abc"], [[["a", "<f8"]]], [[7]], {"a": 1})),
        *(["s", 0, [[["a", "<f8", shape]]]] for shape in ([-2], [1.0], "2", None, 9 * [HUGE])),
        ["s", 0, [[["a", "<f8", [2]], ["b", "u1", [0, HUGE, HUGE]]]]],
        *(["s", 0, [[["a", code, [2]]]]] for code in ("|O", "<f8,<i4", "(2,)<f8", "", "T")),
    ],
)
def test_packs_with_malformed_headers_are_damaged(tmp_path, line):
    """The pack's name fits its head; such layouts could read bytes as pointers or fill memory."""
    _, cell = of_line(Objects(tmp_path), line)
    assert cell is None


@pytest.mark.parametrize("longer", [1, 28, 10**9])
def test_packs_with_overstated_header_size_are_damaged(tmp_path, longer):
    cells = Objects(tmp_path)
    path = written(cells, 1).path
    size = int(HEAD.fullmatch(path)[2], 16)
    content = (tmp_path / path).read_bytes()
    longer_path = f"{path[:48]}{size + longer:08x}.pack"
    (tmp_path / longer_path).write_bytes(content)
    assert read_cells(cells, locations(longer_path, [0], [1])) == [None]
    pack, there = read_pack(cells, longer_path, len(content))
    assert pack == Pack(longer_path, len(content)) and len(there) == 0


def test_running_out_of_descriptors_is_not_reported_as_damage(tmp_path, monkeypatch):
    cells = Objects(tmp_path)
    pack = written(cells, 1)

    def refused(*arguments):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr(Objects, "read_range", refused)
    with pytest.raises(OSError, match="Too many open files"):
        read_cells(cells, locations(pack.path, [0], [1]))
    with pytest.raises(OSError, match="Too many open files"):
        CellIndex(cells, print)


def test_network_failure_is_not_reported_as_damage(bucket, monkeypatch):
    cells = open_packs(bucket)
    pack = written(cells, 1)
    monkeypatch.setattr("sweeps.engine.objects.RETRIES", 1)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    for read in (
        lambda there: read_cells(there, locations(pack.path, [0], [1])),
        lambda there: read_pack(there, pack.path, pack.size),
        lambda there: CellIndex(there, print),
    ):
        with pytest.raises(OSError, match=r"^[^\n]*$") as failed:
            read(open_packs(bucket))
        assert failed.value.errno == UNREACHABLE
        assert failed.value.filename == f"{bucket}/cells"
