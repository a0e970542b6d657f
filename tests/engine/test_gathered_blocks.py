"""Inputs gathered in blocks are read only when indexed, and give the values an array would."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from packed import keys
from small_stores import opened
from toys import Few, run_few

from sweeps.engine.cache.packs import Locations, PackWriter, open_packs
from sweeps.engine.declare.stage import At, Group, Output, stage
from sweeps.engine.run.tasks import DamagedResultsError, GatheredArray, stage_spec

ROWS = 20_000  # numbers in each cell
SHAPE = (3, 4)
LACKING = [1, 2, 3, 9]  # absent cells


@stage(Output("row", ("k",), dtype="f8"), uses=(Few,))
def row(size):
    """Return a row of numbers; fail for size 3."""
    if size == 3:
        raise ValueError("none")
    return np.arange(ROWS) + size


def backwards(row, valid):
    """Return a number for each size, the last size first, reading one size at a time."""
    rows = [row[k : k + 1] for k in reversed(range(len(row)))]
    assert row.shape == (len(valid), ROWS) and not np.isfinite(row[~valid]).any()
    return np.concatenate(rows)[:, :2].sum(axis=1) + row.reshape(1, -1, ROWS)[0, 0][1]


def test_gathering_in_blocks_equals_gathering_whole(tmp_path):
    for name, read in {"whole": "row", "blocks": At("row", in_blocks=True)}.items():
        options = {"gather": (Few.size,), "group": Group("both"), "reads": {"row": read}}
        declare = stage(Output("total", ("number",), "f8", label="total"), name=name, **options)
        stages = [row, declare(backwards)]
        finished = run_few(stages, tmp_path / f"{name}.zarr", sizes=range(1, 6))
        assert [*dict(finished.failures)] == ["row size=3"], finished.failures
    arrays, blocks = (opened(tmp_path / f"{name}.zarr", "both") for name in ("whole", "blocks"))
    assert np.isfinite(arrays.total).sum() == 4
    np.testing.assert_array_equal(blocks.total, arrays.total)


@pytest.fixture(scope="module")
def gathered(tmp_path_factory):
    """Return a lazy array of cells in two packs, some absent, and the equal numpy array."""
    packs = open_packs(tmp_path_factory.mktemp("cache"))
    values = np.arange(12.0 * ROWS, dtype="f8").reshape(12, ROWS)
    pack, place = np.arange(12) % 2, np.arange(12) // 2
    names = [keys(*range(n, 12, 2)) for n in range(2)]
    paths = []
    for number in range(2):
        packing = PackWriter()
        for array in values[number::2]:
            packing.add({"row": array})
        paths.append(packing.write(packs, "row", names[number]).path)
    every = np.array([names[n % 2][n // 2] for n in range(12)])
    pack[LACKING], values[LACKING] = -1, np.nan
    locations = Locations(paths, pack.astype("i4"), place.astype("i4"), every).reshape(*SHAPE)
    return GatheredArray(stage_spec(row), locations, packs), values.reshape(*SHAPE, ROWS)


@given(at=st.data())
def test_indexing_matches_numpy(gathered, at):
    lazy, array = gathered
    axes = [st.slices(n) | st.integers(-n, n - 1) | st.lists(st.integers(0, n - 1)) for n in SHAPE]
    mask = st.just(np.isfinite(array[..., 0]))
    index = at.draw(axes[0] | mask | st.tuples(axes[0], st.slices(4)))
    np.testing.assert_array_equal(lazy[index], array[index])
    flat = at.draw(st.lists(st.integers(0, 11)))
    lazy, array = (values.reshape(1, -1, ROWS) for values in (lazy, array))
    np.testing.assert_array_equal(lazy[:, flat], array[:, flat])


def test_only_indexed_blocks_are_held_in_memory(gathered):
    lazy, array = gathered
    tracemalloc.start()
    reshaped = lazy.reshape(12, ROWS)
    total = sum(np.nansum(reshaped[k]) for k in range(12))
    traced = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert total == np.nansum(array) and traced < array.nbytes / 2


def test_damaged_cells_raise_when_indexed(gathered):
    lazy, _ = gathered
    lost = replace(lazy.locations, keys=lazy.locations.keys + np.uint64(1))
    with pytest.raises(DamagedResultsError) as error:
        replace(lazy, locations=lost)[0, :1]
    assert error.value.args == (lost.keys[0, 0].tobytes(),)
