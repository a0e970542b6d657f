"""What axes of flights are called: in tables, in titles of pictures, and in CSV files."""

from __future__ import annotations

import math
from typing import Any

import xarray as xr
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from sweeps.axes import AXES as AXIS_ATTRIBUTES
from sweeps.axes import FLIGHT_AXES, OF_FLIGHT
from sweeps.report.screen import NOTHING

AXES = ("ship", "aspect", "range", *OF_FLIGHT)
WRITTEN = {"degree": "deg", "m s-1": "m/s", "urad": "µrad", "1": ""}  # of units that need it
IN_FILES = {"degree": "deg", "m s-1": "m_s", "1": ""}
SHORT = {"transom_gain": "transom*", "mast_gain": "masts*"}
PUT_IN = "* Put in: what the transom and the masts reflect, over the rest of the ship."


def unit_of(name: str) -> str:
    """Unit of an axis, as the store has it."""
    return (AXIS_ATTRIBUTES | FLIGHT_AXES).get(name, {}).get("units", "1")


def heading(name: str) -> str:
    """Of a column of values on an axis: its name, and its unit in brackets."""
    unit = WRITTEN.get(unit_of(name), unit_of(name))
    return SHORT.get(name, name.replace("_", " ")) + (f" [{unit}]" if unit else "")


def column(name: str) -> str:
    """The same in a CSV file: the unit after the name, as `range_km`."""
    if name == "aspect_bin":
        return "aspect_bin_deg"
    unit = IN_FILES.get(unit_of(name), unit_of(name).lower())
    return f"{name}_{unit}" if unit else name


def shown(value: Any) -> str:
    """A value of an axis; NaN where it was left to the heading, or to the ship."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return NOTHING
    return f"{value:g}" if isinstance(value, (int, float)) else str(value).replace("_", " ")


def told(name: str, value: Any) -> str:
    """A value with its axis and unit, such as `cnr 10 dB`."""
    if name == "error":
        parameter, amount = value
        if parameter == "none":
            return "no error"
        return f"{shown(parameter)} wrong by {amount:g}"
    text = name.replace("_", " ")
    if isinstance(value, bool):
        return text if value else f"no {text}"
    unit = WRITTEN.get(unit_of(name), unit_of(name))
    return f"{text} {shown(value)} {unit}".strip()


def which(one: xr.Dataset, of: xr.Dataset, *, but: tuple[str, ...] = ()) -> str:
    """What tells one flight from the others of a store.

    Parameters
    ----------
    one : xarray.Dataset
        The flight, at one place of each axis that is told.
    of : xarray.Dataset
        All of them.
    but : tuple of str
        Axes that are told elsewhere.

    Returns
    -------
    str
        Its values on the axes that have several, preceded by a comma; nothing if none has.
    """
    names = [name for name in AXES if of.sizes.get(name, 1) > 1 and name not in (*but, *one.dims)]
    return "".join(f", {told(name, value_at(one, name))}" for name in names)


def value_at(one: xr.Dataset, name: str) -> Any:
    """Value of a flight on an axis; of `error` the parameter and by how much it is wrong."""
    if name == "error":
        return one.error_parameter.values.item(), one.error_value.values.item()
    return one[name].values.item()


def print_whole(table: Table, console: Console) -> None:
    """Print a table that loses no word: headings fold at blanks if they must, values do not.

    A console that is too narrow even so is widened.
    """
    spare = console.width - 3 * len(table.columns) - 1  # blanks either side, and lines between
    for one in table.columns:
        texts = [Text.from_markup(str(text)).plain for text in one.cells]
        words = Text.from_markup(str(one.header)).plain.split()
        one.width = max(map(cell_len, (*words, *texts)), default=1)
        spare -= one.width
    for one in table.columns:
        lines = Text.from_markup(str(one.header)).plain.split("\n")
        more = max(map(cell_len, lines)) - (one.width or 0)
        if 0 < more <= spare:
            one.width, spare = (one.width or 0) + more, spare - more
    console.width += max(0, -spare)
    console.print(table)
