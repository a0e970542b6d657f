"""Settings and swept axes of a store, and the states of its cells."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import zarr

from ncti.text import printable
from sweeps.engine.declare.stage import STATUS
from sweeps.report.frames import Frame
from sweeps.report.stores import attributes, failed_cells, list_groups, read_group
from sweeps.report.words import is_number, unit_of, value_text

STAGE_CHOICES = ("sensor", "name", "engine")  # settings that choose stages, and are not axes
STATES = (1, 0, -1)  # of a cell: done, failed, missing
MAX_VALUES = 8  # of a setting that are listed; of more numbers, the ends


@dataclass(frozen=True)
class Status:
    """Numbers of cells of a store that are done, failed and missing, by kind, and failures."""

    parts: Mapping[str, tuple[int, ...]]
    failures: Mapping[str, str]
    cells: tuple[int, int] = (0, 0)  # done and failed, as the screen counts them; 0 if unknown

    @property
    def counts(self) -> tuple[int, ...]:
        """Numbers of all cells that are done, failed and missing."""
        done, failed, missing = (sum(part[k] for part in self.parts.values()) for k in range(3))
        return done, max(failed, bool(self.failures)), missing  # some failures have no state

    @property
    def word(self) -> str:
        """The state of the sweep: complete, partial or failed; unknown of a store without any."""
        done, failed, missing = self.counts
        if not self.parts and not failed:
            return "unknown"
        if not done:
            return "failed" if failed else "partial"
        return "partial" if failed or missing else "complete"

    @property
    def sentence(self) -> str:
        """Number of finished cells, by the sweep's own count or else by the results stored."""
        (done, failed), missing, unit = self.cells, 0, "cells"
        if not done + failed:
            (done, failed, missing), unit = self.counts, "results"
        if not done + failed + missing:
            return "The store has no record of its cells"
        sentence = f"{done:,} of {done + failed + missing:,} {unit} done"
        sentence += f", {failed:,} failed" if failed else ""
        return sentence + (f", {missing:,} missing" if missing else "")


def status_of(store: Any, timings: Frame | None = None) -> Status:
    """Return the states of a store's cells, counted by its last sweep's `timings` if known."""
    parts = {}
    for name, array in (
        read_group(store, STATUS).data_vars.items() if STATUS in list_groups(store) else ()
    ):
        counts = tuple(int((array.values == state).sum()) for state in STATES)
        parts[printable(str(name).replace("_", " "))] = counts
    cells = 0, 0
    if timings is not None:
        done, reused, failed = timings.rows[["done", "reused", "failed"]].sum()
        cells = int(done + reused), int(failed)
    return Status(parts, failed_cells(store), cells)


def iter_settings(tree: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every setting of a configuration by its key."""
    for key, value in tree.items():
        if isinstance(value, Mapping) and value:
            yield from iter_settings(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def swept_settings(store: Any, settings: Iterable[tuple[str, Any]]) -> list[tuple[str, str]]:
    """Return key and values of the settings that are axes or that choose between stages."""
    axes = attributes(store).get("axes", ())
    units = {
        path.rpartition("/")[2]: unit_of(str(array.attrs.get("units", "1")))
        for path, array in store.members(max_depth=None)
        if isinstance(array, zarr.Array)
    }
    return [
        (key, values_in_words(value, units.get(key.rpartition(".")[2], "")))
        for key, value in settings
        if isinstance(value, list) and len(value) > 1
        if key in axes or key.rpartition(".")[2] in STAGE_CHOICES
    ]


def values_in_words(values: list[Any], unit: str) -> str:
    """Return values in words; of many numbers, the ends."""
    if len(values) > MAX_VALUES and all(map(is_number, values)):
        ends = f"{value_text(min(values))} to {value_text(max(values))} {unit}".strip()
        return f"{ends}, {len(values)} values"
    return f"{', '.join(map(value_text, values))} {unit}".strip()


def yaml_text(value: Any) -> str:
    """Return a value of the configuration as YAML, on one line."""
    return printable(json.dumps(value, ensure_ascii=False))
