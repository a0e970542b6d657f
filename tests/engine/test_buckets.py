"""Sweeps into buckets resume, extend, repair and report stores as on a disk and leak no secret."""

import json
from pathlib import Path

import buckets
import pytest
from running import python
from small_stores import below, contents, files, opened
from toys import CALLS, SPRINGS, Recorder, go

from sweeps.engine.command.line import Command
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.objects import Objects
from sweeps.engine.store.locks import store_lock
from sweeps.engine.store.manifest import verify
from sweeps.engine.store.writing import read_attributes


def test_a_store_grows_as_one_of_a_single_sweep(place, tmp_path):
    store, cache, more = below(place, "s.zarr"), tmp_path / "cache", {"spring__mass": [1, 2, 3]}
    assert go(store, cache).written
    go(tmp_path / "t.zarr", cache)
    assert contents(store) == contents(tmp_path / "t.zarr")
    CALLS.clear()
    assert not go(store, cache).written and not CALLS
    assert go(store, cache, **more).written and CALLS["period"] == 3
    go(tmp_path / "u.zarr", cache, **more)
    assert contents(store) == contents(tmp_path / "u.zarr")
    with pytest.raises(ConfigurationError, match=r"spring\.mass is 1, but the store"):
        go(store, cache, spring__mass=[1])


def test_a_failed_write_is_resumed(place, tmp_path, monkeypatch):
    store, put = below(place, "s.zarr"), Objects.put

    def failing(objects, name, content):
        if "noisy" in name:
            raise OSError(5, "the network is down", name)
        put(objects, name, content)

    monkeypatch.setattr(Objects, "put", failing)
    with pytest.raises(OSError, match="the network is down"):
        go(store, tmp_path / "cache")
    assert read_attributes(store) is None
    monkeypatch.setattr(Objects, "put", put)
    CALLS.clear()
    assert go(store, tmp_path / "cache").written and not CALLS
    go(tmp_path / "t.zarr", tmp_path / "cache")
    assert contents(store) == contents(tmp_path / "t.zarr")


def test_damage_is_found_and_mended(place, tmp_path):
    store, cache, recorder = below(place, "s.zarr"), tmp_path / "cache", Recorder()
    go(store, cache)
    before, names, there = contents(store), files(store), Objects(store)
    changed = next(name for name in names if name.startswith("answers/answer/c."))
    gone = next(name for name in names if name.startswith("springs/period/c."))
    there.put(changed, b"other")
    there.delete([gone])
    assert verify(store) == [changed, gone]
    go(store, cache, callbacks=recorder.callbacks)
    assert any("2 files of the store are damaged" in sentence for sentence in recorder.sentences)
    assert contents(store) == before
    there.put("mine.txt", b"")
    with pytest.raises(ConfigurationError, match="which contains 'mine"):
        go(store, cache)


def test_of_two_sweeps_into_a_store_one_is_refused(place, tmp_path):
    store = below(place, "s.zarr")
    with store_lock(store), pytest.raises(ConfigurationError, match="being written by process"):
        go(store, tmp_path / "cache")
    assert go(store, tmp_path / "cache").written


def test_stores_in_buckets_are_checked_as_paths_are(bucket, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    reported = []
    command = Command(
        SPRINGS,
        lambda path, choices, finished: reported.append(path),
        lambda near: [near.with_name(f"{near.name}-tables")],
    )

    def start(*arguments):
        return command.main(["cache=cache", "cluster=inline", *arguments])

    assert start(f"store={bucket}/s.zarr", "dry_run=true") == 0
    assert not files(bucket)
    assert start(f"store={bucket}/s.zarr") == 0 and reported == [f"{bucket}/s.zarr"]
    assert not [path for path in tmp_path.iterdir() if path.name != "cache"]
    capsys.readouterr()
    for store, reason in {
        f"{bucket}/s.zarr/inner.zarr": f"must not be in the store '{bucket}/s.zarr'",
        "s3://nobucket/s.zarr": "which cannot be read",
        "s3://bucket": "put credentials into the environment",
        f"{bucket}/s.zarr,store={bucket}/other/s.zarr": "",
    }.items():
        if reason:
            assert start(f"store={store}") == 2
            (message,) = capsys.readouterr().err.splitlines()
            assert message.startswith(f"springs: store is '{store}'") and reason in message
    assert start("-m", f"store={bucket}/s.zarr,{bucket}/other/s.zarr") == 2
    assert "whose report would replace that of" in capsys.readouterr().err
    assert opened(f"{bucket}/s.zarr", "springs").sizes["mass"] == 2


SWEEP = """
import sys
sys.path[:0] = {paths!r}
from sweeps.engine.command.line import Command
from toys import SPRINGS
sys.exit(Command(SPRINGS).main(sys.argv[1:]))
"""


def test_secrets_are_in_no_store_log_or_message(bucket, tmp_path, served):
    script = SWEEP.format(paths=[str(Path(__file__).parent)])
    arguments = ["-c", script, "cache=cache", "cluster.workers=2", f"store={bucket}/s.zarr"]
    outputs = []

    def run(*more, status=0, **environment):
        done = python(*arguments, *more, cwd=tmp_path, check=False, **environment)
        assert done.returncode == status, done.stderr
        outputs.append((done.stdout + done.stderr).encode())

    run("spring.limit=1.5", status=1)  # a cell fails, and its arguments are written to a log
    run("spring.limit=1.5", "dry_run=true")
    run("spring.mass=7", status=2)
    name = f"http://{buckets.SECRET}:{buckets.SECRET}@127.0.0.1:9"
    run(AWS_SECRET_ACCESS_KEY=buckets.SECRET, AWS_ENDPOINT_URL=name, status=2)
    file_contents = [*files(bucket).values(), *files(tmp_path).values(), *outputs]
    assert len(file_contents) > 50 and any(b"too [stiff]" in content for content in file_contents)
    assert not [content for content in file_contents if buckets.SECRET.encode() in content]
    assert buckets.SECRET in json.dumps(served)
