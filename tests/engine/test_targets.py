"""Paths of stores and caches are refused if they are unusable, unsafe, in use or overlap."""

import errno
import os
import pickle
import stat
from pathlib import Path

import numpy as np
import pytest
from buckets import SECRET
from small_stores import array, below, files, opened, small

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import path_or_url
from sweeps.engine.objects import UNREACHABLE, Objects
from sweeps.engine.store.locks import store_lock
from sweeps.engine.store.targets import check_cache_path, check_store_path, check_targets
from sweeps.engine.store.writing import write_store


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("ftp://x/y", "must be a folder or a URL"),
        (Path("s3://x/y"), "must be a folder or a URL"),
        ("", "must be the name"),
        ("a\0b", "null byte"),
        ("n" * 214, "File name too long"),
        ("dangling", "dangling symlink"),
        ("loop", "dangling symlink"),
        ("file", "no"),
        ("file/x", "is not a folder"),
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


@pytest.mark.parametrize(
    ("which", "bits"), [("cache", 0o020), ("cache/cells", 0o002), ("cache", None)]
)
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
    path, groups = tmp_path / "s.zarr", small(1)

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


def test_overlapping_store_cache_and_report_paths_are_refused(tmp_path):
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


@pytest.mark.parametrize("mask", [0, 0o077])
def test_stores_are_not_writable_by_others(tmp_path, mask, umask, monkeypatch):
    umask(mask)
    masks = []  # set for the whole process, so that other threads use them too
    monkeypatch.setattr(os, "umask", lambda new: masks.append(new) or umask(new))
    write_store(tmp_path / "new" / "s.zarr", small(1), {})
    paths = [tmp_path / "new", *(tmp_path / "new").rglob("*")]
    modes = {path.is_dir(): stat.S_IMODE(path.stat().st_mode) for path in paths}
    assert modes == {True: 0o755 & ~mask, False: 0o644 & ~mask}
    assert masks and all(seen & mask == mask for seen in masks)
    assert len({(path.is_dir(), path.stat().st_mode) for path in paths}) == 2


def test_symlinked_store_is_locked_and_replaced_at_its_target(tmp_path):
    path, link = tmp_path / "s.zarr", tmp_path / "link.zarr"
    link.symlink_to(path)
    write_store(path, small(1), {})
    with store_lock(path), pytest.raises(ConfigurationError, match="being written"):
        store_lock(link).__enter__()
    write_store(link, small(2), {})
    assert link.is_symlink()
    assert (opened(path, "one")["x"] == 2).all()


# objects of folders and buckets -------------------------------------------------------------------


def test_folder_and_bucket_objects_behave_alike(place):
    there = Objects(below(place, "new"), create=True)
    assert there.sizes() == {}
    assert there.get("a/b") is None
    there.put("a/b", b"one")
    there.put("a/b", b"three")
    there.put("c", b"three")
    assert there.sizes() == {"a/b": 5, "c": 5}
    assert there.sizes("a") == {"a/b": 5}
    again = pickle.loads(pickle.dumps(there))
    assert again == there and again.get("c") == b"three"
    there.delete(["a/b", "c", "absent"])
    assert there.sizes() == {}


URLS = [
    "ftp://a/b",
    "s3:/x/y",
    "s3://",
    "s3://a:SECRET@b/x",
    "az://c/x?sig=SECRET",
    "s3://b#SECRET",
]


@pytest.mark.parametrize("url", URLS)
def test_invalid_urls_are_refused_without_revealing_secrets(url):
    sentence = r"^store is [^\n]* but must be [^\n]*$"
    with pytest.raises(ConfigurationError, match=sentence) as refused:
        path_or_url("store", url)
    assert "SECRET" not in str(refused.value)
    assert path_or_url("store", "gs://b/x/") == "gs://b/x"
    assert path_or_url("store", "a/b") == Path("a/b")


def test_missing_buckets_and_unreachable_endpoints_raise(bucket, monkeypatch):
    there = Objects("s3://nobucket/x")
    with pytest.raises(OSError, match="404"):
        there.sizes()
    with pytest.raises(OSError, match="no such bucket"):
        there.put("a", b"")
    monkeypatch.setattr("sweeps.engine.objects.RETRIES", 1)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    for method, arguments in (("sizes", ()), ("get", ("a",)), ("put", ("a", b""))):
        with pytest.raises(OSError, match=r"^[^\n]*$") as failed:
            getattr(Objects(bucket), method)(*arguments)
        assert failed.value.errno == UNREACHABLE
        assert not isinstance(failed.value, FileNotFoundError)
        assert failed.value.filename == bucket
        assert SECRET not in str(failed.value)


def test_disk_errors_keep_their_errno(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=os.strerror(errno.ENOTDIR)) as failed:
        Objects(tmp_path).put("file/x", b"")
    assert failed.value.errno == errno.ENOTDIR
