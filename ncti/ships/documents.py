"""YAML text in, plain values out, at a cost that is bounded whatever the text."""

from __future__ import annotations

from typing import Any

import yaml

from ncti.ships.errors import ShipError, shown

# The packaged sheets have up to 2,300 values, nested 6 deep. An alias counts as often as it is
# used: a few lines of aliases to aliases stand for more values than a machine can hold.
MOST_VALUES = 50_000
DEEPEST = 30
LONGEST = 10_000  # characters of one value

# That of libyaml, where PyYAML has it, takes a tenth of the time.
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def read(where: str, text: str) -> Any:
    """What a YAML text says.

    Parameters
    ----------
    where : str
        What to call the text in messages.
    text : str
        One document of plain YAML.

    Returns
    -------
    dict, list, str, int, float, bool, date or None
        Its value.

    Raises
    ------
    ShipError
        When it is not YAML, or larger or deeper than a sheet has any use for.
    """
    try:
        _check_size(where, text)
        return yaml.load(text, LOADER)
    except ShipError:
        raise
    except Exception as error:  # a tag may promise what its text does not keep, in any way
        line = getattr(getattr(error, "problem_mark", None), "line", None)
        at = "" if line is None else f" (line {line + 1})"
        raise ShipError(f"{where}: is not valid YAML{at}.") from None


def _check_size(where: str, text: str) -> None:
    """Refuse what would take long to build, before anything is built."""
    values = 0
    size_of: dict[str | None, int | None] = {}  # by anchor; None while it is still open
    opened: list[tuple[str | None, int]] = []  # anchors, and how many values came before
    for event in yaml.parse(text, LOADER):
        match event:
            case yaml.AliasEvent(anchor=anchor):
                size = size_of.get(anchor, 0)
                if size is None:
                    raise ShipError(f"{where}: '*{anchor}' holds itself, but no value may.")
                values += size
            case yaml.ScalarEvent(anchor=anchor, value=value):
                _check(where, f"has {shown(value)} of {len(value)} characters", len(value), LONGEST)
                values += 1
                size_of[anchor] = 1
            case yaml.CollectionStartEvent(anchor=anchor):
                opened.append((anchor, values))
                _check(where, f"is nested {len(opened)} deep", len(opened), DEEPEST)
                values += 1
                size_of[anchor] = None
            case yaml.CollectionEndEvent():
                anchor, before = opened.pop()
                size_of[anchor] = values - before
        told = f"has {values} values or more, with those that its aliases stand for"
        _check(where, told, values, MOST_VALUES)


def _check(where: str, told: str, size: int, most: int) -> None:
    if size > most:
        raise ShipError(f"{where}: {told}, but may be at most {most}.")
