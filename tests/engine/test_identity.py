"""Digests of functions include the content of all values they hold, and refuse other objects."""

import collections
import dataclasses
import enum
import functools
import json
import math
import threading
import typing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml
from hypothesis import given
from hypothesis import strategies as st
from running import ROOT, python

import sweeps
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.resolve.code import Code

NUMBERS = [1.0, 2.0]
PATHS = f"{ROOT}:{ROOT}/tests:{Path(__file__).parent}"


def digest(function, version=""):
    return Code(frozenset()).digest(function, version).digest


# ways to hold a value -----------------------------------------------------------------------------


@dataclasses.dataclass
class Scale:
    factor: float


class Scaling:
    def __init__(self, factor):
        self.factor = factor

    def scaled(self, x):
        return x * self.factor

    def __call__(self, x):
        return x * self.factor


def by_default(k):
    def scaled(x, factor=k):
        return x * factor

    return scaled


def by_named_default(k):
    def scaled(x, *, factor=k):
        return x * factor

    return scaled


def by_closure(k, of=lambda k: k):
    def scaled(x):
        return x * of(k)

    return scaled


def by_wrapper(k):
    def wrap(function):
        @functools.wraps(function)
        def times(x):
            return k * function(x)

        return times

    @wrap
    def scaled(x):
        return x

    return scaled


def by_global(k):
    space = {"__name__": "given", "K": k}
    exec("def scaled(x):\n    return x * float(K[0])", space)
    return space["scaled"]


def by_attribute(k):
    def scaled(x):
        return x * scaled.factor

    scaled.factor = k
    return scaled


HELD = {
    "a default": by_default,
    "a default of a keyword": by_named_default,
    "a number in a closure": by_closure,
    "a number of numpy": lambda k: by_closure(np.float32(k), float),
    "an array": lambda k: by_closure(np.array([k]), lambda a: a[0]),
    "a list": lambda k: by_closure([k], lambda a: a[0]),
    "a mapping": lambda k: by_closure({"k": [k]}, lambda a: a["k"][0]),
    "a data class": lambda k: by_closure(Scale(k), lambda a: a.factor),
    "a function": lambda k: by_closure(lambda: k, lambda a: a()),
    "a wrapper": by_wrapper,
    "a global list": lambda k: by_global([k]),
    "a global array": lambda k: by_global(np.array([k])),
    "a partial": lambda k: functools.partial(lambda x, factor: x * factor, factor=k),
    "a lambda": lambda k: lambda x: x * k,
    "a method": lambda k: Scaling(k).scaled,
    "an object": Scaling,
    "an attribute": by_attribute,
    "a cached function": lambda k: functools.cache(by_closure(k)),
}


@pytest.mark.parametrize("how", HELD)
def test_another_value_gives_its_own_results(tmp_path, how):
    for k in (2.0, 5.0, 2.0):
        results = sweeps.sweep(
            HELD[how](k), {"x": NUMBERS}, store=tmp_path / f"{k}.zarr", cache=tmp_path / "cache"
        )
        [name] = results.data_vars
        assert results[name].values.tolist() == [k * x for x in NUMBERS]
    assert digest(HELD[how](2.0)) == digest(HELD[how](2.0)) != digest(HELD[how](3.0))


def test_a_global_that_is_set_from_the_command_line_counts(tmp_path):
    (tmp_path / "scan.py").write_text(
        "import sys, sweeps\nGAIN = float(sys.argv[1])\ndef amplify(a):\n    return a * GAIN\n"
        "if __name__ == '__main__':\n    BIAS = GAIN\n"
        "    def biased(a):\n        return a + BIAS\n"
        "    for function in (amplify, biased):\n"
        "        at = f'{function.__name__}{GAIN}.zarr'\n"
        "        found = sweeps.sweep(function, {'a': [1.0]}, store=at, cache='cache')\n"
        "        print(float(found[function.__name__][0]))\n"
    )
    printed = [python("scan.py", gain, cwd=tmp_path).stdout.split() for gain in "25"]
    assert printed == [["2.0", "3.0"], ["5.0", "6.0"]]


