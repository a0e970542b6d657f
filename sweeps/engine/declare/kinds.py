"""Kinds of settings: numbers, counts, words, switches, and sets of them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from fractions import Fraction
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

MAX_NUMBER = 1e300  # larger numbers are mistakes, and integers need not fit a float
MAX_VALUES = 100_000  # longer axes come from a mistaken step
EARLIEST, LATEST = np.datetime64("1678-01-01"), np.datetime64("2262-01-01")  # whole years in M8[ns]
DECIMAL = r"[-+.\deE]+"  # pattern of a number
STEP_TOLERANCE = 10**9  # `stop` is included if a step ends within step / STEP_TOLERANCE
Value = Any  # a float, int, str, bool, None, `Identified`, or a tuple of them


@runtime_checkable
class Identified(Protocol):
    """A value that enters keys by its `identity` instead of its `repr`."""

    @property
    def identity(self) -> object:
        """Text or number that differs between values that give different results."""


@dataclass(frozen=True)
class Kind:
    """Values that a setting may have: one, or several in a list; with `null`, null is allowed."""

    null: bool = field(default=False, kw_only=True)

    @property
    def allowed(self) -> str:
        """Description of allowed values, such as 'null or a finite number at least 0'."""
        return f"null or {self._description}" if self.null else self._description

    @property
    def _description(self) -> str:
        """Description of allowed values but null."""
        raise NotImplementedError

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""
        raise NotImplementedError

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """Return distinct values in ascending order, null first, read from a user's input.

        Raises
        ------
        ValueError
            Naming the key, the value and the allowed values.
        """
        listed = self._as_list(key, given)
        for value in listed:
            if not (value is None and self.null) and not self.holds(value):
                raise ValueError(self._error_text(key, value))
        return sorted_values(
            key, [None if value is None else self._read_value(value) for value in listed]
        )

    def as_input(self, values: tuple[Value, ...]) -> Any:
        """Return some values as a user would write them."""
        return values[0] if len(values) == 1 else list(values)

    @property
    def fields(self) -> tuple[str, ...]:
        """Keys of the mapping in which a user writes values, if they are written so."""
        return ()

    @property
    def entries(self) -> tuple[Any, ...]:
        """Settings that declare the keys of a mapping given as a value; see `read_entries`."""
        return ()

    def coordinates(
        self, values: tuple[Value, ...]
    ) -> Mapping[str, tuple[NDArray[Any], Mapping[str, Any]]] | None:
        """Return the coordinates that describe values, with attributes, by name.

        The first is the main one and takes the name of the axis. None: use the values themselves.
        """
        return None

    def origin(self, value: Value) -> Any:
        """Return the source of a value, to distinguish sources that have the same name."""
        return None

    def _as_list(self, key: str, value: Any) -> list[Any]:
        several = isinstance(value, Sequence) and not isinstance(value, str)
        return list(value) if several else [value]

    def _read_value(self, value: Any) -> Value:
        return value

    def _error_text(self, key: str, value: Any) -> str:
        return f"{key} has {quote_value(value)}, but must be {self.allowed}"


@dataclass(frozen=True)
class Number(Kind):
    """Finite numbers from `low` to `high`, and less than `below`.

    A user lists them, or gives start, stop and step. Messages name their `unit`.
    """

    low: float = -math.inf
    high: float = math.inf
    below: float = math.inf
    unit: str = "1"

    noun: ClassVar[str] = "a finite number"

    @property
    def _description(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        if self.low > -math.inf and self.high < math.inf:
            return f"{self.noun.replace('finite ', '')} from {self.low:g} to {self.high:g}{unit}"
        bounds = [f"at least {self.low:g}"] if self.low > -math.inf else []
        bounds += [f"at most {self.high:g}"] if self.high < math.inf else []
        bounds += [f"below {self.below:g}"] if self.below < math.inf else []
        return f"{self.noun} {' and '.join(bounds) or 'in' * bool(unit)}".rstrip() + unit

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""
        return (
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and max(self.low, -MAX_NUMBER) <= value <= min(self.high, MAX_NUMBER)
            and value < self.below
        )

    def _as_list(self, key: str, value: Any) -> list[Any]:
        read = _read_steps if isinstance(value, Mapping) else super()._as_list
        return read(key, value)

    def _error_text(self, key: str, value: Any) -> str:
        text = value if isinstance(value, str) else ""
        if re.fullmatch(f"{DECIMAL}([ ;]+{DECIMAL})+", text):
            hint = f"; a list has commas, '{key}=[{', '.join(re.split('[ ;]+', text))}]'"
        elif match := re.fullmatch(f"({DECIMAL}):({DECIMAL}):({DECIMAL})", text):
            steps = "start: {}, stop: {}, step: {}".format(*match.groups())
            hint = f"; steps are '{key}={{{steps}}}'"
        else:
            hint = ""
        return super()._error_text(key, value) + hint

    def _read_value(self, value: Any) -> Value:
        return float(value) + 0.0  # -0.0 becomes 0.0, which equals it


@dataclass(frozen=True)
class Count(Number):
    """Whole numbers; see `Number`."""

    low: float = 1

    noun: ClassVar[str] = "a whole number"

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""
        return super().holds(value) and value == int(value)

    def _read_value(self, value: Any) -> Value:
        return int(value)  # not through a float, which cannot represent all of them


@dataclass(frozen=True)
class Draws(Kind):
    """Number of draws, counted from 0: 3 means the values 0, 1 and 2."""

    high: int

    @property
    def _description(self) -> str:
        return f"a whole number from 1 to {self.high}"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        if type(given) is not int or not 1 <= given <= self.high:
            raise ValueError(f"{key} is {quote_value(given)}, but must be {self.allowed}")
        return tuple(range(given))

    def as_input(self, values: tuple[Value, ...]) -> int:
        """See `Kind.as_input`."""
        return len(values)


@dataclass(frozen=True)
class Word(Kind):
    """Words from a list."""

    words: tuple[str, ...]

    @property
    def _description(self) -> str:
        return f"one of {', '.join(self.words)}"

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""
        return isinstance(value, str) and value in self.words


@dataclass(frozen=True)
class Switch(Kind):
    """On, off, or both."""

    _description: ClassVar[str] = "one of true, false"

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""
        return isinstance(value, bool)


@dataclass(frozen=True)
class Text(Kind):
    """Any text that is not empty, such as a path."""

    _description: ClassVar[str] = "a text that is not empty"

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""
        return isinstance(value, str) and value != ""


@dataclass(frozen=True)
class Date(Kind):
    """Times without a zone: numpy's in a `unit`, else `datetime`; also as text."""

    unit: str = ""

    _description: ClassVar[str] = "a time from 1678 to 2261 without a zone"

    def holds(self, value: Any) -> bool:
        """Return whether a value is of this kind."""
        try:
            time = self._read_value(value) if isinstance(value, str) else value
            if not isinstance(time, np.datetime64 if self.unit else datetime):
                return False
            if self.unit and isinstance(value, str) and np.datetime64(value) != time:
                return False  # finer than the unit
            has_zone = isinstance(time, datetime) and time.tzinfo is not None
            return not has_zone and bool(EARLIEST <= np.datetime64(time) < LATEST)
        except (ValueError, OverflowError):
            return False

    def _read_value(self, value: Any) -> Value:
        if self.unit:
            read: Any = np.datetime64
            return read(value, self.unit)
        return datetime.fromisoformat(value) if isinstance(value, str) else value

    def as_input(self, values: tuple[Value, ...]) -> list[str]:
        """See `Kind.as_input`."""
        return [str(value) if self.unit else value.isoformat() for value in values]


