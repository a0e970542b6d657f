"""Values that stages return are checked against their declarations; errors name the stage."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from small_stores import opened
from toys import CALLS, Few, of, run_few

from sweeps.engine.declare.errors import DeclarationError
from sweeps.engine.declare.stage import SHARE, Group, Output, stage
from sweeps.engine.run.tasks import check_result


def returned(dtype, value, dims=0, along=()):
    """Return the array made of a value that a stage returned."""
    output = Output("x", tuple(map(str, range(dims))), dtype)
    return check_result("one", [output], value, along)["x"]


LOST = [
    ("i4", 1.5, "1.5"),
    ("i4", [1, 2, 2.25], "2.25"),
    ("i1", 300, "300"),
    ("i8", np.uint64(2**63), str(2**63)),
    ("i8", 2**70, "values of dtype object"),
    ("f4", 1e300, "1e+300"),
    ("f2", 70000, "70000"),
    ("f8", 1 + 2j, "values of dtype complex128"),
    ("f8", None, "None"),
    ("f8", "1", "values of dtype <U1"),
    ("U3", "abcd", "'abcd'"),
    ("U3", 3, "values of dtype int64"),
    ("i4", np.ma.array([1, 2], mask=[False, True]), "masked values"),
    ("U3", np.ma.array(["a", "b"], mask=[True, False]), "masked values"),
    ("f4", np.ma.array([1e300, 1.0], mask=[False, True]), "1e+300"),
]


@pytest.mark.parametrize(("dtype", "value", "named"), LOST, ids=str)
def test_values_the_dtype_cannot_represent_are_refused(dtype, value, named):
    with pytest.raises(TypeError) as refused:
        returned(dtype, value, np.ndim(np.array(value, dtype=object)))
    sentence = str(refused.value)
    assert sentence.endswith("; a return may be missing") == (value is None)
    assert sentence.removesuffix("; a return may be missing") == (
        f"one returned {named} as x, but must return values that the dtype {dtype} holds"
    )


KEPT = [
    ("f4", 1.1, np.float32(1.1)),  # floats may lose digits
    ("f4", np.inf, np.inf),
    ("f4", np.nan, np.nan),
    ("i4", 2.0, 2),
    ("?", 1, True),
    ("u8", 2**64 - 1, np.uint64(2**64 - 1)),
    ("U3", [], []),
    ("U8", np.array(["a", "Å"], dtype=object), ["a", "Å"]),
    ("f8", [np.ma.masked, 2.0], [np.nan, 2.0]),
    ("f8", [np.ma.array([1, 2], mask=[0, 1]), np.ma.array([3, 4])], [[1, np.nan], [3, 4]]),
    ("i4", np.ma.array([1, 2]), [1, 2]),
]


@pytest.mark.parametrize(("dtype", "value", "expected"), KEPT, ids=str)
def test_values_the_dtype_can_represent_are_kept(dtype, value, expected):
    array = returned(dtype, value, np.ndim(expected))
    assert array.dtype == dtype
    np.testing.assert_array_equal(array, np.array(expected, dtype=dtype))


@settings(max_examples=100, deadline=None)
@given(
    values=arrays("f8", st.integers(0, 6), elements=st.floats(-1e6, 1e6)),
    dtype=st.sampled_from(["f4", "f8"]),
    data=st.data(),
)
def test_masked_values_are_nan_and_all_others_are_kept(values, dtype, data):
    mask = data.draw(arrays("?", values.shape))
    array = returned(dtype, np.ma.array(values, mask=mask), dims=1)
    np.testing.assert_array_equal(array, np.where(mask, np.nan, values).astype(dtype))


@stage(
    Output("share", ("place",), label="share", dtype="u1", role=SHARE),
    Output("fine", label="fine share", dtype="u2", role=SHARE),
    uses=(Few,),
    group=Group("all"),
)
def shares(size):
    """Return shares 0, 1 and size/255, and a fine one of (size mod 3)/3; fail for size 2."""
    if size == 2:
        raise ValueError("no two")
    return {"share": np.uint8([0, 255, size]), "fine": 65535 // 3 * (size % 3)}


@pytest.mark.parametrize("partial", [False, True])
def test_shares_of_cells_that_failed_or_are_missing_are_nan(partial, tmp_path):
    place = {"cache": tmp_path / "cache", "store": tmp_path / "s.zarr"}
    sizes = (1, 3) if partial else (1, 2, 3)
    run_few([shares], sizes=sizes, **place)
    if partial:
        place["store"] = tmp_path / "t.zarr"
        run_few([shares], sizes=(1, 2, 3, 4), partial=True, **place)
    results = opened(place["store"], "all")
    there = [1, np.nan, 3, np.nan][: results.sizes["size"]]
    np.testing.assert_array_equal(results.share[:, 0], [0 * size for size in there])
    np.testing.assert_array_equal(results.share[:, 1], [size / size for size in there])
    np.testing.assert_allclose(results.share[:, 2] * 255, there, rtol=1e-15)
    np.testing.assert_allclose(results.fine * 3, [size % 3 for size in there], rtol=1e-15)
    assert results.share.mean() == pytest.approx(np.nanmean([0, 1, 1 / 255, 0, 1, 3 / 255]))


def test_share_dtype_without_room_for_nan_is_refused():
    wide = replace(shares, outputs=(replace(shares.outputs[1], dtype="u8"),))
    with pytest.raises(DeclarationError, match=r"fine has the dtype 'u8', but .* u1, u2, u4"):
        of(wide)


@stage(Output("x", ("place",), label="x"), uses=(Few,), group=Group("all"))
def growing(size):
    """Return an array that is longer for larger sizes."""
    CALLS["growing"] += 1
    return np.zeros(size)


def test_undeclared_padding_is_refused_early_without_losing_results(tmp_path):
    CALLS.clear()
    with pytest.raises(DeclarationError) as refused:
        run_few([growing], tmp_path / "s.zarr", tmp_path / "cache", range(1, 1001))
    assert str(refused.value) == (
        "stage growing: x has the shape (2,) in one cell and (1,) in another, but no value to pad "
        "it with; declare pad=..., or an output first_{dimension}"
    )
    assert CALLS["growing"] < 700, "most cells are not computed any more"
    assert not (tmp_path / "s.zarr").exists()
    padded = replace(growing, outputs=(replace(growing.outputs[0], pad=-1.0),))
    CALLS.clear()
    run_few([padded], tmp_path / "s.zarr", tmp_path / "cache")
    assert CALLS["growing"] < 3, "what was computed before is kept"
    assert opened(tmp_path / "s.zarr", "all").x.sum() == -3
