"""Checks of arguments, with one-sentence errors that state name, value and allowed values."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Unit of each parameter name, the same in all docstrings that state one.
UNITS = {
    name: unit
    for unit, names in {
        "m": "slant_range reference_range bin_width window footprint altitude middle_range "
        "earth_radius pulse_length spacing reach",
        "m^2": "area",
        "s": "pulse_width slew_time",
        "Hz": "frame_rate pulse_rate",
        "rad": "ifov",
        "deg": "aspect mirror_angle roll aircraft_heading ship_heading tracked",
        "dB": "decibels cnr_db",
        "dB/m": "extinction",
        "K": "contrast contrasts contrast_at_zero nedt deviation sea_sigma sea_spread "
        "sea_temperature target_sigma target_spread temperature",
    }.items()
    for name in names.split()
}


class NothingSeenError(ValueError):
    """An image or profile shows nothing of the ship to measure, although its values are valid.

    A caller that can do without the measurement catches this type, and no other `ValueError`.
    """


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
    """Raise `ValueError` unless `value` is a finite number in its range; texts are refused.

    `minimum` and `maximum` are inclusive, `below` is exclusive, and `positive` refuses 0.
    """
    try:
        number = math.nan if isinstance(value, (str, bytes)) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    except OverflowError:
        # An integer too large for a float; its digits would fill pages.
        number = value = math.inf if value > 0 else -math.inf
    limits = {"minimum": minimum, "maximum": maximum, "below": below}
    in_bounds = _is_range_allowed(number, number, positive=positive, **limits)
    if in_bounds and not (whole and number % 1):
        return
    has_both_limits = minimum > -math.inf and maximum < math.inf
    bounds = ["above 0"] if positive else []
    bounds += [f"from {minimum:g} to {maximum:g}"] if has_both_limits else []
    bounds += [f"at least {minimum:g}"] if minimum > -math.inf and not has_both_limits else []
    bounds += [f"at most {maximum:g}"] if maximum < math.inf and not has_both_limits else []
    bounds += [f"below {below:g}"] if below < math.inf else []
    kind = "a whole number" if whole else "a number" if has_both_limits else "a finite number"
    unit = f" {UNITS[name]}" if name in UNITS else ""
    text = f"{_short_text(value)}{unit if math.isfinite(number) else ''}"
    allowed = f"{kind} {' and '.join(bounds) or 'in' * bool(unit)}".rstrip()
    raise ValueError(f"{name} is {text}, but must be {allowed}{unit}")


def require_instance(name: str, value: Any, kind: type) -> None:
    """Raise `ValueError` unless `value` is a `kind`, a class exported by a package of `ncti`."""
    if not isinstance(value, kind):
        package = ".".join(kind.__module__.split(".")[:2])
        raise ValueError(
            f"{name} is {_short_text(value)}, but must be an {package}.{kind.__name__}"
        )


def require_all(name: str, values: Any, **bounds: Any) -> NDArray[np.float64]:
    """Return numbers (...) as a float64 array, or raise for the first that `require` refuses."""
    try:
        array = np.asarray(values)
    except ValueError:
        raise ValueError(
            f"{name} is {_short_text(values)}, but must be an array of numbers"
        ) from None
    if array.dtype.kind not in "biuf" or not _are_in_bounds(array, **bounds):
        for value in array.ravel().tolist():
            require(name, value, **bounds)
    return np.asarray(array, dtype=np.float64)


def _are_in_bounds(array: NDArray[Any], *, whole: bool = False, **bounds: Any) -> bool:
    """Return whether `require` accepts every element, by vectorised checks of the array."""
    if not array.size:
        return True
    lowest, highest = float(array.min()), float(array.max())  # a NaN is both
    return _is_range_allowed(lowest, highest, **bounds) and not (whole and (array % 1).any())


def _is_range_allowed(
    lowest: float,
    highest: float,
    *,
    positive: bool = False,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    below: float = math.inf,
) -> bool:
    """Return whether numbers from `lowest` to `highest` are finite and within their bounds."""
    finite = -math.inf < lowest and highest < below
    return finite and minimum <= lowest and highest <= maximum and not (positive and lowest <= 0)


def require_each(name: str, values: Any, length: int, **bounds: Any) -> None:
    """Raise `ValueError` unless `values` are `length` [1] numbers, each of which `require` accepts.

    Examples
    --------
    >>> require_each("phase", (0.2, 0.7), 2, minimum=0.0, below=1.0)
    >>> require_each("phase", (0.2, 1.0), 2, minimum=0.0, below=1.0)
    Traceback (most recent call last):
    ValueError: phase[1] is 1.0, but must be a finite number at least 0 and below 1
    """
    listed = isinstance(values, Sequence) or getattr(values, "ndim", 0) == 1
    if not listed or len(values) != length:
        raise ValueError(f"{name} is {_short_text(values)}, but must be {length} numbers")
    for i, value in enumerate(values):
        require(f"{name}[{i}]", value, **bounds)


def require_shape(name: str, values: NDArray[Any], *shapes: tuple[int, ...]) -> None:
    """Raise `ValueError` unless an array has one of `shapes`; () stands for a single value.

    Examples
    --------
    >>> import numpy as np
    >>> require_shape("weight", np.ones(3), (), (2,))
    Traceback (most recent call last):
    ValueError: weight has shape (3,), but must be one value or (2,)
    """
    if values.shape not in shapes:
        allowed = " or ".join(str(shape) if shape else "one value" for shape in shapes)
        raise ValueError(f"{name} has shape {values.shape}, but must be {allowed}")


def require_word(name: str, value: Any, words: Collection[str]) -> None:
    """Raise `ValueError` unless a value is one of `words`.

    Examples
    --------
    >>> require_word("form", "exact", ("exact", "printed"))
    >>> require_word("form", "round", ("exact", "printed"))
    Traceback (most recent call last):
    ValueError: form is 'round', but must be one of exact, printed
    """
    if not isinstance(value, str) or value not in words:
        raise ValueError(f"{name} is {_short_text(value)}, but must be one of {', '.join(words)}")


def require_labels(name: str, values: Any) -> NDArray[Any]:
    """Return labels (...), numbers or texts, as an array that can be sorted, or raise `ValueError`.

    Examples
    --------
    >>> require_labels("labels", ["duncan", "roberts"])
    array(['duncan', 'roberts'], dtype='<U7')
    >>> require_labels("labels", [["duncan"], []])
    Traceback (most recent call last):
    ValueError: labels is [['duncan'], []], but must be an array of numbers or of texts
    """
    try:
        array = np.asarray(values)
    except (ValueError, OverflowError):
        array = np.asarray(None)
    if array.dtype.kind in "OT":  # as pandas, xarray and numpy 2 keep texts
        texts = array.size and all(isinstance(value, str) for value in array.ravel())
        array = array.astype(str) if texts else np.asarray(None)
    if array.dtype.kind not in "biufUS" or (array.dtype.kind == "f" and np.isnan(array).any()):
        raise ValueError(
            f"{name} is {_short_text(values)}, but must be an array of numbers or of texts"
        )
    return array


def require_flags(
    name: str, values: Any, shape: tuple[int, ...] | None = None
) -> NDArray[np.bool_]:
    """Return flags (...) as an array; `ValueError` unless they can be broadcast to a shape.

    Examples
    --------
    >>> require_flags("answered", True, (2, 3))
    array(True)
    >>> require_flags("answered", [1.0, 0.5], (2,))
    Traceback (most recent call last):
    ValueError: answered is [1.0, 0.5], but must be true or false
    """
    try:
        array = np.asarray(values)
    except (ValueError, OverflowError):
        array = np.asarray(None)
    if array.dtype != np.bool_ and not (array.dtype.kind in "iu" and np.isin(array, (0, 1)).all()):
        raise ValueError(f"{name} is {_short_text(values)}, but must be true or false")
    try:
        np.broadcast_to(array, array.shape if shape is None else shape)
    except ValueError:
        raise ValueError(f"{name} has shape {array.shape}, but must be {shape}") from None
    return array.astype(np.bool_)


def require_generator(name: str, value: Any) -> None:
    """Raise `ValueError` unless a value is a numpy random generator.

    Examples
    --------
    >>> import numpy as np
    >>> require_generator("rng", np.random.default_rng(0))
    >>> require_generator("rng", 0)
    Traceback (most recent call last):
    ValueError: rng is 0, but must be a numpy.random.Generator
    """
    if not isinstance(value, np.random.Generator):
        raise ValueError(f"{name} is {_short_text(value)}, but must be a numpy.random.Generator")


def _short_text(value: Any) -> str:
    """Return a value as text on one line, cut to at most 80 characters."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."
