"""Sweeps into buckets resume, extend, repair and report stores as on a disk and leak no secret."""

import json

import buckets
import pytest
from executors import IMPORTS
from running import python
from small_stores import contents, files, opened
from toys import CALLS, SPRINGS, Recorder, go

from sweeps.engine.command.line import Command
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.objects import Objects
from sweeps.engine.store.locks import store_lock


def test_bucket_stores_extend_and_repair_like_local_stores(bucket, tmp_path):
    store, cache, recorder = f"{bucket}/s.zarr", tmp_path / "cache", Recorder()
    with store_lock(store), pytest.raises(ConfigurationError, match="being written by process"):
        go(store, cache)
    assert go(store, cache).written
    CALLS.clear()
    assert not go(store, cache).written and not CALLS
    more = {"spring__mass": [1, 2, 3]}
    assert go(store, cache, **more).written and CALLS["period"] == 3
    go(tmp_path / "t.zarr", cache, **more)
    assert contents(store) == contents(tmp_path / "t.zarr")
    there = Objects(store)
    chunks = [name for name in there.sizes("springs") if not name.endswith("zarr.json")]
    there.put(chunks[0], b"other")
    there.delete([chunks[1]])
    go(store, cache, callbacks=recorder.callbacks, **more)
    assert any("2 files of the store are damaged" in sentence for sentence in recorder.sentences)
    assert contents(store) == contents(tmp_path / "t.zarr")
    there.put("mine.txt", b"")
    with pytest.raises(ConfigurationError, match="which contains 'mine"):
        go(store, cache, **more)


def test_bucket_stores_are_validated_like_local_paths(bucket, tmp_path, monkeypatch, capsys):
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
    }.items():
        assert start(f"store={store}") == 2
        (message,) = capsys.readouterr().err.splitlines()
        assert message.startswith(f"springs: store is '{store}'") and reason in message
    assert start("-m", f"store={bucket}/s.zarr,{bucket}/other/s.zarr") == 2
    assert "whose report would replace that of" in capsys.readouterr().err
    assert opened(f"{bucket}/s.zarr", "springs").sizes["mass"] == 2


SWEEP = """
import sys
from sweeps.engine.command.line import Command
from toys import SPRINGS
sys.exit(Command(SPRINGS).main(sys.argv[1:]))
"""


def test_secrets_never_leak_into_stores_logs_or_messages(bucket, tmp_path, served):
    arguments = ["-c", SWEEP, "cache=cache", "cluster.workers=2", f"store={bucket}/s.zarr"]
    outputs = []

    def run(*more, status=0, **environment):
        environment |= {"PYTHONPATH": IMPORTS}
        done = python(*arguments, *more, cwd=tmp_path, check=False, **environment)
        assert done.returncode == status, done.stderr
        outputs.append((done.stdout + done.stderr).encode())

    run("spring.limit=1.5", status=1)  # a cell fails, and its arguments are written to a log
    run("spring.mass=7", status=2)
    name = f"http://{buckets.SECRET}:{buckets.SECRET}@127.0.0.1:9"
    run(AWS_SECRET_ACCESS_KEY=buckets.SECRET, AWS_ENDPOINT_URL=name, status=2)
    file_contents = [*files(bucket).values(), *files(tmp_path).values(), *outputs]
    assert len(file_contents) > 50 and any(b"too [stiff]" in content for content in file_contents)
    assert not [content for content in file_contents if buckets.SECRET.encode() in content]
    assert buckets.SECRET in json.dumps(served)