@pytest.mark.parametrize(
    "made",
    [
        "def f(x): return 7 * x",
        "f = lambda x: 7 * x",
        "class F:\n  def f(s, x): return 7 * x\nf = F().f",
    ],
)
def test_functions_without_a_file_are_swept(tmp_path, made):
    options = f"store={str(tmp_path / 's.zarr')!r}, cache={str(tmp_path / 'c')!r}"
    swept = (
        f"found = sweeps.sweep(f, {{'x': [1.0, 2.0]}}, {options})\n"
        "print([*found.values()][0].values)"
    )
    assert python("-c", f"import sweeps\n{made}\n{swept}").stdout == "[ 7. 14.]\n"


def test_a_lambda_is_shipped_to_other_processes(tmp_path):
    values, captured = {"x": NUMBERS}, {"k": 3.0}
    results = sweeps.sweep(
        lambda x: x * captured["k"],
        values,
        store=tmp_path / "s.zarr",
        cache=tmp_path / "c",
        cluster="local",
    )
    assert results.result.values.tolist() == [3.0, 6.0]


# values -------------------------------------------------------------------------------------------


PLAIN = (
    st.none() | st.booleans() | st.integers(-3, 3) | st.floats(width=16) | st.text("ab", max_size=2)
    | st.binary(max_size=2) | st.sampled_from([1j, np.float32(1), np.int64(1), np.str_("a")])
)  # fmt: skip
VALUES = st.recursive(
    PLAIN,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text("ab", max_size=2), inner, max_size=3)
        | st.frozensets(st.integers(-3, 3) | st.text("ab", max_size=1), max_size=3)
        | st.builds(Scale, inner)
        | st.lists(st.floats(width=16), max_size=3).map(np.array)
    ),
    max_leaves=8,
)


def same(first, second):
    """Return whether two values have equal types and contents; compare numbers as printed."""
    if type(first) is not type(second):
        return False
    if isinstance(first, np.ndarray):
        return (
            first.dtype == second.dtype
            and first.shape == second.shape
            and first.tobytes() == second.tobytes()
        )
    if isinstance(first, Scale):
        return same(first.factor, second.factor)
    if isinstance(first, list | tuple):
        return len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(same(first[key], second[key]) for key in first)
    if isinstance(first, frozenset):
        return {(type(v), v) for v in first} == {(type(v), v) for v in second}
    return repr(first) == repr(second)


@given(VALUES, VALUES)
def test_digests_are_equal_where_values_are(first, second):
    assert (digest(by_default(first)) == digest(by_default(second))) == same(first, second)


@given(VALUES)
def test_a_copy_in_another_order_has_the_same_digest(value):
    def copied(part):
        if isinstance(part, dict):
            return {"".join(key): copied(part[key]) for key in reversed(part)}
        if isinstance(part, list | tuple):
            return type(part)(map(copied, part))
        if isinstance(part, frozenset):
            return frozenset(sorted(part, key=repr, reverse=True))
        return part.copy() if isinstance(part, np.ndarray) else part

    assert digest(by_default(value)) == digest(by_default(copied(value)))


PRINTED = """
import dataclasses, json
import test_identity as here
print(json.dumps(here.in_this_process()))
"""


class Colour(enum.Enum):
    RED = 1


class Pair(typing.NamedTuple):
    a: int
    b: int = 2


@functools.singledispatch
def kind(x):
    return x


@kind.register
def _(x: int):
    return 2 * x


@functools.lru_cache(maxsize=3)
def cached(x):
    return 2 * x


@np.vectorize
def several(x):
    return 2 * x


class Lazy:
    @functools.cached_property
    def half(self):
        return 0.5

    @property
    def third(self):
        return 1 / 3

    @staticmethod
    def quarter():
        return 0.25


SEVERAL = {
    "sets": {"bow", "stern", ("a", 1), frozenset("xyz")},
    "nested": {"b": [{"x", "y"}], "a": (1, {"c", "d"})},
    "array of objects": np.array([1, "a", None, {"x", "y"}], dtype=object),
    "record": np.zeros(2, [("a", "f8"), ("b", "i4")]),
    "masked": np.ma.masked_array([1, 2], [0, 1]),
    "generator": np.random.default_rng(3),
    "frame": pd.DataFrame({"a": [1.0, 2.0]}, index=["x", "y"]),
    "array with labels": xr.DataArray([1.0], dims="x", coords={"x": [3]}),
    "member": Colour.RED,
    "pair": Pair(1),
    "counter": collections.Counter("aab"),
    "class": Scale,
    "by type": kind,
    "cached": cached,
    "vectorized": several,
    "lazy": Lazy(),
    "builtin": math.sin,
    "ufunc": np.sin,
    "method": "bow".upper,
    "module": math,
}


