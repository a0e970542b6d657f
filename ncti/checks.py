"""Refusing a number that cannot be meant, in one sentence."""

from __future__ import annotations

import math


def require(
    name: str,
    value: float,
    *,
    positive: bool = False,
    minimum: float = -math.inf,
    maximum: float = math.inf,
) -> None:
    """Raise unless `value` is a finite number in its range.

    Parameters
    ----------
    name : str
        The parameter as its caller wrote it.
    value : float
        What the caller gave.
    positive : bool
        Whether zero is refused along with everything below it.
    minimum, maximum : float
        Inclusive bounds.

    Raises
    ------
    ValueError
        Naming the parameter, the value and what is allowed.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if minimum <= number <= maximum and math.isfinite(number) and not (positive and number <= 0):
        return
    bounds = []
    if positive:
        bounds.append("above 0")
    if minimum > -math.inf:
        bounds.append(f"at least {minimum:g}")
    if maximum < math.inf:
        bounds.append(f"at most {maximum:g}")
    allowed = "a finite number" + (" " + " and ".join(bounds) if bounds else "")
    raise ValueError(f"{name} is {value!r}, but must be {allowed}")
