"""`sweeps.sweep` sweeps one function without declarations and refuses wrong arguments."""

import doctest
import multiprocessing
import os
import subprocess
import sys
import tempfile
from datetime import UTC, datetime
from functools import partial
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from running import ROOT
from small_stores import files

import ncti
import sweeps
from sweeps.engine.declare.errors import CallsFailedWarning, ConfigurationError

CALLS: list[tuple[float, float]] = []


def product(x, y, scale=2.0):
    """Return the product of two numbers and a scale, 2 unless given."""
    CALLS.append((x, y))
    return scale * x * y


def powers(base):
    """Return the powers of a base from 0 to 3; fail if it is negative."""
    if base < 0:
        raise ValueError("negative")
    return base ** np.arange(4)


def noise(sigma, rng):
    """Return a random number."""
    return sigma * rng.normal()


def mixed(word, flag, size):
    """Return a number computed from values of three types."""
    return len(word) * size if flag and isinstance(size, int) else 0


def area(x, y):
    return x * y


def positional(a, /):
    return a


def own(own):
    return own


def test_function_sweep_is_resumed_and_extended(sweep):
    def run(**values):
        CALLS.clear()
        return sweep(product, values)

    results = run(x=[2, 1], y=np.array([0.5, 1.5]))
    assert results["product"].dims == ("x", "y") and len(CALLS) == 4
    assert results["product"].sel(x=2, y=1.5) == 6 and results.x.values.tolist() == [1, 2]
    assert run(x=[1, 2], y=[0.5, 1.5]).equals(results) and not CALLS
    more = run(x=[1, 2, 3], y=[0.5, 1.5])
    assert CALLS == [(3, 0.5), (3, 1.5)] and more.sel(x=[1, 2]).equals(results)
    scale, values = 2.0, {"x": [1, 2], "y": [0.5, 1.5]}
    elsewhere = sweep(lambda x, y: scale * x * y, values, store="t", cluster="local")
    np.testing.assert_array_equal(elsewhere.result, results["product"])
    both = (
        r"values\['x'\] is 4, but .* has 1, 2, 3: give values={'x': \[1, 2, 3, 4\], ...} to have bo"
    )
    with pytest.raises(ConfigurationError, match=both):
        run(x=[4], y=[0.5, 1.5])


def test_array_results_random_noise_and_mixed_argument_types(sweep):
    found = sweep(powers, {"base": [2.0]}, dims=("power",), store="powers")
    assert found.powers.values.tolist() == [[1, 2, 4, 8]]
    first, again = (sweep(noise, {"sigma": [1.0, 2.0]}, seed=3, store=name) for name in "ab")
    assert first.equals(again)
    assert first.noise[0] != first.noise[1] / 2  # each cell has its own random stream
    values = {"word": ["bow", "stern"], "flag": [False, True], "size": [1, 2]}
    results = sweep(mixed, values, dtype="i4", store="mixed")
    assert results.mixed.sel(word="stern", flag=True, size=2) == 10


def test_function_may_be_named_status(sweep):
    def status(x):
        return 2 * x

    assert sweep(status, {"x": [1, 2]}).status.values.tolist() == [2, 4]


def test_failed_calls_are_reported_and_other_results_kept(sweep):
    with pytest.warns(CallsFailedWarning) as warned:
        results = sweep(powers, {"base": [-1.0, 2.0]}, dims=("power",))
    np.testing.assert_array_equal(results.powers, [[np.nan] * 4, [1, 2, 4, 8]])
    lines = str(warned[0].message).splitlines()
    assert lines[:3] == [
        "1 of 2 calls failed; the same sweep tries them again",
        "  powers base=-1: ValueError: negative",
        "The first of them, with base = -1.0:",
    ]
    assert lines[3].startswith("Traceback") and lines[-1] == "ValueError: negative"
    assert warned[0].filename == __file__


