"""The cache returns ships bit for bit, survives damaged files, and refuses unknown names."""

from __future__ import annotations

import stat
import threading
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shipyard import barge

from ncti import ships
from ncti.ships import cache as store


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    path = tmp_path / "barge.yaml"
    path.write_text(yaml.safe_dump(barge()))
    return path


@pytest.fixture
def kept(sheet: Path, tmp_path: Path):
    """Return a ship, the path of its cache file, and the bytes of that file."""
    fresh = ships.load(sheet, cache=tmp_path)
    path = tmp_path / f"{ships.digest(sheet)}.npz"
    return fresh, path, path.read_bytes()


def assert_same(first, second) -> None:
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.faces, second.faces)
    assert first.vertices.dtype == second.vertices.dtype == np.float64
    assert first.metadata == second.metadata


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_damaged_cache_file_is_rebuilt(sheet, kept, data) -> None:
    """Loading gives the same ship after its cache file is truncated, overwritten or emptied."""
    fresh, path, content = kept
    cut = data.draw(st.integers(0, len(content)))
    junk = data.draw(st.binary(max_size=200))
    keep_tail = data.draw(st.booleans())
    path.write_bytes(content[:cut] + junk + (content[cut + len(junk) :] if keep_tail else b""))
    for _ in range(2):
        assert_same(ships.load(sheet, cache=path.parent), fresh)


def test_cache_folders_are_private_to_the_user(sheet, tmp_path, umask) -> None:
    umask(0)
    ships.load(sheet, cache=tmp_path / "home" / "kept")
    paths = [tmp_path / "home", *(tmp_path / "home").rglob("*")]
    assert len(paths) >= 3 and not any(stat.S_IMODE(path.stat().st_mode) & 0o077 for path in paths)


def test_concurrent_writers_leave_one_complete_file(sheet, tmp_path) -> None:
    meshes = []
    threads = [
        threading.Thread(target=lambda: meshes.append(ships.load(sheet, cache=tmp_path / "kept")))
        for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for mesh in meshes:
        assert_same(mesh, meshes[0])
    (file,) = (tmp_path / "kept").iterdir()
    assert store.read(file) is not None


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("titanic", "unknown ship 'titanic', known are connole, duncan, horne, roberts, spruance"),
        ("hull.step", r"\(.yaml, .yml, .stl, .obj, .glb\)"),
        ("nowhere.stl", "cannot be read: No such file"),
        ("nul\0.stl", "cannot label its ship"),
        (None, "ship None must be one of"),
        (7, "ship 7 must be one of"),
    ],
)
def test_invalid_ship_is_refused(value, message) -> None:
    with pytest.raises(ships.ShipError, match=message) as caught:
        ships.digest(value)
    assert str(caught.value).endswith(".")
