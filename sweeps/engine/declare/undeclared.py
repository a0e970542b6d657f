"""Outputs of a function that declares none, inferred from its results.

Dimensions and attributes of a result are stored as JSON in the name of an empty array, once in a
pack for all cells of equal layout.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.declare.errors import DeclarationError
from sweeps.engine.declare.kinds import Date
from sweeps.engine.declare.stage import COORDINATE, RESULT, Output
from sweeps.engine.declare.storable import DATES, encode_attrs

META = "/"  # before the JSON, since no variable's name has it
# Attributes of the encoding of values, which the store sets itself.
ENCODING = {"_FillValue", "missing_value", "scale_factor", "add_offset", "dtype", "coordinates"}
FLOAT, COMPLEX = "f8", "c16"
PADDING = "padding"  # attribute with the dimensions along which arrays were padded

Layout = Sequence[tuple[str, Any, tuple[int, ...]]]
"""Names, dtypes and shapes of the arrays of a cell."""


@dataclass(frozen=True)
class UndeclaredOutput(Output):
    """Undeclared results of a function; a single variable has this name."""

    pad: complex | str | None = np.nan
    infer_dtype: bool = True  # each variable keeps its dtype; numbers become f8 or c16
    names: tuple[str, ...] = ()  # of the elements of a tuple
    # Dimensions of variables, if they differ from `dims`.
    dims_of: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    reserved: tuple[str, ...] = ()  # names of arguments and of their dimensions
    # Attributes by variable.
    extra_attributes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @cached_property
    def variables(self) -> dict[Any, Output]:
        """Outputs of the variables so far, by their names, dimensions and dtypes."""
        return {}

    @cached_property
    def is_number(self) -> bool:
        """Whether a number is the only variable, without dimensions."""
        return self.infer_dtype and not self.names and not self.dims_of

    @property
    def identity(self) -> tuple[Any, ...]:
        """See `Output.identity`."""
        options = (self.infer_dtype, self.names, self.dims, sorted(self.dims_of.items()))
        return *super().identity, *options


class Variable(NamedTuple):
    """A variable that a call returned; `dims` is None if the result does not name them."""

    values: Any
    dims: tuple[str, ...] | None = None
    attrs: Mapping[str, Any] = {}
    coordinate: bool = False


def split_variables(output: UndeclaredOutput, result: Any) -> tuple[list[tuple[Output, Any]], str]:
    """Return the variables of a result with their values, and the JSON of their attributes.

    Raises TypeError, in a sentence, for impossible names.
    """
    declared: list[tuple[Output, Any]] = []
    metadata: dict[str, Any] = {}
    single_name = output.names[0] if len(output.names) == 1 else output.name
    for name, returned in _iter_variables(single_name, output.names, result, output.name):
        values = _to_array(f"{output.name} returned the variable {name!r}", returned.values)
        if returned.coordinate and not values.ndim and name in output.reserved:
            continue  # an argument that the function returned
        if any(name == earlier.name for earlier, _ in declared):
            raise TypeError(f"{output.name} returned the variable {name!r} twice; rename one")
        key = (name, returned.dims, returned.coordinate, values.dtype, values.ndim)
        if (variable := output.variables.get(key)) is None:
            variable = output.variables[key] = _make_output(output, *key)
        # Convert only times and texts; keep other values as returned, since they may be masked.
        declared.append((variable, values if values.dtype.kind in "MU" else returned.values))
        if variable.dims or returned.attrs or returned.coordinate:
            stored_attrs = {
                key: value for key, value in returned.attrs.items() if key not in ENCODING
            }
            attrs = encode_attrs(stored_attrs)
            metadata[name] = [variable.dims, attrs, returned.coordinate]
    return declared, f"{META}{json.dumps(metadata)}" if metadata else ""


def _make_output(
    output: UndeclaredOutput,
    name: Any,
    dims: tuple[str, ...] | None,
    coordinate: bool,
    dtype: np.dtype[Any],
    ndim: int,
) -> Output:
    """Return the output of a variable."""
    subject = f"{output.name} returned the variable {name!r}"
    if not isinstance(name, str) or not name or "/" in name or name.startswith((".", "__")):
        allowed = "must be a text without '/' that does not begin with '.' or '__'"
        raise TypeError(f"{subject}, but a name {allowed}")
    if dims is None:
        dims = output.dims_of.get(name) or (output.dims if ndim else ())
        dims = dims or tuple(f"{name}_{k}" for k in range(ndim))
    if clashing := {name, *dims}.intersection(output.reserved):
        raise TypeError(f"{subject}, but {min(clashing)!r} is the name of an argument")
    if name in dims and not coordinate:
        raise TypeError(f"{subject} along a dimension of that name; rename one of them")
    stored = output.dtype
    if (output.infer_dtype or coordinate) and dtype.kind == "c":
        stored = COMPLEX
    elif (dtype.kind in "MU" and output.infer_dtype) or coordinate:
        stored = dtype.str
    return Output(name, dims, stored)


def _iter_variables(
    name: Any, names: Sequence[str], result: Any, function_name: str
) -> Iterator[tuple[Any, Variable]]:
    """Yield the variables of a result by name; `names` name the elements of a tuple."""
    if hasattr(result, "to_xarray"):  # a frame or series of pandas
        result = result.to_xarray()
    if hasattr(result, "coords") and not hasattr(result, "data_vars"):  # a data array
        result = result.to_dataset(name=name)
    if hasattr(result, "data_vars"):
        for key, values in result.variables.items():
            yield key, Variable(values.values, values.dims, values.attrs, key in result.coords)
    elif isinstance(result, Mapping):
        for key, values in result.items():
            yield from _iter_variables(key, (), values, function_name)
    elif len(names) > 1:
        several = isinstance(result, tuple | list)
        if not several or len(result) != len(names):
            returned = f"{len(result)} values" if several else repr(result)
            raise TypeError(
                f"{function_name} returned {returned}, but must return {', '.join(names)}"
            )
        for key, values in zip(names, result, strict=True):
            yield from _iter_variables(key, (), values, function_name)
    else:
        yield name, Variable(result)


def _to_array(subject: str, values: Any) -> NDArray[Any]:
    """Return values as an array: times as `DATES`, texts of any type as texts of numpy."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise TypeError(f"{subject}, whose rows have different lengths") from None
    objects = array.ravel().tolist() if array.dtype.kind == "O" else []
    dates = objects if objects and all(isinstance(value, datetime) for value in objects) else []
    if array.dtype.kind == "M":
        dates = list(array[~np.isnat(array)].ravel())
    if array.dtype.kind == "M" or dates:
        kind = Date("" if objects else np.datetime_data(array.dtype)[0])
        if invalid := [value for value in dates if not kind.holds(value)]:
            raise TypeError(f"{subject} with {invalid[0]!r}, but it must be {kind.allowed}")
        return array.astype(DATES)
    if array.dtype.kind in "TU" or (objects and all(isinstance(value, str) for value in objects)):
        texts = array.astype(str)
        return texts.astype(f"U{max(texts.itemsize // 4, 1)}")
    return array