@pytest.mark.parametrize(
    ("function", "values", "sentence"),
    [
        (product, {"x": [1], "z": [1]}, "values has 'z', but product takes x, y, scale"),
        (product, {"x": [], "y": [1]}, r"values\['x'\] is empty"),
        (product, {"x": [1, 1], "y": [1]}, "more than once"),
        (product, {"x": [1, "a"], "y": [1]}, r"values\['x'\] has 'a', but every value must be a f"),
        (product, {"x": 5, "y": [1]}, r"values\['x'\] is 5, but must be .* alone is {'x': \[5\]}"),
        (product, {"x": np.ones((2, 2)), "y": [1]}, "is an array of 2 dimensions, but must have"),
        (product, {"x": [-(2**63) - 1], "y": [1]}, "has -9223372036854775809, but every value mu"),
        (product, {"x": [np.nan], "y": [1]}, "has nan, but every value must be a finite number"),
        (product, {"x": np.array(["NaT"], "M8[s]"), "y": [1]}, "a time from 1678 to 2261"),
        (product, {"x": [datetime(1, 1, 1)], "y": [1]}, "a time from 1678 to 2261"),
        (product, {"x": [datetime(2020, 1, 1, tzinfo=UTC)], "y": [1]}, "without a zone"),
        (product, [1, 2], r"values is \[1, 2\], but must be a mapping of arguments"),
        (noise, {"sigma": [1], "rng": [1]}, "values has 'rng', a reserved name"),
        (positional, {"a": [1]}, "positional takes 'a' by position only, .* lambda a: positional"),
        (product, {"x": [1]}, "values lacks 'y', which product takes"),
        (own, {"own": [1]}, "own is named like the setting own.own; rename one of them"),
        (partial(product, 1), {"x": [1]}, "values has 'x', but product takes y, scale"),
        (product, dict.fromkeys("xy", range(10**4)), "has 100,000,000 cells, but may have at most"),
        (min, {"x": [1]}, "function is min, whose arguments Python cannot inspect"),
        (3, {"x": [1]}, "function is 3, but must be a callable"),
    ],
)
def test_invalid_arguments_are_refused(sweep, tmp_path, function, values, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        sweep(function, values)
    assert list(tmp_path.iterdir()) == []


def ending(a):
    """End the process for 2, unless it is the process of the tests."""
    if a == 2 and multiprocessing.parent_process() is not None:
        os._exit(1)
    return float(a)


def moving(a):
    """Change the working folder, as wrappers of old simulators do."""
    os.chdir(tempfile.mkdtemp())
    return a


def test_a_call_that_exits_fails(sweep):
    with pytest.warns(CallsFailedWarning, match="result a=2: SystemExit: 3"):
        results = sweep(lambda a: sys.exit(3) if a == 2 else a, {"a": [1, 2, 3]})
    np.testing.assert_array_equal(results.result, [1, np.nan, 3])


def test_call_that_kills_its_worker_fails_alone(sweep):
    """This also holds for a stage that an earlier sweep has shown to be quick."""
    assert sweep(ending, {"a": [1]}).ending.item() == 1
    with pytest.warns(
        CallsFailedWarning, match="ending a=2: RuntimeError: the worker process died"
    ):
        results = sweep(ending, {"a": [1, 2, 3]}, cluster="local")
    np.testing.assert_array_equal(results.ending, [1, np.nan, 3])


def test_relative_paths_resolve_against_the_initial_directory(sweep, tmp_path):
    sweep(moving, {"a": [1, 2]})
    assert os.getcwd() == str(tmp_path) and sorted(os.listdir()) == ["c", "s.zarr"]


DOUBLE = """import sweeps

def double(a):
    return a * 2.0

{guard}
    how = dict(store="s.zarr", cache="c", cluster="local")
    print(sweeps.sweep(double, {{"a": [1, 2]}}, **how).double.values.tolist())
"""


def test_workers_run_functions_from_stdin_scripts(tmp_path):
    ran = begun(["-"], tmp_path, DOUBLE.format(guard="if __name__ == '__main__':"))
    assert (ran.stdout, ran.stderr, ran.returncode) == ("[2.0, 4.0]\n", "", 0)


def test_script_without_main_guard_is_refused(tmp_path):
    (tmp_path / "job.py").write_text(DOUBLE.format(guard="if True:"))
    ran = begun(["job.py"], tmp_path)
    lines = ran.stderr.splitlines()
    assert ran.returncode == 1 and len(lines) < 10
    assert "cluster is local, whose workers run job.py again, but line" in lines[-1]


AREA = """import sys, sweeps

def area(width, height):
    return width * height

sweeps.sweep(area, {"width": [1], "height": [2]}, store=sys.argv[1], cache="c")
"""


def test_store_is_independent_of_the_hash_seed(tmp_path):
    """The order in which Python lists a set differs between processes."""
    for seed in ("5", "6"):  # which list the two arguments in either order
        ran = begun(["-c", AREA, seed], tmp_path, PYTHONHASHSEED=seed)
        assert ran.returncode == 0, ran.stderr
    assert files(tmp_path / "5") == files(tmp_path / "6")


def begun(arguments, folder, text="", **variables):
    """Run Python; return the completed process with its output."""
    options = {"cwd": folder, "env": os.environ | {"PYTHONPATH": str(ROOT)} | variables}
    options["timeout"] = 120
    options |= {"capture_output": True, "text": True, "check": False}
    return subprocess.run([sys.executable, *arguments], input=text, **options)


def test_help_opens_with_an_example(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = sweeps.sweep.__doc__.partition("Earlier results")[0]
    assert text.index(">>>") < 200
    example = doctest.DocTestParser().get_doctest(text, {"sweeps": sweeps}, "sweep", __file__, 0)
    assert not doctest.DocTestRunner().run(example).failed


def test_public_names_are_exported_and_documented():
    offered = {name for name in dir(sweeps) if not name.startswith("_")}
    assert offered == {*sweeps.__all__} and all(hasattr(sweeps, name) for name in offered)
    offered = [name for name in dir(ncti) if not name.startswith("_")]
    assert {"simulate", "dataset"} <= {*offered} and not {"Any", "import_module"} & {*offered}
    assert all(name in ncti.__doc__ for name in offered)


def test_dry_run_reports_pending_calls(sweep, tmp_path, capsys):
    results = sweep(area, {"x": [1, 2], "y": [1.0]}, dry_run=True)
    message = "area: 2 to compute, 0 reused; 2 calls to run; new results unknown; time on one core"
    assert capsys.readouterr().out.startswith(message) and results.attrs["left"] == 2
    assert list(tmp_path.iterdir()) == [] and not results.sizes
    sweep(area, {"x": [1, 2], "y": [1.0]})
    results = sweep(area, {"x": [1, 2, 3], "y": [1.0]}, dry_run=True)
    assert (results.attrs["left"], results.attrs["reused"]) == (1, 2)
    message = "area: 1 to compute, 2 reused; 1 calls to run; new results "
    assert capsys.readouterr().out.startswith(message)


@pytest.mark.parametrize("where", ["file", "terminal", "notebook"])
def test_progress_is_shown_in_a_terminal_and_a_notebook(sweep, monkeypatch, capsys, where):
    drawn = []

    def display(table, display_id):
        drawn.append(table)
        return SimpleNamespace(update=drawn.append)

    if where == "terminal":
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    if where == "notebook":
        monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
        monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
        monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    sweep(area, {"x": [1, 2], "y": [1.0]})
    printed = capsys.readouterr()
    assert not printed.out and ("2/2" in printed.err) == (where == "terminal")
    assert bool(drawn) == (where == "notebook") and len({*map(type, drawn)}) <= 1