@dataclass(frozen=True)
class Vector(Kind):
    """List of `size` finite numbers: one value, a tuple."""

    size: int
    element: Number = field(default_factory=Number)

    @property
    def _description(self) -> str:
        return f"a list of {self.size}, each {self.element.allowed}"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        listed = self._as_list(key, given)
        if len(listed) != self.size or not all(map(self.element.holds, listed)):
            raise ValueError(f"{key} is {quote_value(given)}, but must be {self.allowed}")
        return (tuple(map(self.element._read_value, listed)),)


@dataclass(frozen=True)
class SetOf(Kind):
    """A set of values of another kind that form one value, a tuple.

    Each word of `spellings` denotes a set; null means 'not given'.
    """

    kind: Kind
    spellings: tuple[tuple[str, tuple[str, ...]], ...] = ()

    @property
    def allowed(self) -> str:
        """See `Kind.allowed`."""
        words = "".join(f", or {word}" for word, _ in self.spellings)
        return f"a list, each {self.kind.allowed}{words}" + (", or null" if self.null else "")

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        if given is None and self.null:
            return (None,)
        spellings = dict(self.spellings)
        if isinstance(given, str) and given in spellings:
            return (tuple(sorted(spellings[given])),)
        if spellings and isinstance(given, str) and not self.kind.holds(given):
            words = ", ".join(spellings)
            raise ValueError(f"{key} is {given!r}, but must be {self.kind.allowed}, {words}")
        return (self.kind.values(key, given),)

    def as_input(self, values: tuple[Value, ...]) -> list[Value] | None:
        """See `Kind.as_input`."""
        return None if values[0] is None else list(values[0])


