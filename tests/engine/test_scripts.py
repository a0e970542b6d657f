"""Stages declared in a script, in functions, or as lambdas: results are those of their code."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cloudpickle
import pytest
from small_stores import opened
from toys import run

from sweeps.engine.errors import DeclarationError
from sweeps.engine.plan import Plan
from sweeps.engine.settings import Settings, count, read_choices
from sweeps.engine.stage import Experiment, Output, in_memory, plain, stage
from sweeps.engine.tasks import Step, _kept_of, forget_all

SCRIPT = """
import sys
from pathlib import Path
from sweeps.engine.command import Command
from sweeps.engine.settings import Settings, count
from sweeps.engine.stage import Experiment, Output, in_memory, stage

class Few(Settings, key="few"):
    "Sizes."
    size = count([1, 2, 3], label="size")

@in_memory()
def made():
    with Path("made.txt").open("a") as file:
        file.write("made ")
    return {factor}

@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group="all")
def times(made, size):
    return made * size

if __name__ == "__main__":
    sys.exit(Command(Experiment("few", "Few", (Few,), (made, times))).main())
"""


@pytest.mark.parametrize("kind", ["inline", "local"])
def test_a_script_that_changed_is_computed_again(tmp_path, kind):
    for number, factor in enumerate((2, 5, 2)):
        (tmp_path / "script.py").write_text(SCRIPT.replace("{factor}", str(factor)))
        command = [sys.executable, "script.py", f"cluster={kind}", "cache=cache"]
        command += [f"store=s{number}.zarr", *(["cluster.workers=1"] if kind == "local" else [])]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        found = opened(tmp_path / f"s{number}.zarr", "all").x
        assert found.values.tolist() == [factor, 2 * factor, 3 * factor]
        assert (Path(tmp_path) / "made.txt").read_text() == "made " * min(number + 1, 2)


def test_objects_of_functions_that_come_with_a_task_are_kept():
    """Each task brings another copy of such a function; the memory of a worker does not grow."""
    declared = in_memory(name="one")(lambda: 1)
    first, second = (cloudpickle.loads(cloudpickle.dumps(Step.of(declared))) for _ in range(2))
    assert first.function is not second.function
    forget_all()
    assert _kept_of(first) is _kept_of(second)
    forget_all()


class Few(Settings, key="few"):
    """Of stages without a name of their own."""

    size = count([1, 2, 3], label="size")


def power(exponent):
    """A function that differs from others in what it encloses only."""

    def made(size):
        return float(size) ** exponent

    return made


def test_functions_of_one_name_do_not_share_results(tmp_path):
    value = Output("x", label="x", dtype="f8")
    stages = [
        stage(value, uses=(Few,), group="double", name="double")(lambda size: 2.0 * size),
        stage(value, uses=(Few,), group="triple", name="triple")(lambda size: 3.0 * size),
        stage(value, uses=(Few,), group="square", name="square")(power(2)),
        stage(value, uses=(Few,), group="cube", name="cube")(power(3)),
    ]
    stages.append(replace(stages[0], name="again", group="again"))  # the same function
    experiment = Experiment("few", "Few", (Few,), tuple(stages))
    choices = read_choices(experiment.declared, {})
    finished = run(experiment, choices, tmp_path / "s.zarr")
    expected = {
        "double": [2, 4, 6],
        "triple": [3, 6, 9],
        "square": [1, 4, 9],
        "cube": [1, 8, 27],
    }
    for name, values in expected.items():
        assert opened(tmp_path / "s.zarr", name).x.values.tolist() == values
    assert finished.failures == []
    plan = Plan(experiment, choices)
    keys = {name: plan.key(plan.bound[name], (0,)) for name in (*expected, "again")}
    assert len(set(keys.values())) == 5


def test_an_address_is_no_part_of_a_key():
    """A plain result without a representation of its own would be another one in each process."""
    odd = plain(uses=(Few,), name="odd")(lambda size: (size, object()))
    kept = stage(Output("x", label="x"), group="all", name="kept")(lambda odd: 1.0)
    experiment = Experiment("few", "Few", (Few,), (odd, kept))
    plan = Plan(experiment, read_choices(experiment.declared, {}))
    with pytest.raises(DeclarationError) as refused:
        plan.key(plan.bound["kept"], (0,))
    assert str(refused.value) == (
        "stage odd returned 'object', but a plain stage must return a number, text, null or tuple "
        "of them, or what has an identity"
    )
