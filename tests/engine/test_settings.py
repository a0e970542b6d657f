"""Kinds of settings parse and sort valid values, and refuse others with the allowed range."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import (
    Count,
    Date,
    Draws,
    Groups,
    Number,
    SetOf,
    Switch,
    Text,
    Word,
)
from sweeps.engine.declare.settings import Settings, count, number, read_choices, set_of, text, word

finite = st.floats(-1e12, 1e12)
whole = st.integers(-(10**18), 10**18)


@settings(deadline=None)
@given(st.lists(finite, min_size=1, unique=True))
def test_numbers_are_sorted_in_ascending_order(values):
    read = Number().values("a.b", values)
    assert read == tuple(sorted(float(value) for value in values))
    assert all(math.copysign(1, value) == 1 for value in read if value == 0)


def test_words_are_sorted_in_declared_order():
    assert Word(("x", "y", "z")).values("a.b", ["z", "x"]) == ("x", "z")
    assert Switch().values("a.b", [True, False]) == (False, True)


@settings(deadline=None)
@given(st.lists(whole, min_size=1, unique=True))
def test_whole_numbers_are_not_rounded(values):
    assert Count(-(10**18)).values("a.b", values) == tuple(sorted(values))


EXACT = {
    "a small step": ((0.0, 3e-310, 1e-310), [0.0, 1e-310, 2e-310, 3e-310]),
    "decimals": ((0.0, 0.7, 0.1), [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]),
    "large decimals": ((1e6 + 0.1, 1e6 + 0.3, 0.1), [1000000.1, 1000000.2, 1000000.3]),
    "a rounded step": ((0.0, 5.0, 5 / 6), [0.0, 5 / 6, 10 / 6, 2.5, 20 / 6, 25 / 6, 5.0]),
    "a step beyond": ((0.0, 1.0, 0.4), [0.0, 0.4, 0.8]),
}


def test_dates_finer_than_the_unit_are_refused():
    assert Date("h").holds("2020-01-01T12") and Date("D").holds("2020-01-01T00")
    assert not Date("D").holds("2020-01-01T12")


@pytest.mark.parametrize("kind", EXACT)
def test_steps_are_exact_decimals(kind):
    steps, expected = EXACT[kind]
    read = Number().values("a.b", dict(zip(("start", "stop", "step"), steps, strict=True)))
    assert read == pytest.approx(expected, rel=4e-16, abs=0.0)
    if kind != "a rounded step":
        assert list(read) == expected


@settings(deadline=None)
@given(start=st.integers(-1000, 1000), step=st.integers(1, 1000), steps=st.integers(0, 500))
def test_steps_include_stop_if_they_reach_it(start, step, steps):
    range_ = {"start": start / 100, "stop": (start + step * steps) / 100, "step": step / 100}
    read = Number().values("a.b", range_)
    # Each product and quotient may err by one unit in the last place; 12 decimals are kept.
    expected = [(start + step * k) / 100 for k in range(steps + 1)]
    assert read == pytest.approx(expected, rel=1e-15, abs=1e-12)
    short = range_ | {"stop": (start + step * steps - step / 2) / 100}
    if steps:
        assert Number().values("a.b", short) == read[:-1]


UNIT = Number(0, below=1)
PAIRS = SetOf(Word(("x", "y")), spellings=(("both", ("x", "y")),))
REFUSED = [
    (Number(0, 9), 10, "a.b has 10, but must be a number from 0 to 9"),
    (Number(1, 1000, unit="km"), 100000, "a.b has 100000, but must be a number from 1 to 1000 km"),
    (Number(0, below=360, unit="degree"), "x", "a finite number at least 0 and below 360 degree"),
    (Number(0), [1, -1], "a.b has -1, but must be a finite number at least 0"),
    (UNIT, 1, "a.b has 1, but must be a finite number at least 0 and below 1"),
    (Number(), math.nan, "a.b has nan, but"),
    (Number(), 10**400, "but must be a finite number"),
    (Number(), True, "a.b has True, but"),
    (Number(), None, "a.b has null, but must be a finite number"),
    (Number(), [], "a.b is empty, but must hold at least one value"),
    (Number(), [1, 2, 1.0], "a.b has 1.0 more than once, but values must differ"),
    (Number(), {"start": 1, "stop": 2}, "a.b has the keys start, stop, but must have start"),
    (Number(), {"start": 2, "stop": 1, "step": 1}, "a.b runs from 2 to 1, but stop must not"),
    (Number(), {"start": 0, "stop": 1, "step": 0}, "a.b.step has 0, but must be above 0"),
    (Number(), {"start": 0, "stop": 1, "step": 1e-9}, "a.b.step is 1e-09, but must leave at most"),
    (Number(), {"start": 0, "stop": 1e300, "step": 5e-324}, "a.b.step is 4.94066e-324, but must"),
    (Number(), {"start": "0", "stop": 1, "step": 1}, "a.b.start has '0', but"),
    (Count(), 1.5, "a.b has 1.5, but must be a whole number"),
    (Word(("x", "y")), "z", "a.b has 'z', but must be one of x, y"),
    (Switch(), 1, "a.b has 1, but must be one of true, false"),
    (Text(), "", "a.b has '', but must be a text that is not empty"),
    (Text(), ["a", "a\0"], r"a.b has 'a\x00' more than once, but values must differ"),
    (Draws(9), 0, "a.b is 0, but must be a whole number from 1 to 9"),
    (Draws(9), 10, "a.b is 10, but must be a whole number from 1 to 9"),
    (PAIRS, "neither", "a.b is 'neither', but must be one of x, y, both"),
    (PAIRS, ["z"], "a.b has 'z', but must be one of x, y"),
    (Groups(), [["a"]], "a.b is [['a']], but must be a list of lists"),
]


@pytest.mark.parametrize(("kind", "given", "sentence"), REFUSED)
def test_invalid_values_are_refused_with_the_allowed_range(kind, given, sentence):
    with pytest.raises(ValueError) as refused:  # noqa: PT011
        kind.values("a.b", given)
    assert sentence in str(refused.value) and "\n" not in str(refused.value)


class Apart(Settings, key="apart"):
    """Settings of which one defaults to another, and one that may have only one value."""

    far = number([1.0, 2.0], label="far")
    near = number(far, label="near")
    only = count(1, label="only", not_swept="it shapes arrays")
    many = set_of(word(["x"], ("x", "y"), label="many"))
    name = text(None, label="name", dimension="called")


def test_settings_that_cannot_be_swept_explain_why():
    with pytest.raises(ConfigurationError) as refused:
        read_choices(Apart.declared, {"apart.only": [1, 2]})
    assert str(refused.value) == "apart.only has 2 values, but must have one: it shapes arrays"
