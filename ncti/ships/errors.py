"""The error of this package, and the text of a value in its message."""

from __future__ import annotations

import reprlib
from typing import Any

from ncti.text import printable

MAX_MESSAGE = 1000  # characters of a message


class ShipError(ValueError):
    """A ship cannot be loaded; the message is one sentence with the value and the allowed values.

    Names and paths come from users, so the message escapes unprintable characters.

    See Also
    --------
    load : Raises it.

    Examples
    --------
    >>> import ncti
    >>> try:
    ...     ncti.ships.load("bismarck")
    ... except ncti.ships.ShipError as error:
    ...     print(error)
    unknown ship 'bismarck', known are connole, duncan, ...
    """

    def __init__(self, message: str) -> None:
        line = printable(message)
        super().__init__(line if len(line) <= MAX_MESSAGE else f"{line[: MAX_MESSAGE - 3]}...")


def short_repr(value: Any) -> str:
    """Return a value as text of at most 60 characters, in a time independent of its size.

    A YAML alias takes a few bytes but may expand to millions of values.
    """
    return _ShortRepr().repr(value)[:60]


class _ShortRepr(reprlib.Repr):
    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 3
        self.maxlist = self.maxtuple = self.maxset = self.maxdict = 4
        self.maxstring = self.maxother = 60

    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to write out thousands of digits.
        bits = x.bit_length()
        return super().repr_int(x, level) if bits < 1000 else f"a whole number of {bits} bits"