@dataclass(frozen=True)
class Groups(Kind):
    """Lists of words, each list a group: one value."""

    _description: ClassVar[str] = "a list of lists of names"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        groups = [] if given is None else self._as_list(key, given)
        for group in groups:
            is_list = isinstance(group, Sequence) and not isinstance(group, str)
            if not is_list or len(group) < 2 or not all(isinstance(name, str) for name in group):
                raise ValueError(
                    f"{key} is {quote_value(given)}, but must be {self.allowed}, at least two each"
                )
        return (tuple(map(tuple, groups)),)


def quote_value(value: Any) -> str:
    """Return a value as messages show it: None as null."""
    if isinstance(value, list):
        return f"[{', '.join(map(quote_value, value))}]"
    return "null" if value is None else repr(value)


def format_value(value: Any) -> str:
    """Return a value, or a mapping or list of values, as the command line reads it."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {format_value(entry)}' for key, entry in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(format_value, value))}]"
    if isinstance(value, float):
        return f"{value:.12g}"
    return json.dumps(value) if value is None or isinstance(value, bool) else str(value)


def sorted_values(key: str, values: Sequence[Value]) -> tuple[Value, ...]:
    """Return sorted values, None first; raise ValueError if there are none or one is repeated."""
    if not values:
        raise ValueError(f"{key} is empty, but must hold at least one value")
    labels = set()
    for value in values:
        # Stores strip trailing NULs from texts.
        label = value.rstrip("\0") if isinstance(value, str) else value
        if label in labels:
            problem = f"{key} has {quote_value(value)} more than once"
            raise ValueError(f"{problem}, but values must differ")
        labels.add(label)
    return tuple(sorted(values, key=sort_key))


def sort_key(value: Value) -> tuple[bool, Any]:
    """Return the sort key of a value: None comes first."""
    return value is not None, 0 if value is None else value


def _read_steps(key: str, steps: Mapping[str, Any]) -> list[float]:
    """Return values from start to stop, including stop if a step lands on it."""
    if set(steps) != {"start", "stop", "step"}:
        raise ValueError(
            f"{key} has the keys {', '.join(map(str, steps)) or '(none)'}, but must have start, "
            "stop and step, or be a list"
        )
    for name, value in steps.items():
        if not Number().holds(value):
            raise ValueError(Number()._error_text(f"{key}.{name}", value))
    # As decimals: 0.1 steps give 0.3 and not 0.30000000000000004.
    numbers = [float(steps[name]) for name in ("start", "stop", "step")]
    start, stop, step = (Fraction(repr(number)) for number in numbers)
    if step <= 0:
        raise ValueError(f"{key}.step has {quote_value(steps['step'])}, but must be above 0")
    count = (stop - start + step / STEP_TOLERANCE) // step + 1
    if count < 1:
        ends = "{:g} to {:g}".format(*numbers)
        raise ValueError(f"{key} runs from {ends}, but stop must not be below start")
    if count > MAX_VALUES:
        by = f"{numbers[2]:g}"
        raise ValueError(f"{key}.step is {by}, but must leave at most {MAX_VALUES} values")
    lands = abs(start + step * (count - 1) - stop) * STEP_TOLERANCE <= step
    values = [float(start + step * number) for number in range(count)]
    return [*values[:-1], numbers[1]] if lands else values