def in_this_process():
    return {name: digest(by_default(value)) for name, value in SEVERAL.items()}


def test_digests_are_the_same_in_another_process():
    digests = [
        json.loads(python("-c", PRINTED, PYTHONPATH=PATHS, PYTHONHASHSEED=seed).stdout)
        for seed in "12"
    ]
    assert digests[0] == digests[1] and len({*digests[0].values()}) == len(SEVERAL)


def test_what_was_computed_from_an_object_is_no_part_of_it():
    lazy = Lazy()
    before = digest(by_default(lazy))
    assert lazy.half == 0.5 and digest(by_default(lazy)) == before


# code ---------------------------------------------------------------------------------------------


def made(text, name="f", **space):
    """Return a function defined by a source text, as in a notebook."""
    space = {"__name__": "__main__", "np": np, **space}
    exec(text, space)
    return space[name]


FUNCTIONS = yaml.safe_load(Path(__file__).with_name("functions.yaml").read_text())


@pytest.mark.parametrize(("first", "second"), FUNCTIONS["same"])
def test_the_same_code_has_the_same_digest(first, second):
    assert digest(made(first)) == digest(made(second))


@pytest.mark.parametrize(("first", "second"), FUNCTIONS["other"])
def test_other_code_has_another_digest(first, second):
    assert digest(made(first)) != digest(made(second))
    assert digest(made(first)) == digest(made(first))


def test_circles_and_shared_values_end():
    circle: list[object] = [1]
    circle.append({"circle": circle})
    other: list[object] = [1]
    other.append({"circle": other})
    assert digest(by_default(circle)) == digest(by_default(other)) != digest(by_default([1]))

    def recursive(k):
        def down(x):
            return up(x - 1) if x else k

        def up(x):
            return down(x)

        return down

    assert digest(recursive(1)) == digest(recursive(1)) != digest(recursive(2))
    shared: list[object] = [1.0]
    for _ in range(60):
        shared = [shared, shared]
    assert digest(by_default(shared)) == digest(by_default(shared))
    assert digest(by_default([[1], [1]])) == digest(by_default([[1]] * 2))


# values without content ---------------------------------------------------------------------------


def deep():
    nested: list[object] = []
    for _ in range(100_000):
        nested = [nested]
    return nested


NONE = {
    "TextIOWrapper": lambda: open(__file__),  # noqa: SIM115
    "generator": lambda: (x for x in NUMBERS),
    "lock": threading.Lock,
    "list": deep,
}


@pytest.mark.parametrize("kind_of", NONE)
def test_what_has_no_content_is_refused_by_its_name(tmp_path, kind_of):
    value = NONE[kind_of]()
    options = {"store": tmp_path / "s.zarr", "cache": tmp_path / "c"}
    values = {"x": NUMBERS}
    function = made("def f(x): return x if K else 0", K=value)
    with pytest.raises(ConfigurationError, match=f"^__main__.K .*'{kind_of}'.*give version='1'"):
        sweeps.sweep(function, values, **options)
    with pytest.raises(ConfigurationError, match=rf"^factor of .*scaled .*{kind_of}.*version="):
        sweeps.sweep(by_default([value]), values, **options)
    assert not (tmp_path / "s.zarr").exists()
    assert sweeps.sweep(function, values, version="1", **options).f.values.tolist() == NUMBERS


def test_eval_in_no_file_is_refused():
    with pytest.raises(
        ConfigurationError, match=r"^__main__.f uses eval.* is in no file.*version="
    ):
        digest(made("def f(x): return eval('x')"))


def test_a_version_counts_instead_of_code(tmp_path):
    def run(k, version):
        function = by_default(k)
        options = {"store": tmp_path / f"{version}{k}.zarr", "cache": tmp_path / "c"}
        return sweeps.sweep(function, {"x": [1.0]}, version=version, **options).scaled.item()

    assert [run(2.0, "1"), run(3.0, "1"), run(3.0, "2"), run(4.0, "")] == [2, 2, 3, 4]
