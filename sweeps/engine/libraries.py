"""Installed libraries: which distributions have a top-level package, and their versions."""

from __future__ import annotations

import re
from functools import cache
from importlib import metadata
from importlib.util import find_spec


@cache
def versions(top: str) -> tuple[tuple[str, str], ...]:
    """Return distributions of a top-level package with versions; empty if it is only a source."""
    names = {owner.metadata["Name"] for owner in distributions().get(top, ())}
    if not names and not _is_there(top):
        return ((top, "not installed"),)
    return tuple((name, metadata.version(name)) for name in sorted(names))


@cache
def distributions() -> dict[str, list[metadata.Distribution]]:
    """Return the distributions that provide each top-level package.

    Like `metadata.packages_distributions`, which is slow and, in Python 3.11, omits packages
    that are a single compiled file.
    """
    found: dict[str, list[metadata.Distribution]] = {}
    for owner in metadata.distributions():
        files = owner.read_text("RECORD") or owner.read_text("top_level.txt") or ""
        for top in {name.partition(".")[0] for name in re.findall("\n([^/,\n]+)", f"\n{files}")}:
            found.setdefault(top, []).append(owner)
    return found


def _is_there(top: str) -> bool:
    try:
        return find_spec(top) is not None
    except ValueError:  # __main__, or a module created at run time
        return False
