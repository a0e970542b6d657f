"""Digests of functions include the content of all values they hold, and refuse other objects."""

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
from executors import IMPORTS
from hypothesis import given
from hypothesis import strategies as st
from running import python

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.resolve.code import Code

NUMBERS = [1.0, 2.0]


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


def by_closure(k):
    def scaled(x):
        return x * k

    return scaled


def by_wrapper(k):
    @functools.wraps(by_default)
    def scaled(x):
        return k * x

    return scaled


def by_attribute(k):
    def scaled(x):
        return x * scaled.factor

    scaled.factor = k
    return scaled


HELD = {
    "a default": by_default,
    "a default of a keyword": by_named_default,
    "a closure": by_closure,
    "a list of functions": lambda k: lambda x, held=[lambda: k]: x * held[0](),
    "a wrapper": by_wrapper,
    "a partial": lambda k: functools.partial(lambda x, factor: x * factor, factor=k),
    "a lambda": lambda k: lambda x: x * k,
    "a method": lambda k: Scaling(k).scaled,
    "an object": Scaling,
    "an attribute": by_attribute,
    "a cached function": lambda k: functools.cache(by_closure(k)),
}


@pytest.mark.parametrize("how", HELD)
def test_captured_values_change_the_digest(how):
    assert HELD[how](2.0)(1.5) == 3.0
    assert digest(HELD[how](2.0)) == digest(HELD[how](2.0)) != digest(HELD[how](3.0))


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
        return (first.shape, first.tobytes()) == (second.shape, second.tobytes())
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
def test_digests_are_equal_only_for_equal_values(first, second):
    assert (digest(by_default(first)) == digest(by_default(second))) == same(first, second)


@given(VALUES)
def test_dict_order_does_not_change_the_digest(value):
    def copied(part):
        if isinstance(part, dict):
            return {"".join(key): copied(part[key]) for key in reversed(part)}
        if isinstance(part, list | tuple):
            return type(part)(map(copied, part))
        return part

    assert digest(by_default(value)) == digest(by_default(copied(value)))


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


class Lazy:
    @functools.cached_property
    def half(self):
        return 0.5


SEVERAL = {
    "sets": {"bow", "stern", ("a", 1), frozenset("xyz")},
    "array of objects": np.array([1, "a", None, {"x", "y"}], dtype=object),
    "masked": np.ma.masked_array([1, 2], [0, 1]),
    "generator": np.random.default_rng(3),
    "frame": pd.DataFrame({"a": [1.0, 2.0]}, index=["x", "y"]),
    "array with labels": xr.DataArray([1.0], dims="x", coords={"x": [3]}),
    "member": Colour.RED,
    "pair": Pair(1),
    "class": Scale,
    "by type": kind,
    "cached": cached,
    "lazy": Lazy(),
    "builtin": math.sin,
    "ufunc": np.sin,
    "method": "bow".upper,
    "module": math,
}


def several_digests():
    return {name: digest(by_default(value)) for name, value in SEVERAL.items()}


def test_digests_are_the_same_in_another_process():
    printing = "import json, test_identity; print(json.dumps(test_identity.several_digests()))"
    there = json.loads(python("-c", printing, PYTHONPATH=IMPORTS, PYTHONHASHSEED="1").stdout)
    assert there == several_digests() and len({*there.values()}) == len(SEVERAL)


def test_cached_properties_do_not_change_the_digest():
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
def test_equivalent_code_has_the_same_digest(first, second):
    assert digest(made(first)) == digest(made(second))


@pytest.mark.parametrize(("first", "second"), FUNCTIONS["other"])
def test_different_code_has_a_different_digest(first, second):
    assert digest(made(first)) != digest(made(second))
    assert digest(made(first)) == digest(made(first))


def test_cyclic_and_shared_values_are_digested():
    def circular():
        circle: list[object] = [1]
        circle.append({"circle": circle})
        return digest(by_default(circle))

    assert circular() == circular() != digest(by_default([1]))

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
def test_values_that_cannot_be_digested_are_refused_by_name(sweep, tmp_path, kind_of):
    value = NONE[kind_of]()
    with pytest.raises(ConfigurationError, match=f"^__main__.K .*'{kind_of}'.*give version='1'"):
        digest(made("def f(x): return x if K else 0", K=value))
    with pytest.raises(ConfigurationError, match=rf"^factor of .*scaled .*{kind_of}.*version="):
        sweep(by_default([value]), {"x": [1.0]})
    assert not (tmp_path / "s.zarr").exists()


def test_eval_without_a_source_file_is_refused():
    with pytest.raises(
        ConfigurationError, match=r"^__main__.f uses eval.* is in no file.*version="
    ):
        digest(made("def f(x): return eval('x')"))


def test_explicit_version_replaces_the_code_digest(sweep):
    def run(k, version):
        options = {"store": f"{version}{k}.zarr", "version": version}
        return sweep(by_default(k), {"x": [1.0]}, **options).scaled.item()

    assert [run(2.0, "1"), run(3.0, "1"), run(3.0, "2"), run(4.0, "")] == [2, 2, 3, 4]
