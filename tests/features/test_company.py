"""Segmenting or mapping a stack equals processing each image alone, bit for bit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from ncti.features import log_polar, segment
from ncti.features.log_polar import INTERPOLATIONS
from ncti.features.segmentation import METHODS as SEGMENTATION_METHODS

layouts = st.sampled_from([np.ascontiguousarray, np.asfortranarray])
shapes = array_shapes(min_dims=3, max_dims=3, max_side=12)
seeds = st.integers(0, 2**32 - 1)


@st.composite
def views(draw):
    """Draw ships of any warmth in noise of any strength, with empty and huge images among them."""
    count, rows, columns = draw(
        st.tuples(st.integers(2, 6), st.integers(1, 24), st.integers(1, 24))
    )
    rng = np.random.default_rng(draw(seeds))
    stack = rng.standard_normal((count, rows, columns))
    stack *= rng.choice([0.0, 0.05, 0.5, 3.0, 1e6, 1e300], size=(count, 1, 1))
    warmth = rng.choice([0.0, 0.3, 1.0, 5.0], size=(count, 1, 1))
    stack[:, rows // 3 : rows // 2 + 1, columns // 4 : 3 * columns // 4 + 1] += warmth
    sigmas = rng.choice([0.05, 0.2, 1.0], size=(2, count))
    contrast = rng.choice([0.0, 0.3, 1.0, 5.0], size=count)
    return stack, {"contrast": contrast, "target_sigma": sigmas[0], "sea_sigma": sigmas[1]}


@settings(max_examples=40, deadline=None)
@given(view=views(), layout=layouts)
@pytest.mark.parametrize("method", SEGMENTATION_METHODS)
def test_segmenting_a_stack_equals_single_images(method, view, layout):
    stack, known = view
    together = segment(layout(stack), method=method, **known)
    for place, image in enumerate(stack):
        parameters = {name: values[place] for name, values in known.items()}
        single = segment(image.copy(), method=method, **parameters)
        np.testing.assert_array_equal(together[place], single)


cells = st.fixed_dictionaries(
    {
        "radii": st.integers(1, 6),
        "angles": st.integers(1, 9),
        "oversample": st.integers(1, 5),
        "inner_radius": st.sampled_from([0.1, 0.5]),
    }
)
# Shares of a third and a seventh, whose sums round.
shares = arrays(float, shapes, elements=st.sampled_from([0.0, 0.0, 1 / 3, 1 / 7, 0.9, 1.0]))


@settings(max_examples=40, deadline=None)
@given(stack=arrays(bool, shapes) | shares, layout=layouts, parameters=cells)
@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_mapping_a_stack_equals_single_masks(interpolation, stack, layout, parameters):
    together = log_polar(layout(stack), interpolation=interpolation, **parameters)
    for place, mask in enumerate(stack):
        single = log_polar(mask.copy(), interpolation=interpolation, **parameters)
        np.testing.assert_array_equal(together[place], single)
