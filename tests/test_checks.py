"""Checks of arguments refuse wrong values in sentences with value, bounds and unit."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from ncti.checks import require, require_all

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
    """The expectation tests each bound by itself."""
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
        (1.5, {"whole": True, "minimum": 1}, "wind is 1.5, but must be a whole number at least 1"),
        (1.0, {"below": 1}, "wind is 1.0, but must be a finite number below 1"),
        ("3", {}, "wind is '3', but must be a finite number"),
        (None, {}, "wind is None, but must be a finite number"),
        (np.eye(2), {}, "wind is array([[1., 0.], [0., 1.]]), but must be a finite number"),
        ("x" * 100, {}, f"wind is '{'x' * 76}..., but must be a finite number"),
    ],
)
def test_error_message_states_value_and_bounds(value, bounds, sentence):
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        require("wind", value, **bounds)


@pytest.mark.parametrize(
    ("name", "value", "bounds", "sentence"),
    [
        (
            *("pulse_width", 30, {"minimum": 9.4e-9, "maximum": 1e-6}),
            "pulse_width is 30 s, but must be a number from 9.4e-09 to 1e-06 s",
        ),
        ("ifov", -1, {"positive": True}, "ifov is -1 rad, but must be a finite number above 0 rad"),
        ("slant_range", math.nan, {}, "slant_range is nan, but must be a finite number in m"),
        (
            *("aspect", "bow", {"minimum": -360, "maximum": 360}),
            "aspect is 'bow', but must be a number from -360 to 360 deg",
        ),
    ],
)
def test_error_message_states_the_unit(name, value, bounds, sentence):
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        require(name, value, **bounds)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (np.arange(2, 200) / 2, "wind is 1.5, but must be a whole number at least 1"),
        ([4, math.nan, 0], "wind is nan, but"),
        (np.array([[1, 2], [3, 0]]), "wind is 0, but"),
        ([1, "2"], "wind is '1', but"),  # numpy makes text of both
        ([[1, 2], 3], "wind is [[1, 2], 3], but must be an array of numbers"),
        (np.full(3, np.datetime64("1999-07-01")), "wind is datetime.date(1999, 7, 1), but"),
        (None, "wind is None, but"),
    ],
)
def test_the_first_wrong_element_is_named(values, sentence):
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}"):
        require_all("wind", values, whole=True, minimum=1)


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
def test_require_all_agrees_with_require_on_every_element(values, bounds):
    try:
        for value in values.ravel().tolist():
            require("x", value, **bounds)
    except ValueError as error:
        with pytest.raises(ValueError, match="^" + re.escape(str(error)) + "$"):
            require_all("x", values, **bounds)
    else:
        np.testing.assert_array_equal(require_all("x", values, **bounds), values)
