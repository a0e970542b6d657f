"""Refusing an argument that cannot be meant, in one sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def require(
    name: str,
    value: float,
    *,
    positive: bool = False,
    whole: bool = False,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    below: float = math.inf,
) -> None:
    """Raise unless `value` is a finite number in its range.

    Parameters
    ----------
    name : str
        The parameter as its caller wrote it.
    value : float
        What the caller gave; text is no number, whatever it spells.
    positive : bool
        Whether zero is refused along with everything below it.
    whole : bool
        Whether fractions are refused.
    minimum, maximum : float
        Inclusive bounds.
    below : float
        Exclusive upper bound.

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    try:
        number = math.nan if isinstance(value, (str, bytes)) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    except OverflowError:
        # A whole number that no float holds: its digits would fill pages.
        number = value = math.inf if value > 0 else -math.inf
    if (
        minimum <= number <= maximum
        and -math.inf < number < below
        and not (positive and number <= 0)
        and not (whole and number % 1)
    ):
        return
    bounds = []
    if positive:
        bounds.append("above 0")
    if minimum > -math.inf:
        bounds.append(f"at least {minimum:g}")
    if maximum < math.inf:
        bounds.append(f"at most {maximum:g}")
    if below < math.inf:
        bounds.append(f"below {below:g}")
    allowed = ("a whole number" if whole else "a finite number") + (
        " " + " and ".join(bounds) if bounds else ""
    )
    raise ValueError(f"{name} is {_line(value)}, but must be {allowed}")


def require_all(name: str, values: Any, **bounds: Any) -> NDArray[np.float64]:
    """Numbers as an array, refused for the first that `require` refuses.

    Parameters
    ----------
    name : str
        The parameter as its caller wrote it.
    values : (...) array_like
        What the caller gave: one number or an array of them, perhaps empty.
    **bounds
        As for `require`.

    Returns
    -------
    (...) float64 ndarray
        The numbers.

    Raises
    ------
    ValueError
        Naming the parameter, the first wrong element and what is allowed.
    """
    try:
        array = np.asarray(values)
    except ValueError:
        raise ValueError(f"{name} is {_line(values)}, but must be an array of numbers") from None
    if array.dtype.kind not in "iuf" or not _all_inside(array, **bounds):
        for value in array.ravel().tolist():
            require(name, value, **bounds)
    return np.asarray(array, dtype=np.float64)


def _all_inside(
    array: NDArray[Any],
    *,
    positive: bool = False,
    whole: bool = False,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    below: float = math.inf,
) -> bool:
    """Whether `require` takes all of an array, at the cost of a few looks at it as a whole."""
    if not array.size:
        return True
    least, most = array.min(), array.max()  # a NaN is both
    return bool(
        least >= minimum
        and most <= maximum
        and -math.inf < least
        and most < below
        and not (positive and least <= 0)
        and not (whole and (array % 1).any())
    )


def require_each(name: str, values: Any, length: int, **bounds: Any) -> None:
    """Raise unless there are so many numbers, each as `require` wants it.

    Parameters
    ----------
    name : str
        The parameter as its caller wrote it.
    values : sequence of float
        What the caller gave.
    length : int
        How many there must be.
    **bounds
        As for `require`.

    Raises
    ------
    ValueError
        Naming the parameter, or the element of it, and what is allowed.
    """
    listed = isinstance(values, Sequence) or getattr(values, "ndim", 0) == 1
    if not listed or len(values) != length:
        raise ValueError(f"{name} is {_line(values)}, but must be {length} numbers")
    for i, value in enumerate(values):
        require(f"{name}[{i}]", value, **bounds)


def require_generator(name: str, value: Any) -> None:
    """Raise unless `value` is a source of randomness.

    Parameters
    ----------
    name : str
        The parameter as its caller wrote it.
    value : numpy.random.Generator
        What the caller gave.

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    if not isinstance(value, np.random.Generator):
        raise ValueError(f"{name} is {_line(value)}, but must be a numpy.random.Generator")


def _line(value: Any) -> str:
    """A value as text on one line, cut where it is longer than a sentence bears."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."
