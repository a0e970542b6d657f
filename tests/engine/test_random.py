"""After any sequence of kills, extensions, repeats and damage, a run gives a clean run's store."""

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from killed import killed_at
from small_stores import contents
from toys import Recorder, go

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.store.writing import recover

AXES = {
    "spring__stiffness": [1.0, 2.0, 3.0, 4.0],
    "spring__mass": [0.5, 1.0, 2.0],
    "spring__limit": [1.2, 50.0, 100.0],  # some springs are too stiff for the first limit
    "measured__length": [2, 3, 4],
    "measured__rule": ["max", "mean", "min"],
    "measured__doubled": [False, True],
    "seed": [0, 1],
}
FIRST = {
    "spring__stiffness": [2.0],
    "spring__mass": [1.0],
    "spring__limit": [50.0],
    "measured__length": [3],
    "measured__rule": ["mean"],
    "measured__doubled": [False],
    "seed": [0],
}
REPAIRS = 3  # largest number of runs needed after damage


def actions():
    """Return a strategy for lists of actions on a store and its cache."""
    more = st.tuples(st.just("more"), st.sampled_from(sorted(AXES)), st.integers(0, 3))
    kill = st.tuples(st.just("kill"), st.integers(1, 560), st.just(0))
    damage = st.tuples(
        st.sampled_from(["cache", "store"]), st.integers(0, 10**6), st.integers(1, 4)
    )
    simple = st.tuples(st.sampled_from(["run", "clear", "lose"]), st.just(0), st.just(0))
    return st.lists(st.one_of(more, kill, damage, simple), min_size=2, max_size=9)


CLEAN = {}


def clean(folder, values):
    """Return the contents of the store that one clean run makes."""
    name = repr(values)
    if name not in CLEAN:
        with tempfile.TemporaryDirectory(dir=folder) as place:
            go(Path(place, "s.zarr"), **values)
            CLEAN[name] = contents(Path(place, "s.zarr"))
    return CLEAN[name]


def damaged(folder, seed, number, *, flip):
    """Flip bits of random files below a folder, or truncate files, which a listing shows."""
    chance = random.Random(seed)
    for _ in range(number):
        there = sorted(file for file in folder.rglob("*") if file.is_file() and file.stat().st_size)
        if there:
            file = chance.choice(there)
            content = bytearray(file.read_bytes())
            position = chance.randrange(len(content))
            if flip:
                content[position] ^= 1 << chance.randrange(8)
            file.write_bytes(content if flip else content[:position])


def healed(store, cache, values):
    """Run until the store is complete; remove a refused one, as the error tells users to do."""
    for _ in range(REPAIRS):
        try:
            go(store, cache, **values)
        except ConfigurationError as error:
            assert "give another path" in str(error), error
            shutil.rmtree(store)
        else:
            return


@settings(max_examples=10, deadline=None, suppress_health_check=list(HealthCheck))
@given(actions=actions())
def test_whatever_happens_the_store_is_that_of_one_clean_run(tmp_path_factory, actions):
    folder = Path(tempfile.mkdtemp(dir=tmp_path_factory.getbasetemp()))
    store, cache = folder / "s.zarr", folder / "cache"
    values = dict(FIRST)
    for action, first, second in actions:
        match action:
            case "more":
                value = AXES[first][second % len(AXES[first])]
                values = values | {first: [*{*values[first], value}]}
            case "kill":
                killed_at(first, store, cache, values)
            case "cache" | "store":
                damaged(
                    cache if action == "cache" else store, first, second, flip=action == "cache"
                )
            case "clear":
                shutil.rmtree(cache, ignore_errors=True)
            case "lose":
                shutil.rmtree(store, ignore_errors=True)
            case "run":
                healed(store, cache, values)
    healed(store, cache, values)
    assert contents(store) == clean(folder, values)
    leftovers = [path.name for path in folder.iterdir() if path.name.startswith(".")]
    assert leftovers == [], "what a killed run leaves is removed by the next"
    shutil.rmtree(folder)


@settings(max_examples=6, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_a_kill_at_any_file_leaves_the_old_store_or_the_new(tmp_path_factory, data):
    folder = Path(tempfile.mkdtemp(dir=tmp_path_factory.getbasetemp()))
    store, cache = folder / "s.zarr", folder / "cache"
    few, more = dict(FIRST), FIRST | {"spring__mass": [1.0, 2.0]}
    go(store, cache, **few)
    killed_at(data.draw(st.integers(1, 520)), store, cache, more)
    recover(store)
    assert contents(store) in (clean(folder, few), clean(folder, more))
    go(store, cache, **more)
    assert contents(store) == clean(folder, more)
    shutil.rmtree(folder)


SCRIPT = """
import sys

if __name__ == "__main__":
    sys.path.insert(0, {tests!r})
    from toys import go

    go("s.zarr", "cache", {kind!r}, {workers}, **{asked!r})
"""
SLOW = {"measured__pause": 0.02, "spring__stiffness": list(range(1, 30))}


def started(folder, kind, values):
    """Start a process that runs the springs; return it."""
    workers = 2 if kind == "local" else None
    tests = str(Path(__file__).parent)
    file = folder / "springs_of_a_process.py"
    file.write_text(SCRIPT.format(tests=tests, kind=kind, workers=workers, asked=values))
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.Popen(
        [sys.executable, file.name], cwd=folder, env=environment, start_new_session=True
    )


@pytest.mark.parametrize("kind", ["inline", "local"])
def test_a_driver_killed_in_the_midst_of_its_work(tmp_path, kind):
    cells = tmp_path / "cache" / "cells"
    for more in (1, 2):  # the second run starts from the results of the first
        before = len(list(cells.rglob("*.pack")))
        driver = started(tmp_path, kind, SLOW)
        while driver.poll() is None and len(list(cells.rglob("*.pack"))) < before + more:
            time.sleep(0.01)
        os.kill(driver.pid, signal.SIGKILL)
        driver.wait()
    assert not (tmp_path / "s.zarr").exists()
    recorder, packs = Recorder(), len(list(cells.rglob("*.pack")))
    while True:  # the store is refused until the workers of the killed driver have ended
        try:
            finished = go(
                tmp_path / "s.zarr", tmp_path / "cache", callbacks=recorder.callbacks, **SLOW
            )
        except ConfigurationError:
            time.sleep(0.05)
        else:
            break
    # Each pack, of any stage, has at least one cell.
    assert sum(progress.reused for progress in finished.progress.values()) >= packs >= 2
    go(tmp_path / "t.zarr", tmp_path / "cache", **SLOW)
    assert contents(tmp_path / "s.zarr") == contents(tmp_path / "t.zarr")
    assert not [path for path in tmp_path.iterdir() if path.name.endswith((".partial", ".lock"))]
