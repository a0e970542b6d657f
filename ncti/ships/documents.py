"""Reading of YAML with bounded cost, whatever the text."""

from __future__ import annotations

from typing import Any

import yaml

from ncti.ships.errors import ShipError, short_repr

# The packaged sheets have up to 2,300 values, nested 6 deep. An alias counts at each use, as a
# few lines of nested aliases can expand to more values than fit into memory.
MAX_VALUES = 50_000
MAX_DEPTH = 30
MAX_VALUE = 10_000  # characters of one value

# The loader of libyaml, if PyYAML has it, takes a tenth of the time.
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

MERGE = "tag:yaml.org,2002:merge"  # tag of the merge key '<<'; explicit keys override merged ones


class _DuplicateKeyError(Exception):
    """Duplicate key in a mapping; YAML libraries silently take the last value."""


class _Loader(LOADER):  # type: ignore[valid-type, misc]
    """A loader that refuses duplicate keys."""

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Return the mapping of a node."""
        keys = [key for key, _ in node.value if key.tag != MERGE]
        names = set()
        for key in keys:
            if isinstance(key, yaml.ScalarNode):
                name = self.construct_object(key)
                if name in names:
                    raise _DuplicateKeyError(
                        f"{short_repr(name)} is given twice (line {key.start_mark.line + 1})"
                    )
                names.add(name)
        return super().construct_mapping(node, deep)


def read(where: str, text: str) -> Any:
    """Return the value of a YAML text.

    Refuses (`ShipError`) text that is not YAML, has a key twice, or is larger or nested deeper than
    any sheet; `where` names it in messages.
    """
    try:
        _check_size(where, text)
        return yaml.load(text, _Loader)
    except ShipError:
        raise
    except _DuplicateKeyError as twice:
        raise ShipError(f"{where}: {twice}.") from None
    except Exception as error:  # constructors of tags may raise anything
        line = getattr(getattr(error, "problem_mark", None), "line", None)
        position = "" if line is None else f" (line {line + 1})"
        raise ShipError(f"{where}: is not valid YAML{position}.") from None


def _check_size(where: str, text: str) -> None:
    """Refuse texts that would take long to construct, from their events alone."""
    values = 0
    size_of: dict[str | None, int | None] = {}  # by anchor; None while it is still open
    opened: list[tuple[str | None, int]] = []  # anchor, and number of values before it
    for event in yaml.parse(text, LOADER):
        match event:
            case yaml.AliasEvent(anchor=anchor):
                size = size_of.get(anchor, 0)
                if size is None:
                    raise ShipError(f"{where}: '*{anchor}' holds itself, but no value may.")
                values += size
            case yaml.ScalarEvent(anchor=anchor, value=value):
                if len(value) > MAX_VALUE:
                    excess = f"has {short_repr(value)} of {len(value)} characters"
                    raise _excess_error(where, excess, MAX_VALUE)
                values += 1
                size_of[anchor] = 1
            case yaml.CollectionStartEvent(anchor=anchor):
                opened.append((anchor, values))
                if len(opened) > MAX_DEPTH:
                    raise _excess_error(where, f"is nested {len(opened)} deep", MAX_DEPTH)
                values += 1
                size_of[anchor] = None
            case yaml.CollectionEndEvent():
                anchor, before = opened.pop()
                size_of[anchor] = values - before
        if values > MAX_VALUES:
            excess = f"has {values} values or more, with those that its aliases stand for"
            raise _excess_error(where, excess, MAX_VALUES)


def _excess_error(where: str, excess: str, limit: int) -> ShipError:
    return ShipError(f"{where}: {excess}, but may be at most {limit}.")
