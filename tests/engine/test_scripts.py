"""Stages declared in scripts, functions or as lambdas never reuse results of other code."""

from dataclasses import replace
from pathlib import Path

import pytest
from running import python
from small_stores import opened
from toys import Few, of, run_few

from sweeps.engine.declare.settings import read_choices
from sweeps.engine.declare.stage import Group, Output, stage
from sweeps.engine.resolve.plan import Plan

SCRIPT = """
import sys
from pathlib import Path
from sweeps.engine.command.line import Command
from sweeps.engine.declare.settings import Settings, count
from sweeps.engine.declare.stage import Experiment, Group, Output, in_memory, stage

class Few(Settings, key="few"):
    "Sizes."
    size = count([1, 2, 3], label="size")

@in_memory()
def made():
    with Path("made.txt").open("a") as file:
        file.write("made ")
    return {factor}

@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def times(made, size):
    return made * size

if __name__ == "__main__":
    sys.exit(Command(Experiment("few", "Few", (Few, made, times))).main())
"""


@pytest.mark.parametrize("kind", ["inline", "local"])
def test_a_script_that_changed_is_computed_again(tmp_path, kind):
    for number, factor in enumerate((2, 5, 2)):
        (tmp_path / "script.py").write_text(SCRIPT.replace("{factor}", str(factor)))
        arguments = ["script.py", f"cluster={kind}", "cache=cache", f"store=s{number}.zarr"]
        arguments += ["cluster.workers=1"] if kind == "local" else []
        done = python(*arguments, cwd=tmp_path, check=False)
        assert done.returncode == 0, done.stderr
        results = opened(tmp_path / f"s{number}.zarr", "all").x
        assert results.values.tolist() == [factor, 2 * factor, 3 * factor]
        assert (Path(tmp_path) / "made.txt").read_text() == "made " * min(number + 1, 2)


def power(exponent):
    """Return a function that differs from others only in its closure."""

    def power_of(size):
        return float(size) ** exponent

    return power_of


def test_functions_of_one_name_do_not_share_results(tmp_path):
    value = Output("x", label="x", dtype="f8")
    stages = [
        stage(value, uses=(Few,), group=Group("double"), name="double")(lambda size: 2.0 * size),
        stage(value, uses=(Few,), group=Group("triple"), name="triple")(lambda size: 3.0 * size),
        stage(value, uses=(Few,), group=Group("square"), name="square")(power(2)),
        stage(value, uses=(Few,), group=Group("cube"), name="cube")(power(3)),
    ]
    stages.append(replace(stages[0], name="again", group=Group("again")))  # the same function
    finished = run_few(stages, tmp_path / "s.zarr")
    expected = {
        "double": [2, 4, 6],
        "triple": [3, 6, 9],
        "square": [1, 4, 9],
        "cube": [1, 8, 27],
    }
    for name, values in expected.items():
        assert opened(tmp_path / "s.zarr", name).x.values.tolist() == values
    assert finished.failures == []
    few = of(*stages)
    plan = Plan(few, read_choices(few.declared, {}))
    keys = {name: plan.key(plan.bound[name], 0) for name in (*expected, "again")}
    assert len(set(keys.values())) == 4 and keys["again"] == keys["double"]
