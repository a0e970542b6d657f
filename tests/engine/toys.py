"""Toy experiments for the tests of the engine, and functions that run them."""

from __future__ import annotations

import math
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import path_beside, path_or_url
from sweeps.engine.declare.settings import (
    COORDINATE,
    DIMENSION,
    Settings,
    count,
    draws,
    number,
    read_choices,
    switch,
    word,
)
from sweeps.engine.declare.stage import (
    At,
    Experiment,
    Group,
    Output,
    Stage,
    Status,
    Stream,
    Table,
    derived,
    in_memory,
    stage,
)
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.schedule import Callbacks
from sweeps.engine.run.tasks import drop_objects
from sweeps.engine.sweeping import RunOptions, sweep


class Calls(Counter[str]):
    """Numbers of cells computed; pickled by name, as results do not depend on the numbers."""

    def __reduce__(self):
        return "CALLS"


CALLS = Calls()
"""Number of cells that each stage computed in this process."""


class Spring(Settings, key="spring"):
    """A mass on a spring."""

    stiffness = number([1.0, 2.0, 4.0], 0, unit="N m-1", label="stiffness", role=DIMENSION)
    mass = number([1.0, 2.0], 0.1, unit="kg", label="mass", role=DIMENSION)
    limit = number(100.0, unit="s-1", label="largest angular frequency")
    reference = number(None, 0, unit="N m-1", label="stiffness compared with")


class Measured(Settings, key="measured"):
    """Settings of the measurements of a spring."""

    length = count([2, 4], 1, 50, label="samples", role=DIMENSION)
    draw = draws(2, label="draw")
    rule = word(["max", "mean"], ("max", "mean", "min"), label="rule", role=COORDINATE)
    doubled = switch(False, label="whether the answer is doubled")
    pause = number(0.0, 0, 10, unit="s", label="time that a period takes")


STATE = Status("answers", "state of the answers", (Spring.mass, Measured.length))


@derived(uses=(Spring,))
def rate(stiffness, mass):
    """Return the angular frequency [rad/s]; equal for some pairs of stiffness and mass."""
    return round(math.sqrt(stiffness / mass), 12)


@in_memory(uses=(Spring,))
def solver(rate):
    """Return an object that two stages use."""
    CALLS["solver"] += 1
    return {"rate": rate}


@stage(
    Output("period", unit="s", label="period", dtype="f8"),
    uses=(Spring, Measured),
    group=Group("springs"),
)
def period(solver, limit, pause):
    """Return the period [s]; raise ValueError where the angular frequency exceeds the limit."""
    CALLS["period"] += 1
    time.sleep(pause)
    if solver["rate"] > limit:
        raise ValueError("too [stiff]")
    return np.array(2 * math.pi / solver["rate"])


@stage(
    Output("energy", unit="J", label="energy", dtype="f8"),
    Output("shape", ("bin",), label="shape", pad=0),
    Output("first_bin", unit="m", label="bin", dtype="i4", role="inner"),
    uses=(Spring,),
    group=Group("springs"),
)
def energy(solver, mass):
    """Return the energy [J], a shape whose length grows with the mass, and its first bin."""
    CALLS["energy"] += 1
    bins = 1 + int(mass)
    begin = int(10 * solver["rate"])
    return {"energy": solver["rate"] ** 2, "shape": 1.0 + np.arange(bins), "first_bin": begin}


@stage(
    Output("noisy", unit="s", label="measured period", dtype="f8"),
    Output("drawn", label="noise without the period", without=("limit", "pause")),
    uses=(Spring, Measured),
    along=(Measured.length,),
    group=Group("springs", dims=("draw", "stiffness")),
    stream=Stream((Spring.stiffness, Spring.mass, Measured.draw)),
)
def noisy(period, length, draw, rng):
    """Return a measured period for every length; short ones use the first draws of longer ones."""
    CALLS["noisy"] += len(length)
    noise = rng.standard_normal(max(length))
    means = np.array([noise[:samples].mean() for samples in length])
    return {"noisy": period + means, "drawn": means}


@stage(
    Output("trace", ("time",), pad=np.nan, label="trace"),
    uses=(Spring, Measured),
    group=Group("springs"),
    stream=Stream((Spring.stiffness, Spring.mass, Measured.draw), "noisy"),
)
def trace(stiffness, length, draw, rng):
    """Return the stiffness plus noise of `length` samples."""
    CALLS["trace"] += 1
    return stiffness + rng.standard_normal(length)


