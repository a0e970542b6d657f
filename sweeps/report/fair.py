"""Comparison with the article: which rows of a store are of its ships, aspects and settings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

import xarray as xr

from ncti import ships
from sweeps.engine.attributes import nested
from sweeps.engine.kinds import Draws
from sweeps.engine.settings import Settings, flatten
from sweeps.report import rows
from sweeps.report.axes import Axis
from sweeps.stages.categories import Network
from sweeps.stages.classifier import Classifier
from sweeps.stages.fresh import Fresh
from sweeps.stages.infrared import Infrared
from sweeps.stages.ladar import Ladar
from sweeps.stages.mnn import Mnn
from sweeps.stages.views import Grid, Scene

GROUPS: dict[str, tuple[type[Settings], ...]] = {
    "acn": (Scene, Ladar, Classifier, Network),
    "mnn": (Scene, Ladar, Classifier, Mnn),
    "acn_infrared": (Scene, Infrared, Classifier, Network),
}
"""Settings that must be the default, the article's, by classifier; `source_percent` checks those
of the grid."""


def read_compared(store: Any, group: str) -> xr.Dataset:
    """Return a group of tables of a store, to which the source's figures may be added."""
    return compared(rows.read(store, group), store.attrs)


def compared(tables: xr.Dataset, attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return tables with a test of their rows by classifier, for `rows.is_fair`.

    For a group of tables, and the attributes of the root of its store.
    """
    given = nested(attributes)
    tests = {name: Comparison(tables, given, name).is_fair for name in GROUPS}
    return tables.assign_attrs({rows.COMPARED: tests})


def has_source_views(tables: xr.Dataset, attributes: Mapping[str, Any]) -> bool:
    """Return whether tables are of the article's own ships, as packaged, and of its aspects."""
    given = flatten((Grid.aspect, Fresh.fresh), attributes.get("configuration", {}))
    aspects = set(Grid.aspect.values(given.get(Grid.aspect.key, Grid.aspect.default)))
    theirs = set(Grid.aspect.values(Grid.aspect.default))
    drawn = given.get(Fresh.fresh.key, Fresh.fresh.default)  # tested apart from the others
    digests = attributes.get("mesh_digests", {})
    learned = int(tables.view_count.max()) if "view_count" in tables else None
    return (
        learned in (None, len(_packaged()) * len(theirs))  # fewer if some failed
        and theirs <= aspects
        and len(aspects) == len(theirs) + drawn
        and sorted(digests.values()) == sorted(_packaged())
    )


class Comparison:
    """Test of rows of a classifier, given its tables and the attributes of its store."""

    def __init__(self, tables: xr.Dataset, attributes: Mapping[str, Any], classifier: str) -> None:
        self._possible = classifier in GROUPS and has_source_views(tables, attributes)
        self._swept: dict[str, set[Any]] = {}  # default values of settings with others, too
        if not self._possible:
            return
        checked = [
            one
            for group in GROUPS[classifier]
            for one in group.declared
            if one.fallback is None
            and one is not Classifier.name
            and not isinstance(one.kind, Draws)
        ]
        for key, written in flatten(checked, attributes.get("configuration", {})).items():
            setting = next(one for one in checked if one.key == key)
            given, default = set(setting.values(written)), set(setting.values(setting.default))
            self._possible &= bool(given & default)
            if given - default:
                self._swept[setting.name] = default

    def is_fair(self, row: Mapping[str, Any]) -> bool:
        """Return whether a row is at the article's settings.

        A row without a value on the axis of a setting does not depend on it.
        """
        return self._possible and all(
            row[axis] is None or row[axis] in self._swept[axis.name] for axis in self._axes(row)
        )

    def _axes(self, row: Mapping[str, Any]) -> Iterable[Axis]:
        return (key for key in row if isinstance(key, Axis) and key.name in self._swept)


@lru_cache
def _packaged() -> tuple[str, ...]:
    """Return the digests of the article's ships."""
    return tuple(ships.digest(str(one)) for one in Grid.ship.values(Grid.ship.default))
