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
from small_stores import opened

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
    assert isinstance(size, int)
    return len(word) * size if flag else 0


def area(x, y):
    return x * y


def positional(a, /):
    return a


def own(own):
    return own


def test_a_function_over_a_grid_is_resumed_and_extended(tmp_path):
    def run(**values):
        CALLS.clear()
        return sweeps.sweep(product, values, store=tmp_path / "s.zarr", cache=tmp_path / "c")

    results = run(x=[2, 1], y=np.array([0.5, 1.5]))
    assert results["product"].dims == ("x", "y") and len(CALLS) == 4
    assert results["product"].sel(x=2, y=1.5) == 6 and results.x.values.tolist() == [1, 2]
    assert run(x=[1, 2], y=[0.5, 1.5]).equals(results) and not CALLS
    more = run(x=[1, 2, 3], y=[0.5, 1.5])
    assert CALLS == [(3, 0.5), (3, 1.5)] and more.sel(x=[1, 2]).equals(results)
    options = {"store": tmp_path / "t.zarr", "cache": tmp_path / "d", "cluster": "local"}
    elsewhere = sweeps.sweep(product, {"x": [1, 2], "y": [0.5, 1.5]}, **options)
    assert elsewhere.equals(results) and len(CALLS) == 2  # worker processes made the other calls
    both = (
        r"values\['x'\] is 4, but .* has 1, 2, 3: give values={'x': \[1, 2, 3, 4\], ...} to have bo"
    )
    with pytest.raises(ConfigurationError, match=both):
        run(x=[4], y=[0.5, 1.5])


def test_arrays_noise_and_values_of_other_types(tmp_path):
    def run(function, values, **options):
        store, cache = tmp_path / f"{function.__name__}.zarr", tmp_path / "c"
        return sweeps.sweep(function, values, store=store, cache=cache, **options)

    assert run(powers, {"base": [2.0]}, dims=("power",)).powers.values.tolist() == [[1, 2, 4, 8]]
    first = run(noise, {"sigma": [1.0, 2.0]}, seed=3).noise
    assert first.equals(run(noise, {"sigma": [1.0, 2.0]}, seed=3).noise)
    assert first[0] != first[1] / 2  # each cell has its own random stream
    results = run(
        mixed, {"word": ["bow", "stern"], "flag": [False, True], "size": [1, 2]}, dtype="i4"
    )
    assert results.mixed.sel(word="stern", flag=True, size=2) == 10


def test_a_function_may_have_the_name_of_the_group_of_states(tmp_path):
    def status(x):
        return 2 * x

    results = sweeps.sweep(status, {"x": [1, 2]}, store=tmp_path / "s.zarr", cache=tmp_path / "c")
    assert results.status.values.tolist() == [2, 4]
    assert opened(tmp_path / "s.zarr", "status").status.values.tolist() == [1, 1]


