"""Reading of YAML with unique keys."""

from __future__ import annotations

from typing import Any

import yaml

from ncti.ships.errors import ShipError, short_repr

MAX_DEPTH = 30  # libyaml's loader calls itself; the packaged sheets are nested 6 deep

# The loader of libyaml, if PyYAML has it, takes a tenth of the time.
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

MERGE = "tag:yaml.org,2002:merge"  # of the key '<<', whose values a mapping's own keys override


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

    Refuses (`ShipError`) text that is not YAML, has a key twice, or is nested deeper than any
    sheet; `where` names it in messages.
    """
    try:
        _check_depth(where, text)
        return yaml.load(text, _Loader)
    except ShipError:
        raise
    except _DuplicateKeyError as twice:
        raise ShipError(f"{where}: {twice}.") from None
    except Exception as error:  # constructors of tags may raise anything
        line = getattr(getattr(error, "problem_mark", None), "line", None)
        position = "" if line is None else f" (line {line + 1})"
        raise ShipError(f"{where}: is not valid YAML{position}.") from None


def _check_depth(where: str, text: str) -> None:
    depth = 0
    for event in yaml.parse(text, LOADER):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH:
            raise ShipError(f"{where}: is nested {depth} deep, but may be at most {MAX_DEPTH}.")
