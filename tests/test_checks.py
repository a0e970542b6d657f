"""What the checks of arguments refuse, and in which words."""

import math
import re
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from ncti.checks import require, require_all, require_each, require_generator

NUMBERS = st.floats() | st.integers() | st.booleans() | st.fractions()


@given(
    value=NUMBERS,
    minimum=st.none() | st.floats(allow_nan=False),
    maximum=st.none() | st.floats(allow_nan=False),
    below=st.none() | st.floats(allow_nan=False),
    positive=st.booleans(),
    whole=st.booleans(),
)
def test_a_number_is_refused_exactly_if_out_of_bounds(
    value, minimum, maximum, below, positive, whole
):
    """Against each bound by itself."""
    number = float(value)
    right = [
        not math.isnan(number) and not math.isinf(number),
        minimum is None or number >= minimum,
        maximum is None or number <= maximum,
        below is None or number < below,
        not positive or number > 0,
        not whole or (math.isfinite(number) and number == math.floor(number)),
    ]
    given_bounds = {"minimum": minimum, "maximum": maximum, "below": below}
    bounds = {name: bound for name, bound in given_bounds.items() if bound is not None}
    if all(right):
        require("wind", value, positive=positive, whole=whole, **bounds)
    else:
        with pytest.raises(ValueError, match=r"^wind is .*, but must be a "):
            require("wind", value, positive=positive, whole=whole, **bounds)


@pytest.mark.parametrize(
    ("value", "bounds", "sentence"),
    [
        (math.nan, {}, "wind is nan, but must be a finite number"),
        (0, {"positive": True}, "wind is 0, but must be a finite number above 0"),
        (3, {"maximum": 2}, "wind is 3, but must be a finite number at most 2"),
        (1.5, {"whole": True, "minimum": 1}, "wind is 1.5, but must be a whole number at least 1"),
        (
            1.0,
            {"minimum": 0, "below": 1},
            "wind is 1.0, but must be a finite number at least 0 and below 1",
        ),
        ("3", {}, "wind is '3', but must be a finite number"),
        (b"3", {}, "wind is b'3', but must be a finite number"),
        (None, {}, "wind is None, but must be a finite number"),
        ([1, 2], {}, "wind is [1, 2], but must be a finite number"),
        (2j, {}, "wind is 2j, but must be a finite number"),
        # More than a float holds, and more digits than Python prints.
        (10**400, {}, "wind is inf, but must be a finite number"),
        pytest.param(-(10**5000), {}, "wind is -inf, but must be a finite number", id="-1e5000"),
        (
            np.eye(2),
            {},
            "wind is array([[1., 0.], [0., 1.]]), but must be a finite number",
        ),
        ("x" * 100, {}, f"wind is '{'x' * 76}..., but must be a finite number"),
    ],
)
def test_the_sentence(value, bounds, sentence):
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        require("wind", value, **bounds)


@pytest.mark.parametrize("value", [3, 3.0, np.float32(3), np.int8(3), Fraction(3), Decimal(3)])
def test_numbers_of_any_kind(value):
    require("wind", value, whole=True, minimum=3, maximum=3)
    array = require_all("wind", value, whole=True, minimum=3, maximum=3)
    assert array.shape == () and array.dtype == np.float64 and array == 3


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (np.arange(2, 200) / 2, "wind is 1.5, but must be a whole number at least 1"),
        ([4, math.nan, 0], "wind is nan, but"),
        (np.array([[1, 2], [3, 0]]), "wind is 0, but"),
        ([1, 10**400], "wind is inf, but"),
        ([1, "2"], "wind is '1', but"),  # numpy makes text of both
        ([[1, 2], 3], "wind is [[1, 2], 3], but must be an array of numbers"),
        (np.full(3, np.datetime64("1999-07-01")), "wind is datetime.date(1999, 7, 1), but"),
        (None, "wind is None, but"),
    ],
)
def test_the_first_wrong_element_is_named(values, sentence):
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}"):
        require_all("wind", values, whole=True, minimum=1)


def test_bounds_beyond_single_precision_hold_for_its_arrays():
    values = np.array([0.0, 3e38], dtype=np.float32)
    found = require_all("profile", values, minimum=-1e300, maximum=1e300)
    np.testing.assert_array_equal(found, values.astype(np.float64))


def test_arrays_come_back_as_they_are():
    values = np.array([[1, 2, 3], [4, 5, 6]])
    ours = require_all("wind", values, minimum=1)
    assert ours.dtype == np.float64
    np.testing.assert_array_equal(ours, values)
    assert require_all("wind", np.zeros((0, 3)), minimum=1).shape == (0, 3)


@pytest.mark.parametrize("values", [(0.0, 0.5), [0, 0.5], np.array([0.0, 0.5])])
def test_pairs_of_any_kind(values):
    require_each("wind", values, 2, minimum=0, below=1)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (0.5, "wind is 0.5, but must be 2 numbers"),
        (None, "wind is None, but must be 2 numbers"),
        (np.array(0.5), "wind is array(0.5), but must be 2 numbers"),
        ({0.1, 0.2}, "wind is {0.1, 0.2}, but must be 2 numbers"),
        ((0.1, 0.2, 0.3), "wind is (0.1, 0.2, 0.3), but must be 2 numbers"),
        ((0.1, 1), "wind[1] is 1, but must be a finite number at least 0 and below 1"),
        (((0.1, 0.2), 0.3), "wind[0] is (0.1, 0.2), but must be"),
        ("01", "wind[0] is '0', but must be"),
    ],
)
def test_so_many_numbers(values, sentence):
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}"):
        require_each("wind", values, 2, minimum=0, below=1)


@pytest.mark.parametrize("value", [None, 3, np.random.RandomState(3), np.random])
def test_a_generator(value):
    require_generator("rng", np.random.default_rng(3))
    with pytest.raises(ValueError, match=r"^rng is .*, but must be a numpy\.random\.Generator$"):
        require_generator("rng", value)


@settings(max_examples=300)
@given(
    arrays(
        float,
        array_shapes(min_dims=0, max_dims=2, min_side=0, max_side=4),
        elements=st.one_of(
            st.sampled_from([0.0, -0.0, 1.0, 2.5, np.nan, np.inf, -np.inf]), st.floats()
        ),
    ),
    st.fixed_dictionaries(
        {},
        optional={
            "positive": st.booleans(),
            "whole": st.booleans(),
            "minimum": st.sampled_from([-1.0, 0.0, 1.0]),
            "maximum": st.sampled_from([1.0, 2.5]),
            "below": st.sampled_from([1.0, 2.5]),
        },
    ),
)
def test_a_look_at_the_whole_is_a_look_at_every_element(values, bounds):
    try:
        for value in values.ravel().tolist():
            require("x", value, **bounds)
    except ValueError as error:
        with pytest.raises(ValueError, match="^" + re.escape(str(error)) + "$"):
            require_all("x", values, **bounds)
    else:
        np.testing.assert_array_equal(require_all("x", values, **bounds), values)
