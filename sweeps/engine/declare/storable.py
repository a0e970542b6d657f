"""Dtypes and attributes that every reader of zarr or NetCDF opens."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

DATES = np.dtype("M8[ns]")  # the only times that every version of xarray reads back
NAT = np.iinfo(np.int64).min


def is_storable(dtype: np.dtype[Any]) -> bool:
    """Return whether a store can hold numbers, texts or times of a dtype."""
    is_basic = not (dtype.hasobject or dtype.names or dtype.subdtype)
    is_number = dtype.kind in "biufc" and dtype.itemsize <= (16 if dtype.kind == "c" else 8)
    return is_basic and (dtype.kind == "U" or is_number or dtype == DATES)


def encode_attrs(attributes: Mapping[str, Any]) -> dict[str, str | int | float | list[int | float]]:
    """Return attributes as texts, numbers and lists of numbers; others as JSON text.

    NetCDF files have no mappings, truth values, nulls, lists of texts or empty lists. Raises
    TypeError if JSON cannot hold a value.
    """
    write = partial(json.dumps, ensure_ascii=False, default=_from_numpy)
    texts = {name: write(value) for name, value in attributes.items()}
    values = {name: json.loads(text) for name, text in texts.items()}
    return {name: value if _is_native(value) else texts[name] for name, value in values.items()}


def decode_attrs(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes with mappings and lists decoded from JSON."""
    decoded = dict(attributes)
    for name, value in decoded.items():
        if isinstance(value, str) and value.startswith(("{", "[")):
            with suppress(ValueError):  # a text that only begins like one
                decoded[name] = json.loads(value)
    return decoded


def _is_native(value: Any) -> bool:
    numbers = value if isinstance(value, list) and value else [value]
    return isinstance(value, str) or all(
        type(number) is float or (type(number) is int and -(2**63) <= number < 2**63)
        for number in numbers
    )


def _from_numpy(value: Any) -> Any:
    """Return a value of numpy as a value that JSON knows."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be an attribute")
