"""Stores in pieces hold the rows of `ncti.dataset`; adding pieces computes only the new ones."""

import numpy as np
import pytest
import xarray as xr
from commands import swept

import ncti
from ncti.data import open_rows
from ncti.data.rows import ROWS

SHIPS = ["duncan", "texas"]
ROWS_OF_A_PIECE = 30
GIVEN = (
    *("sensor=dataset", f"grid.ship={SHIPS}", "grid.range=[50,100]", "grid.pulse_width=[30,50]"),
    *("grid.frame_count=[1,4]", "dataset.sensor=both", "dataset.gain=[0.8,1.2]"),
    *("dataset.floor=[-1,1]", "dataset.cnr=[26,32]", "dataset.aspect=[0,90]", "seed=3"),
    *(f"dataset.rows={ROWS_OF_A_PIECE}", "dataset.rows_per_view=7"),  # views extend over pieces
)


def same(count):
    """Return the rows that a store of `GIVEN` must have."""
    nanoseconds = 1e-9  # multiplied as in sweeps, for equal rounding
    return ncti.dataset(
        SHIPS,
        count,
        seed=3,
        sensor="both",
        aspect=(0.0, 90.0),
        slant_range=[50e3, 100e3],
        pulse_width=[30 * nanoseconds, 50 * nanoseconds],
        frames=[1, 4],
        cnr=[26.0, 32.0],
        gain=(0.8, 1.2),
        floor=(-1.0, 1.0),
        rows_per_view=7,
    )


@pytest.fixture(scope="module")
def store(tmp_path_factory, cache):
    """Return a store extended from one piece to three, and the finished sweep."""
    path = tmp_path_factory.mktemp("pieces") / "rows.zarr"
    for pieces in (1, 3):
        finished = swept(path, cache, *GIVEN, f"dataset.pieces={pieces}")
    return path, finished


def test_stored_rows_equal_library_rows_bit_for_bit(store):
    path, _ = store
    expected = same(3 * ROWS_OF_A_PIECE)
    for chunks in (None, {}):
        xr.testing.assert_equal(open_rows(path, chunks=chunks), expected)
    for ours, theirs in zip(ncti.load_xy(path), ncti.to_numpy(expected), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_adding_pieces_computes_only_the_new_ones(store):
    _, finished = store
    computed = {name: step.done for name, step in finished.progress.items() if "_rows" in name}
    assert computed == {"profile_rows": 2, "silhouette_rows": 2}


def test_row_stores_refuse_split_and_selectors(store):
    path, _ = store
    for wrong in ({"split": "test"}, {"classifier_group": "acn"}, {"pulse_width": 30}):
        with pytest.raises(ValueError, match=rf"^{next(iter(wrong))} is\b"):
            ncti.load_xy(path, **wrong)


def test_rows_of_several_settings_share_a_store(tmp_path, cache):
    few = ("sensor=dataset", "grid.ship=duncan", "grid.frame_count=1", "dataset.rows=4")
    swept(
        tmp_path / "s.zarr", cache, *few, "ladar.target_free_ifovs=[0,100]", "grid.pulse_width=30"
    )
    with pytest.raises(ValueError, match=r"^target_free_ifovs is not given"):
        open_rows(tmp_path / "s.zarr")
    for free in (0, 100):
        rows = open_rows(tmp_path / "s.zarr", target_free_ifovs=free)
        options = {"frames": 1, "target_free_ifovs": free, "pulse_width": 30 * 1e-9}
        expected = ncti.dataset(["duncan"], 4, seed=0, **options)
        xr.testing.assert_equal(rows, expected)
        assert set(ROWS) <= set(rows.coords)
