"""What a stage returns, checked against the outputs that it declares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.errors import DeclarationError
from sweeps.engine.stage import Output

Arrays = dict[str, NDArray[Any]]

# Kinds of dtypes (see numpy) that may become another, if every value is the same in it.
CAST = {"f": "biuf", "i": "biuf", "u": "biuf", "b": "biuf", "c": "biufc"}

_dtype = cache(np.dtype)


@cache
def _largest(dtype: str) -> float:
    return float(np.finfo(dtype).max)


def arrays_of(stage: str, outputs: Sequence[Output], found: Any, along: tuple[int, ...]) -> Arrays:
    """Return the arrays of a result by output, of the declared dtypes.

    `along` are the lengths of the leading axes, along which values are computed together.

    Raises
    ------
    TypeError
        If an output is missing, has another shape, or would lose something in its dtype. One
        sentence with stage, output, what was returned, and what is allowed.
    """
    names = [output.name for output in outputs]
    if not isinstance(found, Mapping) and len(names) == 1:
        found = {names[0]: found}
    given = list(found) if isinstance(found, Mapping) else [type(found).__name__]
    if set(given) != set(names):
        raise TypeError(
            f"{stage} returned {', '.join(map(str, given))}, but must return {', '.join(names)}"
        )
    return {one.name: _array(stage, one, found[one.name], along) for one in outputs}


def _array(stage: str, output: Output, given: Any, along: tuple[int, ...]) -> NDArray[Any]:
    """Return one output as an array."""
    dtype = _dtype(output.dtype)
    if isinstance(given, float) and dtype.kind == "f" and abs(given) <= _largest(output.dtype):
        array = np.array(given, dtype)  # what follows takes 10 us, which counts for single numbers
    elif given is None:
        raise _refused(stage, output, "None")
    else:
        try:
            array = np.asarray(given)
        except ValueError:
            raise _refused(stage, output, "rows of different lengths", "an array") from None
        if array.dtype != dtype:
            array = _cast(stage, output, array, dtype)
    if array.shape[: len(along)] != along or array.ndim != len(along) + len(output.dims):
        leading = f"{along}, the numbers of values computed together, and " if along else ""
        allowed = f"one of {leading}{len(output.dims)} dimensions of its own"
        raise _refused(stage, output, f"an array of shape {array.shape}", allowed)
    return array


def _cast(stage: str, output: Output, array: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return an array in another dtype; digits of floats may go, and nothing else."""
    texts = dtype.kind in "SU" and all(isinstance(one, str | bytes) for one in array.flat)
    if not texts and array.dtype.kind not in CAST.get(dtype.kind, dtype.kind) and array.size:
        odd = next((one for one in array.flat if one is None), f"values of dtype {array.dtype}")
        raise _refused(stage, output, str(odd))
    with np.errstate(all="ignore"):
        cast = array.astype(dtype)
        if dtype.kind in "fc":
            lost = np.isinf(cast) & np.isfinite(array)
        else:
            lost = cast.astype(array.dtype) != array
    if dtype.kind in "iu" and array.dtype.kind in "iu":
        lost |= (cast < 0) != (array < 0)  # they may wrap there and back
    if lost.any():
        raise _refused(stage, output, repr(array[lost].flat[0].item()))
    return cast


def _refused(stage: str, output: Output, given: str, allowed: str = "") -> TypeError:
    allowed = allowed or f"values that the dtype {output.dtype} holds"
    return TypeError(f"{stage} returned {given} as {output.name}, but must return {allowed}")


def uneven(stage: str, output: str, one: tuple[int, ...], other: tuple[int, ...]) -> Exception:
    """Return the error of an output whose arrays differ in shape between cells."""
    return DeclarationError(
        f"stage {stage}: {output} has the shape {one} in one cell and {other} in another, but no "
        "value to pad it with; declare pad=... or origin=..."
    )