def test_what_failed_is_named_and_the_rest_is_kept(tmp_path):
    values = {"base": [-1.0, 2.0]}
    options = {"store": tmp_path / "s.zarr", "cache": tmp_path / "c", "dims": ("power",)}
    with pytest.warns(CallsFailedWarning) as warned:
        results = sweeps.sweep(powers, values, **options)
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
        (
            product,
            {"x": [1, "a"], "y": [1]},
            r"values\['x'\] has 'a', but every value must be a fini",
        ),
        (product, {"x": 5, "y": [1]}, r"values\['x'\] is 5, but must be .* alone is {'x': \[5\]}"),
        (product, {"x": "abc", "y": [1]}, "one alone is {'x': .'abc'.}"),
        (product, {"x": np.ones((2, 2)), "y": [1]}, "is an array of 2 dimensions, but must have"),
        (product, {"x": [1, 10**30], "y": [1]}, "has 10+, but every value must be a whole number"),
        (product, {"x": [-(2**63) - 1], "y": [1]}, "has -9223372036854775809, but every value mu"),
        (product, {"x": [1 + 2j], "y": [1]}, "must be a finite number"),
        (product, {"x": [np.nan], "y": [1]}, "has nan, but every value must be a finite number"),
        (product, {"x": [None], "y": [1]}, "has None, but every value must be a finite number"),
        (product, {"x": np.array([3], "m8[ns]"), "y": [1]}, "must be a finite number"),
        (product, {"x": np.array(["NaT"], "M8[s]"), "y": [1]}, "a time from 1678 to 2261"),
        (product, {"x": [datetime(1, 1, 1)], "y": [1]}, "a time from 1678 to 2261"),
        (product, {"x": [datetime(2020, 1, 1, tzinfo=UTC)], "y": [1]}, "without a zone"),
        (product, [1, 2], r"values is \[1, 2\], but must be a mapping of arguments"),
        (noise, {"sigma": [1], "rng": [1]}, "values has 'rng', a reserved name"),
        (positional, {"a": [1]}, "positional takes 'a' by position only, .* lambda a: positional"),
        (product, {"x": [1]}, "values lacks 'y', which product takes"),
        (product, {"product": [1]}, "values has 'product', but product takes x, y, scale"),
        (own, {"own": [1]}, "own is named like the setting own.own; rename one of them"),
        (np.sin, {"x": [1]}, "sin takes 'x' by position only"),
        (partial(product, 1), {"x": [1]}, "values has 'x', but product takes y, scale"),
        (product, dict.fromkeys("xy", range(10**4)), "has 100,000,000 cells, but may have at most"),
        (lambda *args: 1, {"x": [1]}, "takes no name"),
        (min, {"x": [1]}, "function is min, whose arguments Python cannot inspect"),
        (3, {"x": [1]}, "function is 3, but must be a callable"),
    ],
)
def test_mistakes_are_named(tmp_path, function, values, sentence):
    with pytest.raises(ConfigurationError, match=sentence):
        sweeps.sweep(function, values, store=tmp_path / "s.zarr", cache=tmp_path / "c")
    assert not (tmp_path / "s.zarr").exists()


def leaving(a):
    """Exit for 2, as a parser of arguments does."""
    if a == 2:
        sys.exit(3)
    return a


def ending(a):
    """End the process for 2, unless it is the process of the tests."""
    if a == 2 and multiprocessing.parent_process() is not None:
        os._exit(1)
    return float(a)


def moving(a):
    """Change the working folder, as wrappers of old simulators do."""
    os.chdir(tempfile.mkdtemp())
    return a


@pytest.mark.parametrize("cluster", ["inline", "local"])
def test_a_call_that_exits_fails(tmp_path, cluster):
    options = {"store": tmp_path / "s.zarr", "cache": tmp_path / "c", "cluster": cluster}
    with pytest.warns(CallsFailedWarning, match="leaving a=2: SystemExit: 3"):
        results = sweeps.sweep(leaving, {"a": [1, 2, 3]}, **options)
    np.testing.assert_array_equal(results.leaving, [1, np.nan, 3])


def test_a_call_that_kills_its_process_kills_no_other(tmp_path):
    """This also holds for a stage that an earlier sweep has shown to be quick."""
    options = {"store": tmp_path / "s.zarr", "cache": tmp_path / "c"}
    assert sweeps.sweep(ending, {"a": [1]}, **options).ending.item() == 1
    with pytest.warns(
        CallsFailedWarning, match="ending a=2: RuntimeError: the worker process died"
    ):
        results = sweeps.sweep(ending, {"a": [1, 2, 3]}, cluster="local", **options)
    np.testing.assert_array_equal(results.ending, [1, np.nan, 3])