@stage(
    Output("answer", unit="s", label="answer", dtype="f8"),
    Output("taken", ("stiffness",), label="whether it counted", dtype="i1", role="state"),
    uses=(Spring, Measured),
    gather=(Spring.stiffness,),
    along=(Measured.length, Measured.rule),
    group=Group("answers", status=STATE),
)
def answers(noisy, length, rule, doubled, valid):
    """Return max, mean or min over all valid springs by rule, and which springs counted."""
    CALLS["answers"] += len(length) * len(rule)
    functions = {"max": np.max, "mean": np.mean, "min": np.min}
    values = [
        [functions[name](noisy["noisy"][k][valid]) for name in rule] for k in range(len(length))
    ]
    flags = np.broadcast_to(valid.astype("i1"), (len(length), len(rule), len(valid)))
    return {"answer": np.array(values) * (2 if doubled else 1), "taken": flags}


@stage(
    Output("ratio", label="period by that of the reference", dtype="f8"),
    uses=(Spring,),
    reads={"period": At("period", {Spring.stiffness: Spring.reference})},
    group=Group(
        "references",
        lambda choices: choices[Spring.reference] != (None,),
        names={Spring.reference: "stiffness_there"},
    ),
    name="compared",
)
def compared(period, reference):
    """Return the period at the reference stiffness, divided by this stiffness."""
    CALLS["compared"] += 1
    return period / reference


def tabulated(answers, choices):
    """Return a table of the largest answer over all rules."""
    best = answers["answer"].max("rule") if "rule" in answers.dims else answers["answer"]
    best.attrs = {"units": "s", "long_name": "best answer"}
    return xr.Dataset({"best": best})


def checked(choices):
    """Return the choices; refuse a reference that is not one of the stiffnesses."""
    for value in choices[Spring.reference]:
        if value not in (None, *choices[Spring.stiffness]):
            raise ConfigurationError(
                f"spring.reference has {value:g}, but must be one of spring.stiffness"
            )
    return choices


SPRINGS = Experiment(
    "springs",
    "Springs",
    (
        *(Spring, Measured, rate, solver, period, energy, noisy, trace, answers, compared),
        Table("tables/best", ("answers",), tabulated),
    ),
    check=checked,
    code=("toys",),
)


def go(store, cache=None, kind="inline", workers=None, callbacks=None, **keywords):
    """Run the springs into a store; settings are given as `spring__mass=[1, 2]`."""
    keywords = {key.replace("__", "."): value for key, value in keywords.items()}
    choices = SPRINGS.check(read_choices(SPRINGS.declared, keywords))
    return run(SPRINGS, choices, store, cache, kind, workers, callbacks)


def run(
    experiment, choices, store, cache=None, kind="inline", workers=None, callbacks=None, **keywords
):
    """Run an experiment into a store."""
    drop_objects()  # a new process has none in memory
    place = path_or_url("store", store)
    cache = Path(cache or path_beside(place).with_suffix(".cache"))
    cluster = kind if isinstance(kind, ClusterChoice) else ClusterChoice(kind, workers)
    place = RunOptions(place, cache, cluster, **keywords)
    return sweep(Plan(experiment, choices), place, callbacks or Callbacks(lambda sentence: None))


class Recorder:
    """Collect the sentences and failures that a sweep reports to its callbacks."""

    def __init__(self):
        self.sentences, self.failures = [], []
        self.callbacks = Callbacks(self.sentences.append, failed=self.fail)

    def fail(self, failure):
        self.failures.append(failure[:2])


def having(experiment, stages=None, tables=None):
    """Return an experiment with other stages or tables."""
    settings = (part for part in experiment.parts if not isinstance(part, Stage | Table))
    stages = experiment.stages if stages is None else stages
    tables = experiment.tables if tables is None else tables
    return replace(experiment, parts=(*settings, *stages, *tables))


class Few(Settings, key="few"):
    """Settings of experiments with a few cells."""

    size = count([1, 2, 3], label="size")


def of(*stages):
    """Return an experiment of stages that take a size."""
    return Experiment("few", "Few", (Few, *stages))


def run_few(stages, store, cache=None, sizes=(1, 2, 3), **keywords):
    """Run stages that take a size into a store."""
    few = of(*stages)
    return run(few, read_choices(few.declared, {"few.size": list(sizes)}), store, cache, **keywords)


@stage(
    Output("took", label="time", unit="s", role="measured"),
    Output("square", label="square"),
    uses=(Few,),
    along=(Few.size,),
    group=Group("timed"),
)
def timed(size):
    """Return a measured time, different at each call, and a result that is always the same."""
    CALLS["timed"] += 1
    return {"took": CALLS["timed"] + np.arange(len(size)) / 8, "square": np.square(size)}
