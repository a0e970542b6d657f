"""Who does the work of a sweep, and how long it is said to take."""

from itertools import pairwise

import pytest
from small_stores import files
from toys import SPRINGS, Told, go

from sweeps.engine import run as running
from sweeps.engine.plan import Plan
from sweeps.engine.schedule import Schedule
from sweeps.engine.settings import read_choices
from sweeps.engine.watching import Remaining

COSTS = {"period": 0.05, "energy": 0.2, "noisy": 0.1, "trace": 0.02, "answers": 0.3}


@pytest.fixture
def kinds(monkeypatch):
    """Kinds of the clusters that sweeps ask for; all of them run in this process."""
    asked = []

    def executor(choice, **how):
        asked.append(choice.kind)
        return inline(type(choice)("inline"), **how)

    inline = running.executor
    monkeypatch.setattr(running, "executor", executor)
    return asked


def test_little_work_of_known_cost_is_done_without_workers(tmp_path, kinds, monkeypatch):
    store, cache = tmp_path / "s.zarr", tmp_path / "cache"
    go(store, cache, kind="local")  # of which no cost is known
    go(store, cache, kind="local")
    assert kinds == ["local"]  # nothing to do
    go(store, cache, kind="local", measured__length=[2, 3, 4])
    assert kinds == ["local", "inline"]
    go(tmp_path / "t.zarr", measured__length=[2, 3, 4])
    assert files(store) == files(tmp_path / "t.zarr")
    many = {"spring__stiffness": [float(one) for one in range(1, 41)]}
    monkeypatch.setattr(running, "QUICK", 1e-6)
    go(tmp_path / "u.zarr", cache, kind="local", **many)
    assert kinds[-1] == "local"


def test_workers_start_while_a_sweep_is_planned_that_has_no_results_yet(tmp_path, kinds):
    seen = []
    told = Told()
    watch = told.watch
    watch.say = lambda sentence: seen.append((sentence.partition(" cells")[0], list(kinds)))
    go(tmp_path / "s.zarr", tmp_path / "cache", kind="local", watch=watch)
    assert seen == [("74", ["local"])]
    seen.clear(), kinds.clear()
    more = {"measured__pause": 0.3, "measured__length": [2, 3, 4]}
    go(tmp_path / "s.zarr", tmp_path / "cache", kind="local", watch=watch)
    go(tmp_path / "t.zarr", tmp_path / "cache", kind="local", watch=watch, **more)
    assert seen[0] == ("0", [])  # nothing is started for nothing


def seconds(words):
    """Time of 'about 2 min left' [s]."""
    count, unit, *rest = words.removeprefix("about ").removesuffix(" left").split()
    return float(count) * {"s": 1, "min": 60, "h": 3600}[unit] + (60 * int(rest[0]) if rest else 0)


@pytest.mark.parametrize("known", [COSTS, {"energy": 0.2}, {}])
def test_the_time_that_a_sweep_still_takes_is_steady(known):
    """Two workers, start included; costs of earlier runs known, or some of them, or none."""
    masses = {"spring.mass": list(range(1, 31)), "spring.limit": list(range(50, 70))}
    schedule = Schedule(Plan(SPRINGS, read_choices(SPRINGS.declared, masses)), dict(known))
    schedule.resolve(lambda bound, keys: {})
    remaining, now, told = Remaining(), 2.0, []
    assert remaining.words(schedule, 0.0) == ""
    while schedule.ready:
        jobs, _ = schedule.batch(2)
        for job in jobs:
            took = COSTS[job.bound.name] * len(job.places)
            schedule.finish(job, [("pack", 0)] * len(job.places), "", took)
            now += took / 2
        told.append((now, remaining.words(schedule, now)))
    told, whole = [one for one in told if one[1]], now
    for now, words in told[:-1]:
        if whole - now > 10 and (known == COSTS or now > 0.5 * whole):
            assert 0.65 < seconds(words) / (whole - now) < 1.35, (now, whole, words)
    ends = [now + seconds(words) for now, words in told if known == COSTS and whole - now > 60]
    assert all(abs(b - a) < 0.1 * whole for a, b in pairwise(ends))


def test_a_damaged_index_of_costs_gives_no_estimate():
    for cost in (float("nan"), float("inf"), -1.0):
        schedule = Schedule(
            Plan(SPRINGS, read_choices(SPRINGS.declared, {})), dict.fromkeys(COSTS, cost)
        )
        schedule.resolve(lambda bound, keys: {})
        remaining = Remaining()
        for now in range(3):
            schedule.progress["energy"].seconds += 10.0
            assert remaining.words(schedule, now) == ""
