"""Ships of a configuration: names, paths, and mesh files with their axes, unit and origin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ncti.ships import ShipError, Transform, names
from ncti.ships.loading import MAX_LABEL, MESH_SUFFIXES, SHEET_SUFFIXES
from ncti.ships.transform import AXES, MAX_OFFSET, MAX_SCALE, MIN_SCALE
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import Text, Value, Word, quote_value
from sweeps.engine.declare.settings import (
    Setting,
    Settings,
    number,
    read_entries,
    switch,
    text,
    vector,
    word,
)

SUFFIXES = SHEET_SUFFIXES + MESH_SUFFIXES
_ONE = "it is of one ship"


class ShipFile(Settings, key="grid.ship"):
    """A ship with the axes, unit and origin of its file."""

    path = Setting(
        Text(), None, "name of a known ship, or path of a sheet or mesh; required", not_swept=_ONE
    )
    name = text(None, label="label of the ship; null: its name, or its file's", not_swept=_ONE)
    up = word("z", AXES, label="axis of the file that points up", not_swept=_ONE)
    forward = Setting(
        Word(AXES, null=True),
        None,
        "axis of the file that points to the bow; null: x; -z where up is x, z where it is -x",
        not_swept=_ONE,
    )
    scale = number(
        1.0,
        low=MIN_SCALE,
        high=MAX_SCALE,
        label="metres in a unit of the file",
        help="0.001 for millimetres",
        not_swept=_ONE,
    )
    offset = vector(
        [0.0, 0.0, 0.0],
        size=3,
        low=-MAX_OFFSET,
        high=MAX_OFFSET,
        unit="m",
        label="shift forward, to port and up",
        help="after turning and scaling; the origin is amidships on the waterline",
    )
    repair = switch(
        False,
        label="close openings of the mesh",
        help="those of at most 5 % of its surface together, and any below the waterline",
        not_swept=_ONE,
    )


class ShipName(str):
    """Label of a ship: its name or the stem of its file, with its source.

    Labels compare equal whatever their source, since stores have labels only.
    """

    source: str
    transform: Transform

    def __new__(cls, label: str, source: str, transform: Transform | None = None) -> ShipName:
        """Make a label with its source: a name, or the absolute path of a sheet or mesh."""
        name = super().__new__(cls, label)
        name.source = source
        name.transform = Transform() if transform is None else transform
        return name

    def __getnewargs__(self) -> tuple[str, str, Transform]:  # type: ignore[override]
        """Return the arguments that make an equal label when unpickled."""
        return str(self), self.source, self.transform


@dataclass(frozen=True)
class Ships(Text):
    """Ships: one or several names, or paths of sheets and meshes.

    With `entries`, a mapping with these keys is also accepted as a ship.
    """

    entries: tuple[Setting, ...] = ()

    @property
    def allowed(self) -> str:
        """See `sweeps.engine.declare.kinds.Kind.allowed`."""
        return "a ship, or a list of ships"

    def values(self, key: str, given: Any) -> tuple[Value, ...]:
        """Return labels in ascending order, each a `ShipName`; see `Kind.values` of the engine."""
        listed = [given] if isinstance(given, str | Mapping) else given
        if not (isinstance(listed, Sequence) and listed and all(map(self._is_ship, listed))):
            raise ConfigurationError(f"{key} is {quote_value(given)}, but must be {self.allowed}")
        ships: set[ShipName] = set()
        for value in listed:
            ship = ship_name(value) if isinstance(value, str) else self._read_file(key, value)
            if ship in ships:
                raise ConfigurationError(
                    f"{key} has {quote_value(value)}, but only one ship may be named "
                    f"{str(ship)!r}: give each once"
                )
            ships.add(ship)
        return tuple(sorted(ships))

    def origin(self, value: ShipName) -> tuple[str, Transform]:
        """Return source and transform, which distinguish ships of the same label."""
        return value.source, value.transform

    def _is_ship(self, value: Any) -> bool:
        if isinstance(value, str):
            return value != ""
        return bool(self.entries) and isinstance(value, Mapping)

    def _read_file(self, key: str, mapping: Mapping[Any, Any]) -> ShipName:
        """Return the ship of a mapping; `ConfigurationError` if it is wrong."""
        entries = read_entries(self.entries, key, mapping)
        path, label = entries.pop("path"), entries.pop("name")
        try:
            transform = Transform(**entries)
        except ShipError as error:
            raise ConfigurationError(f"{key} is {quote_value(dict(mapping))}: {error}") from error
        ship = ship_name(path)
        if label is None:
            return ShipName(str(ship), ship.source, transform)
        printable = label.strip() and label.isprintable() and len(label) <= MAX_LABEL
        if not printable or _is_path(label):
            raise ConfigurationError(
                f"{key}.name is {quote_value(label)}, but must be 1 to {MAX_LABEL} printable "
                f"characters that do not end in {', '.join(SUFFIXES)}"
            )
        return ShipName(label, ship.source, transform)


def ship_name(name: str) -> ShipName:
    """Return the label of a name or path, with its source."""
    if isinstance(name, ShipName):
        return name
    if not _is_path(name):
        return ShipName(name, name)
    path = Path(name)
    return ShipName(path.stem, str(path.absolute()))


def _is_path(name: str) -> bool:
    return name not in names() and Path(name).suffix.lower() in SUFFIXES


def ships(default: Any, *, entries: tuple[Setting, ...] = (), **about: Any) -> Setting:
    """Return a setting of one or several ships; `about` has further arguments of `Setting`."""
    return Setting(Ships(null=default is None, entries=entries), default, **about)
