"""Attributes of a store: plain ones, which every file format has; others as JSON text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np


def plain(attributes: Mapping[str, Any]) -> dict[str, str | int | float | list[int | float]]:
    """Return attributes as texts, numbers and lists of numbers; all others as JSON text.

    NetCDF files have no mappings, truth values, nulls, lists of texts or empty lists. Raises
    TypeError if JSON has no text of a value.
    """
    given = {name: _unboxed(value) for name, value in attributes.items()}
    return {
        name: value
        if _is_plain(value)
        else json.dumps(value, ensure_ascii=False, default=_for_json)
        for name, value in given.items()
    }


def nested(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain attributes with mappings and lists read from their JSON text."""
    return {name: _read(value) for name, value in attributes.items()}


def _read(value: Any) -> Any:
    if not isinstance(value, str) or not value.startswith(("{", "[")):
        return value
    try:
        return json.loads(value)
    except ValueError:  # a text that only begins like one
        return value


def _is_plain(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(_is_number(one) for one in value)
    return isinstance(value, str) or _is_number(value)


def _is_number(value: Any) -> bool:
    if isinstance(value, int) and not isinstance(value, bool):
        return -(2**63) <= value < 2**63
    return isinstance(value, float)


def _unboxed(value: Any) -> Any:
    """Return a value of numpy, or a tuple, as one of Python."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def _for_json(value: Any) -> Any:
    """Return a value inside another that JSON does not know as one that it does."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be an attribute")
