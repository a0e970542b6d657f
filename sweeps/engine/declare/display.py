"""Display of a table: declared with it, stored in its group's attributes, read by the report."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from sweeps.engine.declare.errors import ConfigurationError

if TYPE_CHECKING:
    from sweeps.engine.declare.settings import Choices

ATTRIBUTE = "displays"  # of a group, with its displays


@dataclass(frozen=True)
class Figure:
    """One number shown in a table: a variable of the group, with its interval and extra columns."""

    variable: str
    name: str = ""  # of its column; the variable's by default
    low: str = ""  # variables with the ends of its 95 % interval; by default found by their names
    high: str = ""
    # Variables of additional columns, by column name; by default found by their names.
    extra_columns: Mapping[str, str] = field(default_factory=dict)
    percent: bool = False  # a fraction, shown and written in percent
    digits: int | None = None  # decimals that are written; None: all
    format: str = ".4g"  # on screen and page
    listed: bool = True  # else it is in the file only

    @property
    def column(self) -> str:
        """Name of its column."""
        return self.name or self.variable


@dataclass(frozen=True)
class Display:
    """One table made of a group. Groups with displays of the same name are one table."""

    name: str  # of the table and its file
    title: str
    figures: tuple[Figure, ...] = ()  # the main one first; none: all variables of the group
    rows: tuple[str, ...] = ()  # axes down, before others of several values
    columns: str = ""  # axis along the columns, to show the main figure only; empty: one per figure
    # Axes of one value that distinguish the groups of a table.
    labels: Mapping[str, str] = field(default_factory=dict)
    source: str = ""  # the article's table whose figures stand beside these
    # Main figure expected from random guessing.
    chance: float | Callable[[Choices], float] | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()

    def as_attribute(self, choices: Choices) -> dict[str, Any]:
        """Return the attribute that stores it, with `chance` evaluated for a sweep's choices."""
        chance = self.chance(choices) if callable(self.chance) else self.chance
        return {**asdict(self), "chance": chance}


def parse_display(attribute: Mapping[str, Any]) -> Display:
    """Return the display that an attribute stores.

    Raises ConfigurationError if another version, with other fields, wrote it.
    """
    try:
        figures = tuple(Figure(**figure) for figure in attribute["figures"])
        rows, notes = tuple(attribute["rows"]), tuple(attribute["notes"])
        return Display(**{**attribute, "figures": figures, "rows": rows, "notes": notes})
    except (KeyError, TypeError) as error:
        problem = "another version wrote its tables; sweep again into another store"
        raise ConfigurationError(problem) from error
