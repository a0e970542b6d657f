"""What the value of a setting may be: numbers, counts, words, switches, sets of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from sweeps.engine.errors import ConfigurationError

T = TypeVar("T")

LARGEST = 1e300  # beyond it a number is a slip, and integers need not fit a float
MOST_VALUES = 100_000  # longer axes are a slip of the step, not a plan
Value = Any  # a float, int, str, bool, None, or a tuple of them


class Kind(Protocol):
    """What a setting may be."""

    @property
    def allowed(self) -> str:
        """Words for what is allowed, as in 'a finite number at least 0'."""

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """Distinct values in ascending order, read from what a user wrote.

        Raises
        ------
        ConfigurationError
            Naming the key, the value and what is allowed.
        """


@dataclass(frozen=True)
class Number:
    """Finite numbers within bounds; one, a list, or start, stop and step.

    Attributes
    ----------
    low, high : float
        Inclusive bounds.
    below : float
        Exclusive upper bound.
    null : bool
        Whether null is a value, too.
    """

    low: float = -math.inf
    high: float = math.inf
    below: float = math.inf
    positive: bool = False
    null: bool = False

    @property
    def allowed(self) -> str:
        """See `Kind.allowed`."""
        bounds = ["above 0"] if self.positive else []
        bounds += [f"at least {self.low:g}"] if self.low > -math.inf else []
        bounds += [f"at most {self.high:g}"] if self.high < math.inf else []
        bounds += [f"below {self.below:g}"] if self.below < math.inf else []
        words = "a finite number" + (" " + " and ".join(bounds) if bounds else "")
        return f"null or {words}" if self.null else words

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`; null comes before all numbers."""
        listed = _steps(key, given) if isinstance(given, Mapping) else _listed(given)
        found: list[float | None] = []
        for value in listed:
            if value is None and self.null:
                found.append(None)
            elif self.holds(value):
                found.append(float(value) + 0.0)  # -0.0 becomes 0.0, with which it is equal
            else:
                raise _refused(key, value, self.allowed)
        return ascending(key, found)

    def holds(self, value: Any) -> bool:
        """Whether something is one of these numbers."""
        return (
            isinstance(value, int | float)
            and not isinstance(value, bool)
            and max(self.low, -LARGEST) <= value <= min(self.high, LARGEST)
            and value < self.below
            and not (self.positive and value <= 0)
        )


@dataclass(frozen=True)
class Count:
    """Whole numbers within inclusive bounds; one, a list, or start, stop and step."""

    low: int = 1
    high: float = math.inf
    null: bool = False

    @property
    def allowed(self) -> str:
        """See `Kind.allowed`."""
        return Number(self.low, self.high, null=self.null).allowed.replace("finite", "whole")

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        listed = _steps(key, given) if isinstance(given, Mapping) else _listed(given)
        numbers = Number(self.low, self.high)
        for value in listed:
            null = value is None and self.null
            if not null and not (numbers.holds(value) and value == int(value)):
                raise _refused(key, value, self.allowed)
        # Not by way of floats, which do not hold all of them.
        return ascending(key, [value if value is None else int(value) for value in listed])


@dataclass(frozen=True)
class Draws:
    """How many of something there are, counted from 0: 3 stands for the values 0, 1 and 2."""

    high: int

    @property
    def allowed(self) -> str:
        """See `Kind.allowed`."""
        return f"a whole number from 1 to {self.high}"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        whole = isinstance(given, int) and not isinstance(given, bool)
        if not whole or not 1 <= given <= self.high:
            raise ConfigurationError(f"{key} is {given!r}, but must be {self.allowed}")
        return tuple(range(given))


@dataclass(frozen=True)
class Word:
    """Words from a list; one of them, or several."""

    words: tuple[str, ...]

    @property
    def allowed(self) -> str:
        """See `Kind.allowed`."""
        return f"one of {', '.join(self.words)}"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        for word in _listed(given):
            if not isinstance(word, str) or word not in self.words:
                raise _refused(key, word, self.allowed)
        return ascending(key, [str(word) for word in _listed(given)])


