"""`Objects` behaves alike in folders and buckets, and its errors are one line without secrets."""

import errno
import os
import pickle
from pathlib import Path

import pytest
from buckets import SECRET
from small_stores import below

from sweeps.engine import objects as places
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import path_or_url
from sweeps.engine.objects import Objects


def test_objects_of_either_kind_behave_alike(place):
    there = Objects(below(place, "new"), create=True)
    assert there.sizes() == {}
    assert there.get("a/b") is None
    there.put("a/b", b"one")
    assert there.get("a/b") == b"one"
    there.put("a/b", b"three")
    there.put("c", b"three")
    assert there.sizes() == {"a/b": 5, "c": 5}
    assert there.sizes("a") == {"a/b": 5}
    again = pickle.loads(pickle.dumps(there))
    assert again == there and again.get("c") == b"three"
    there.delete(["a/b", "c", "absent"])
    assert there.sizes() == {}


def test_an_object_of_a_bucket_is_written_if_it_is_of_a_version(bucket):
    there = Objects(bucket)
    assert there.get_versioned("a") is None
    version = there.put_if("a", b"one", None)
    assert there.get_versioned("a") == (b"one", version)
    assert there.put_if("a", b"two", None) is None
    two = there.put_if("a", b"two", version)
    assert there.put_if("a", b"three", version) is None
    assert there.get_versioned("a") == (b"two", two)


def test_a_folder_that_is_read_is_not_made(tmp_path):
    there = Objects(tmp_path / "a" / "b")
    assert there.get("x") is None and there.sizes() == {}
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "url",
    [
        *("ftp://a/b", "file:///a", "http://a/b", "simplecache::s3://x/y", "s3:/x/y", "s3://"),
        *(
            "s3://key:SECRET@bucket/x",
            "s3://SECRET@bucket/x",
            "az://c/x?sig=SECRET",
            "s3://b/x#SECRET",
        ),
    ],
)
def test_other_urls_are_refused_without_their_secrets(url):
    with pytest.raises(
        ConfigurationError, match=r"^store is [^\n]* but must be [^\n]*$"
    ) as refused:
        path_or_url("store", url)
    assert "SECRET" not in str(refused.value)
    assert path_or_url("store", "gs://b/x/") == "gs://b/x"
    assert path_or_url("store", "a/b") == Path("a/b")


def test_absent_buckets_and_refused_keys_are_failures(bucket, monkeypatch):
    there = Objects("s3://nobucket/x")
    with pytest.raises(OSError, match="404"):
        there.sizes()
    with pytest.raises(OSError, match="no such bucket"):
        there.put("a", b"")
    monkeypatch.setattr(places, "RETRIES", 1)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    for method, arguments in (("sizes", ()), ("get", ("a",)), ("put", ("a", b""))):
        with pytest.raises(OSError, match=r"^[^\n]*$") as failed:
            getattr(Objects(bucket), method)(*arguments)
        assert failed.value.errno == places.UNREACHABLE
        assert not isinstance(failed.value, FileNotFoundError)
        assert failed.value.filename == bucket
        assert SECRET not in str(failed.value)


def test_errors_of_a_disk_keep_their_number(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=os.strerror(errno.ENOTDIR)) as failed:
        Objects(tmp_path).put("file/x", b"")
    assert failed.value.errno == errno.ENOTDIR
