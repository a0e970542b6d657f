"""Paths of stores and caches are refused if they are unusable, unsafe, in use or overlap."""

import os
import stat
from pathlib import Path

import numpy as np
import pytest
from small_stores import array, files, opened, small

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.store.locks import store_lock
from sweeps.engine.store.targets import check_cache_path, check_store_path, check_targets
from sweeps.engine.store.writing import write_store


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        *((f"{scheme}://x/y", "must be a folder or a URL") for scheme in ("ftp", "file", "http")),
        ("simplecache::s3://x/y", "must be a folder or a URL"),
        (Path("s3://x/y"), "must be a folder or a URL"),
        ("", "must be the name"),
        ("/", "must be the name"),
        ("a\0b", "null byte"),
        ("n" * 214, "File name too long"),
        ("n" * 300 + "/x", "File name too long"),
        ("dangling", "dangling symlink"),
        ("dangling/x", "dangling symlink"),
        ("loop", "dangling symlink"),
        ("file", "no"),
        ("file/x", "is not a folder"),
        ("file/x/y", "is not a folder"),
        ("/proc/x", "nothing can be written"),
    ],
)
def test_impossible_paths_are_refused(tmp_path, monkeypatch, path, reason):
    monkeypatch.chdir(tmp_path)
    Path("dangling").symlink_to("nowhere")
    Path("loop").symlink_to("loop")
    Path("file").write_text("mine")
    before = sorted(os.listdir())
    with pytest.raises(ConfigurationError, match=rf"^store is [^\n]*{reason}[^\n]*$"):
        check_store_path(path)
    with pytest.raises(ConfigurationError, match=rf"^cache is [^\n]*{reason}[^\n]*$"):
        check_cache_path(path)
    assert sorted(os.listdir()) == before


@pytest.mark.parametrize("which", ["cache", "cache/cells"])
@pytest.mark.parametrize("bits", [0o020, 0o002, None])
def test_a_cache_that_others_own_or_may_write_is_refused(tmp_path, monkeypatch, which, bits):
    folder = tmp_path / which
    folder.mkdir(parents=True)
    check_cache_path(tmp_path / "cache")
    if bits:
        folder.chmod(0o700 | bits)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: folder.stat().st_uid + 1)
    sentence = r"^cache is .*, but others own .* or may write there; .*: chmod go-w, or give"
    with pytest.raises(ConfigurationError, match=sentence):
        check_cache_path(tmp_path / "cache")


@pytest.mark.parametrize("appears", [False, True])
def test_a_foreign_folder_is_never_touched(tmp_path, appears):
    path = tmp_path / "s.zarr"

    groups = small(1)

    def put(_=None):
        path.mkdir(exist_ok=True)
        (path / "zarr.json").write_text("mine")
        return np.zeros((1, 6), "f4")

    if appears:  # the file appears while the store is written
        groups["one"].arrays["x"] = array(np.zeros((1, 6), "f4"), chunks=(1, 6), read=put)
    else:
        put()
    reason = "which contains 'zarr.json'" if appears else "exists but is not a store"
    with pytest.raises(ConfigurationError, match=reason):
        write_store(path, groups, {})
    assert files(path) == {"zarr.json": b"mine"}
    assert os.listdir(tmp_path) == ["s.zarr"]


def test_stores_caches_and_reports_are_apart(tmp_path):
    def apart(*names, cache="cache"):
        def beside(store):
            return [store.with_name(f"{store.name.removesuffix('.zarr')}-tables")]

        check_targets([tmp_path / name for name in names], tmp_path / cache, beside)

    def refused(sentence, *names, cache="cache"):
        with pytest.raises(ConfigurationError, match=sentence):
            apart(*names, cache=cache)

    refused(r"^store is .*in the store '.*x\.zarr'$", "x.zarr", "x.zarr/a/b")
    refused("^cache is .* must not be in the store", "x.zarr", cache="x.zarr/cache")
    refused("whose report would be written into the store '.*z-tables'", "z-tables", "z.zarr")
    write_store(tmp_path / "y-tables", small(1), {})
    refused("whose report would be written into the store '.*y-tables'", "y.zarr")
    apart("x.zarr", "w", cache="x-tables")


@pytest.mark.parametrize("mask", [0, 0o022, 0o077])
def test_others_never_write_a_store(tmp_path, mask, umask, monkeypatch):
    umask(mask)
    masks = []  # set for the whole process, so that other threads use them too
    monkeypatch.setattr(os, "umask", lambda new: masks.append(new) or umask(new))
    write_store(tmp_path / "new" / "s.zarr", small(1), {})
    paths = [tmp_path / "new", *(tmp_path / "new").rglob("*")]
    modes = {path.is_dir(): stat.S_IMODE(path.stat().st_mode) for path in paths}
    assert modes == {True: 0o755 & ~mask, False: 0o644 & ~mask}
    assert masks and all(seen & mask == mask for seen in masks)
    assert len({(path.is_dir(), path.stat().st_mode) for path in paths}) == 2


def test_a_store_behind_a_link_is_locked_and_replaced_where_it_is(tmp_path):
    path, link = tmp_path / "s.zarr", tmp_path / "link.zarr"
    link.symlink_to(path)
    write_store(path, small(1), {})
    with (
        store_lock(path),
        pytest.raises(ConfigurationError, match="being written"),
        store_lock(link),
    ):
        pytest.fail("two writers")
    write_store(link, small(2), {})
    assert link.is_symlink()
    assert (opened(path, "one")["x"] == 2).all()