def infer_outputs(output: UndeclaredOutput, layouts: Sequence[Layout]) -> list[Output]:
    """Infer outputs from the layouts of results, with the attributes of the first result.

    Raises DeclarationError if results of a variable do not fit together.
    """
    declarations: dict[str, tuple[tuple[str, ...], Any, bool]] = {}
    shapes: dict[str, list[tuple[np.dtype[Any], tuple[int, ...]]]] = defaultdict(list)
    lengths: dict[str, set[int]] = defaultdict(set)
    for layout in layouts:
        texts = (name[len(META) :] for name, *_ in layout if name.startswith(META))
        metadata = {name: entry for text in texts for name, entry in json.loads(text).items()}
        for name, dtype, shape in layout:
            if name.startswith(META):
                continue
            dims, attrs, coordinate = metadata.get(name, ((), {}, False))
            earlier = declarations.setdefault(name, (tuple(dims), attrs, coordinate))
            shapes[name].append((np.dtype(dtype), shape))
            if earlier[0] != tuple(dims) or _dtype_kind(shapes[name][0][0]) != _dtype_kind(
                shapes[name][-1][0]
            ):
                conflicting = (shapes[name][0], shapes[name][-1])
                forms = [
                    f"{_dtype_kind(dtype)} of shape {shape}" if shape else _dtype_kind(dtype)
                    for dtype, shape in conflicting
                ]
                raise DeclarationError(
                    f"{output.name} returned {name} as {' and as '.join(forms)} for different "
                    "arguments, which do not fit one variable"
                )
            for dim, size in zip(dims, shape, strict=True):
                lengths[dim].add(size)
    outputs: list[Output] = []
    for name, (dims, returned_attrs, coordinate) in declarations.items():
        attrs = {**returned_attrs, **output.extra_attributes.get(name, {})}
        dtype = np.result_type(*(dtype for dtype, _ in shapes[name]))
        uneven = [dim for dim in dims if len(lengths[dim]) > 1]
        spans = [f"{dim} ({min(lengths[dim])} to {max(lengths[dim])} values)" for dim in uneven]
        label, unit = str(attrs.pop("long_name", name)), str(attrs.pop("units", "1"))
        role = COORDINATE if coordinate else RESULT
        variable = Output(name, dims, dtype.str, label, unit, role=role, attrs=attrs)
        if uneven or len(shapes[name]) < len(layouts):
            variable = replace(variable, pad=variable.fill_value)
        if uneven and not coordinate:
            nothing = (
                "NaN" if variable.fill_value != variable.fill_value else repr(variable.fill_value)
            )
            attrs[PADDING] = f"with {nothing} along {', '.join(spans)}"
        outputs.append(variable)
    for name in () if outputs else output.names or (output.name,):
        declared_attrs = output.extra_attributes.get(name, {})
        label, unit = declared_attrs.get("long_name", name), declared_attrs.get("units", "1")
        outputs.append(Output(name, (), FLOAT, label, unit))
    return outputs


def _dtype_kind(dtype: np.dtype[Any]) -> str:
    return {"U": "texts", "M": "times"}.get(dtype.kind, "numbers")


def longest_arrays(
    cells: Iterable[Mapping[str, NDArray[Any]]], names: Iterable[str]
) -> dict[str, Any]:
    """Return, by name, the longest array among cells; None if any other is not a prefix of it."""
    longest: dict[str, Any] = {}
    for arrays in cells:
        for name in arrays.keys() & set(names):
            array = arrays[name]
            previous = longest.setdefault(name, array)
            if previous is None:
                continue
            short, long = sorted((array, previous), key=lambda array: array.size)
            beginning = long[tuple(map(slice, short.shape))]
            agrees = np.array_equal(beginning, short, equal_nan=short.dtype.kind in "fc")
            longest[name] = long if agrees else None
    return longest
