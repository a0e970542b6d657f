"""Swept axes, states of cells, and provenance of a store."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import zarr

from sweeps.report.stores import attributes, groups, read
from sweeps.report.words import printable, shown, unit_of

CHOICES = ("sensor", "name", "engine")  # settings that choose stages, and are not axes
NAMED = 20  # failures that are listed; all are in the store


@dataclass(frozen=True)
class Status:
    """Cells of a store by state, in all and by stage."""

    done: int
    failed: int
    missing: int
    parts: list[tuple[str, int, int, int]]
    failures: list[tuple[str, str]] = field(default_factory=list)
    more: int = 0

    @property
    def word(self) -> str:
        """The state of the sweep: complete, partial or failed; unknown of a store without any."""
        if not self.parts and not self.failures:
            return "unknown"
        if not self.done:
            return "failed" if self.failed else "partial"
        return "partial" if self.failed or self.missing else "complete"

    @property
    def sentence(self) -> str:
        """The numbers of cells, in words."""
        if not self.parts:
            return "the store has no record of its cells"
        counts = f"{self.done:,} of {self.done + self.failed + self.missing:,} cells done"
        more = [f"{self.failed:,} failed"] * bool(self.failed)
        more += [f"{self.missing:,} missing"] * bool(self.missing)
        return ", ".join((counts, *more))


def status_of(store: Any) -> Status:
    """Return the states of all cells of a store."""
    parts: list[tuple[str, int, int, int]] = []
    for group in groups(store):
        if group != "status" and not group.startswith("status_"):
            continue
        for name, array in read(store, group).data_vars.items():
            states = array.values
            done, failed, missing = (int((states == state).sum()) for state in (1, 0, -1))
            label = str(name) if group == "status" else group.removeprefix("status_")
            parts.append((printable(label.replace("_", " ")), done, failed, missing))
    failures = [(str(k), str(v)) for k, v in attributes(store).get("failures", {}).items()]
    done = sum(part[1] for part in parts)
    failed = sum(part[2] for part in parts)
    missing = sum(part[3] for part in parts)
    # Include failures that no state shows.
    failed, more = max(failed, bool(failures)), max(0, len(failures) - NAMED)
    return Status(done, failed, missing, parts, failures[:NAMED], more)


def units_of(store: Any) -> dict[str, str]:
    """Return the units of all coordinates of a store, by name."""
    found: dict[str, str] = {}
    for path, array in store.members(max_depth=None):
        name = path.rpartition("/")[2]
        if isinstance(array, zarr.Array) and _dims(array) in ((name,), ()):
            found.setdefault(name, unit_of(str(array.attrs.get("units", "1"))))
    return found


def _dims(array: zarr.Array) -> tuple[str, ...]:
    return tuple(getattr(array.metadata, "dimension_names", None) or ())


def flat(tree: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every setting of a configuration by its key."""
    for key, value in tree.items():
        name = f"{above}.{key}" if above else str(key)
        if isinstance(value, Mapping) and value:
            yield from flat(value, name)
        else:
            yield name, value


def swept(settings: Iterable[tuple[str, Any]], units: Mapping[str, str]) -> list[tuple[str, str]]:
    """Return key and values of the settings that are axes of the store.

    `units` are of all axes, by name.
    """
    found = []
    for key, value in settings:
        axis = key.rpartition(".")[2]
        if isinstance(value, list) and len(value) > 1 and axis in {*units, *CHOICES}:
            found.append((key, _several(value, units.get(axis, ""))))
    return found


def _several(values: list[Any], unit: str) -> str:
    numbers = [v for v in values if isinstance(v, int | float) and not isinstance(v, bool)]
    if len(values) > 8 and len(numbers) == len(values):
        ends = f"{shown(min(numbers))} to {shown(max(numbers))}"
        return f"{ends} {unit}".strip() + f", {len(values)} values"
    few = ", ".join(shown(value) for value in values[:12])
    more = f" and {len(values) - 12} more" if len(values) > 12 else ""
    return f"{few} {unit}".strip() + more


def written(value: Any) -> str:
    """Return a value of the configuration as YAML, on one line."""
    return printable(json.dumps(value, ensure_ascii=False))


def provenance(attributes: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return tables of everything that results depend on besides the configuration."""
    known = (
        ("Versions", "versions"),
        ("Digests of the ships' meshes", "mesh_digests"),
        ("Transforms of the ships' meshes", "mesh_transforms"),
        ("Digests of code by stage", "code"),
        ("Digests of results by stage", "cells"),
    )
    return [
        (title, [(str(key), str(value)) for key, value in dict(attributes[name]).items()])
        for title, name in known
        if attributes.get(name)
    ]
