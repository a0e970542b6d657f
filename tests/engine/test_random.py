"""After any sequence of kills, extensions, repeats and damage, a run gives a clean run's store."""

import random
import shutil
from contextlib import suppress

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_stores import Killed, contents, ending_after
from toys import go

from sweeps.engine.declare.errors import ConfigurationError

AXES = {
    "spring__stiffness": [1.0, 2.0, 3.0, 4.0],
    "spring__mass": [0.5, 1.0, 2.0],
    "spring__limit": [1.2, 50.0, 100.0],  # some springs are too stiff for the first limit
    "measured__length": [2, 3, 4],
    "measured__rule": ["max", "mean", "min"],
    "measured__doubled": [False, True],
    "seed": [0, 1],
}
REPAIRS = 3  # largest number of runs needed after damage
PLACES = {"cache": "cache", "store": "s.zarr"}
METHODS = ("get", "read_range", "put", "_delete", "list_objects")


def actions():
    """Return a strategy for lists of actions on a store and its cache."""
    more = st.tuples(st.just("more"), st.sampled_from(sorted(AXES)), st.integers(0, 3))
    kill = st.tuples(st.just("kill"), st.integers(0, 280), st.just(0))
    damage = st.tuples(
        st.sampled_from(["cache", "store"]), st.integers(0, 10**6), st.integers(1, 4)
    )
    simple = st.tuples(st.sampled_from(["run", "clear", "lose"]), st.just(0), st.just(0))
    return st.lists(st.one_of(more, kill, damage, simple), min_size=2, max_size=9)


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
def test_store_matches_a_clean_run_after_any_faults(tmp_path_factory, actions):
    folder = tmp_path_factory.mktemp("whatever")
    store, cache = folder / "s.zarr", folder / "cache"
    values = {key: axis[-2:-1] for key, axis in AXES.items()}
    for action, first, second in actions:
        match action:
            case "more":
                value = AXES[first][second % len(AXES[first])]
                values = values | {first: [*{*values[first], value}]}
            case "kill":
                with suppress(Killed, ConfigurationError), ending_after(first, METHODS):
                    go(store, cache, **values)
            case "cache" | "store":
                damaged(folder / PLACES[action], first, second, flip=action == "cache")
            case "clear":
                shutil.rmtree(cache, ignore_errors=True)
            case "lose":
                shutil.rmtree(store, ignore_errors=True)
            case "run":
                healed(store, cache, values)
    healed(store, cache, values)
    go(folder / "t.zarr", **values)
    assert contents(store) == contents(folder / "t.zarr")
    leftovers = [path.name for path in folder.iterdir() if path.name.startswith(".")]
    assert leftovers == [], "what a killed run leaves is removed by the next"
    shutil.rmtree(folder)