def test_relative_paths_are_where_the_command_was_given(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sweeps.sweep(moving, {"a": [1, 2]}, store="s.zarr", cache="c")
    assert os.getcwd() == str(tmp_path) and sorted(os.listdir()) == ["c", "s.zarr"]


DOUBLE = """import sweeps

def double(a):
    return a * 2.0

{guard}
    how = dict(store="s.zarr", cache="c", cluster="local")
    print(sweeps.sweep(double, {{"a": [1, 2]}}, **how).double.values.tolist())
"""


@pytest.mark.parametrize("way", ["script", "-c", "stdin"])
def test_workers_of_a_script_a_word_and_a_prompt(tmp_path, way):
    code = DOUBLE.format(guard="if __name__ == '__main__':")
    (tmp_path / "job.py").write_text(code)
    arguments = {"script": ["job.py"], "-c": ["-c", code], "stdin": ["-"]}[way]
    ran = begun(arguments, tmp_path, code)
    assert (ran.stdout, ran.stderr, ran.returncode) == ("[2.0, 4.0]\n", "", 0)


def test_a_script_without_guard_is_refused_in_a_sentence(tmp_path):
    (tmp_path / "job.py").write_text(DOUBLE.format(guard="if True:"))
    ran = begun(["job.py"], tmp_path)
    lines = ran.stderr.splitlines()
    assert ran.returncode == 1 and len(lines) < 10
    assert lines[-1] == (
        "sweeps.engine.declare.errors.ConfigurationError: cluster is local, whose workers run "
        'job.py again, but line 8 of it is not guarded; put it under `if __name__ == "__main__":`, '
        "or use inline"
    )


def begun(arguments, folder, text=""):
    """Run Python; return the completed process with its output."""
    path = os.pathsep.join(filter(None, (os.getcwd(), os.environ.get("PYTHONPATH"))))
    options = {"cwd": folder, "env": os.environ | {"PYTHONPATH": path}, "timeout": 120}
    options |= {"capture_output": True, "text": True, "check": False}
    return subprocess.run([sys.executable, *arguments], input=text, **options)


def test_help_opens_with_an_example(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = sweeps.sweep.__doc__
    assert text.index(">>>") < 200
    parser, namespace = doctest.DocTestParser(), {"sweeps": sweeps}
    example = parser.get_doctest(
        text.partition("Earlier results")[0], namespace, "sweep", __file__, 0
    )
    assert not doctest.DocTestRunner().run(example).failed and example.examples


def test_what_is_offered_is_documented():
    offered = {name for name in dir(sweeps) if not name.startswith("_")}
    assert offered == {*sweeps.__all__} and all(hasattr(sweeps, name) for name in offered)
    offered = [name for name in dir(ncti) if not name.startswith("_")]
    assert {"simulate", "dataset"} <= {*offered} and not {"Any", "import_module"} & {*offered}
    assert all(name in ncti.__doc__ for name in offered)


def test_a_dry_run_says_what_would_be_computed(tmp_path, capsys):
    options = {"store": tmp_path / "s.zarr", "cache": tmp_path / "c"}
    results = sweeps.sweep(area, {"x": [1, 2], "y": [1.0]}, dry_run=True, **options)
    message = (
        "area: 2 to compute, 0 reused; 2 calls to run; new results unknown; time on one core unk"
    )
    assert capsys.readouterr().out.startswith(message) and results.attrs["left"] == 2
    assert (
        not (tmp_path / "s.zarr").exists() and not (tmp_path / "c").exists() and not results.sizes
    )
    sweeps.sweep(area, {"x": [1, 2], "y": [1.0]}, **options)
    results = sweeps.sweep(area, {"x": [1, 2, 3], "y": [1.0]}, dry_run=True, **options)
    assert (results.attrs["left"], results.attrs["reused"]) == (1, 2)
    message = "area: 1 to compute, 2 reused; 1 calls to run; new results 9"
    assert capsys.readouterr().out.startswith(message[:-1])
    sweeps.sweep(area, {"x": [1, 2], "y": [1.0]}, dry_run=True, **options)
    assert (
        capsys.readouterr().out
        == "area: 0 to compute, 2 reused; nothing to compute: all cells are in the store\n"
    )


@pytest.mark.parametrize("where", ["file", "terminal", "notebook"])
def test_progress_is_shown_in_a_terminal_and_a_notebook(tmp_path, monkeypatch, capsys, where):
    drawn = []

    class Handle:
        """Handle of a display in a notebook."""

        def update(self, table):
            drawn.append(table)

    def display(table, display_id):
        drawn.append(table)
        return Handle()

    if where == "terminal":
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    if where == "notebook":
        offered = {"display": display}
        monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
        monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(**offered))
        monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    options = {"store": tmp_path / "s.zarr", "cache": tmp_path / "c"}
    sweeps.sweep(area, {"x": [1, 2], "y": [1.0]}, **options)
    printed = capsys.readouterr()
    assert not printed.out and ("2/2" in printed.err) == (where == "terminal")
    assert bool(drawn) == (where == "notebook") and len({*map(type, drawn)}) <= 1
    drawn.clear()
    sweeps.sweep(area, {"x": [1, 2], "y": [1.0]}, **options)
    assert not drawn  # nothing is computed
