"""Checks of single values of a sheet: each returns the value, ready for use, or refuses it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from manifold3d import CrossSection
from numpy.typing import NDArray

Check = Callable[[Any], Any]


class RefusedValueError(Exception):
    """Error of a value that is not allowed; its message names the allowed values."""


def number(value: Any, low: float = -1000.0, high: float = 1000.0) -> float:
    """Return a finite number within bounds."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not low <= value <= high:
        raise RefusedValueError(f"a number between {low:g} and {high:g}")
    return float(value)


size = partial(number, low=0.001, high=500.0)  # [m]
spacing = partial(number, low=0.2, high=100.0)  # [m]
spread = partial(number, low=0.0, high=20.0)  # [m]
angle = partial(number, low=-360.0, high=360.0)  # [deg]
slope = partial(number, low=-80.0, high=80.0)  # [deg]


def count(value: Any, low: int = 1, high: int = 100) -> int:
    """Return a whole number within bounds."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise RefusedValueError(f"a whole number between {low} and {high}")
    return value


def flag(value: Any) -> bool:
    """Return true or false."""
    if not isinstance(value, bool):
        raise RefusedValueError("true or false")
    return value


def text(value: Any) -> str:
    """Return a text that is not empty."""
    if not isinstance(value, str) or not value:
        raise RefusedValueError("a text")
    return value


def one_of(*names: str) -> Check:
    """Return the check of a value that is one of a few words."""

    def check(value: Any) -> Any:
        if value not in names:
            raise RefusedValueError(" or ".join(names))
        return value

    return check


def pair(value: Any) -> tuple[float, float]:
    """Return two numbers."""
    if not isinstance(value, list) or len(value) != 2:
        raise RefusedValueError("a list of two numbers")
    return number(value[0]), number(value[1])


def span(value: Any) -> tuple[float, float]:
    """Return two numbers, the greater last."""
    first, last = pair(value)
    if first >= last:
        raise RefusedValueError("a list of two increasing numbers")
    return first, last


def points(value: Any, *, columns: int, rows: int) -> NDArray[np.float64]:
    """Return the points of a list of at least `rows`, as an array."""
    is_table = isinstance(value, list) and len(value) >= rows
    if not is_table or any(not isinstance(row, list) or len(row) != columns for row in value):
        raise RefusedValueError(f"a list of at least {rows} lists of {columns} numbers")
    return np.array([[number(coordinate) for coordinate in row] for row in value])


def path(value: Any) -> NDArray[np.float64]:
    """Return the nodes of a path without coincident neighbours or reversals."""
    nodes = points(value, columns=3, rows=2)
    step = np.diff(nodes, axis=0)
    length = np.linalg.norm(step, axis=1, keepdims=True)
    if length.min() < 0.01 or (np.sum((step / length)[1:] * (step / length)[:-1], 1) < -0.9).any():
        raise RefusedValueError("a path that neither rests nor turns back")
    return nodes


def polygon(value: Any) -> NDArray[np.float64]:
    """Return the corners of a polygon, turning from the first axis to the second."""
    corners = points(value, columns=2, rows=3)
    following = np.roll(corners, -1, axis=0)
    area = float(np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]) / 2)
    corners = corners if area > 0 else corners[::-1]
    repeats = len(np.unique(corners, axis=0)) < len(corners)
    covered = CrossSection([corners]).area()  # not the sum above where the outline crosses itself
    if repeats or abs(area) < 1e-3 or not math.isclose(covered, abs(area), rel_tol=1e-6):
        raise RefusedValueError("a polygon that encloses an area and does not cross itself")
    return corners