@dataclass(frozen=True)
class Switch:
    """On, off, or both."""

    allowed: str = "one of true, false"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        for value in _listed(given):
            if not isinstance(value, bool):
                raise _refused(key, value, self.allowed)
        return ascending(key, _listed(given))


@dataclass(frozen=True)
class Text:
    """Any text that is not empty, such as a path."""

    null: bool = False

    @property
    def allowed(self) -> str:
        """See `Kind.allowed`."""
        return "null or a text" if self.null else "a text"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        for text in _listed(given):
            if not (isinstance(text, str) and text) and not (text is None and self.null):
                word = "empty" if text == "" else repr(text)
                raise ConfigurationError(f"{key} is {word}, but must be {self.allowed}")
        return ascending(key, _listed(given))


@dataclass(frozen=True)
class SetOf:
    """A set of values that belong together: one value, which is a tuple.

    Attributes
    ----------
    kind : Kind
        Of its members.
    null : bool
        Whether null, the value None, stands for 'not given'.
    spellings : tuple of (str, tuple)
        Words that stand for a set.
    """

    kind: Kind
    null: bool = False
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
        known = dict(self.spellings)
        if isinstance(given, str) and given in known:
            return (tuple(sorted(known[given])),)
        if self.spellings and isinstance(given, str) and isinstance(self.kind, Word):
            allowed = ", ".join((*self.kind.words, *known))
            if given not in self.kind.words:
                raise ConfigurationError(f"{key} is {given!r}, but must be one of {allowed}")
        return (self.kind.values(key, given),)


@dataclass(frozen=True)
class Groups:
    """Lists of words, each list for what belongs together: one value."""

    allowed: str = "a list of lists of names"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """See `Kind.values`."""
        if given is None:
            return ((),)
        groups = _listed(given)
        for group in groups:
            words = isinstance(group, Sequence) and not isinstance(group, str)
            if not words or len(group) < 2 or not all(isinstance(one, str) for one in group):
                raise ConfigurationError(
                    f"{key} is {given!r}, but must be {self.allowed}, two or more in each"
                )
        return (tuple(tuple(group) for group in groups),)


def ascending(key: str, values: Sequence[T]) -> tuple[T, ...]:
    """Sorted values, refused when there are none or one is there twice; None comes first."""
    if not values:
        raise ConfigurationError(f"{key} is empty, but must hold at least one value")
    seen: set[T] = set()
    for value in values:
        if value in seen:
            raise ConfigurationError(f"{key} has {value!r} more than once, but values must differ")
        seen.add(value)
    return tuple(sorted(values, key=_rank))


def _rank(value: Any) -> tuple[bool, Any]:
    return (value is not None, 0 if value is None else value)


def _listed(given: Any) -> list[Any]:
    """What was given, as a list."""
    is_list = isinstance(given, Sequence) and not isinstance(given, str)
    return list(given) if is_list else [given]


def _refused(key: str, value: Any, allowed: str) -> ConfigurationError:
    return ConfigurationError(f"{key} has {value!r}, but every value must be {allowed}")


def _steps(key: str, given: Mapping[str, Any]) -> list[float]:
    """Values from start to stop, which is among them when a step lands on it."""
    if set(given) != {"start", "stop", "step"}:
        raise ConfigurationError(
            f"{key} has the keys {', '.join(map(str, given)) or '(none)'}, but must have start, "
            "stop and step, or be a list"
        )
    for name, value in given.items():
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise ConfigurationError(f"{key}.{name} is {value!r}, but must be a number")
    (start,) = Number().values(f"{key}.start", given["start"])
    (stop,) = Number().values(f"{key}.stop", given["stop"])
    (step,) = Number(positive=True).values(f"{key}.step", given["step"])
    count = math.floor((stop - start) / step * (1 + 1e-12) + 1e-9) + 1
    if count < 1:
        raise ConfigurationError(
            f"{key} runs from {start:g} to {stop:g}, but stop must not be below start"
        )
    if count > MOST_VALUES:
        raise ConfigurationError(
            f"{key}.step is {step:g}, but must leave at most {MOST_VALUES} values"
        )
    # Rounded, so that 0.1 steps give 0.3 and not 0.30000000000000004.
    return [float(value) for value in np.round(start + step * np.arange(count), 12)]
