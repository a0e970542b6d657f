"""Names of axes in CSV files, headings and titles, read from the store."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, Self

import xarray as xr

NOTHING = "–"  # for a missing figure, or a value given in the heading or by the ship

# Dimensions that are not settings: draws, which are pooled, and those of profiles and images.
DRAWS = ("replicate", "ifov_phase", "phase", "order", "draw")
OF_ARRAYS = (
    *("down_range", "lag", "row", "column", "col", "angle", "radius"),
    *("horizontal", "vertical", "aspect_low"),
)
MARKS = ("learned", "known")  # coordinates that mark the training set, and are no axes

# Order of columns, and of rows from the slowest; other axes come before the number of frames.
BEFORE = (
    *("ship", "aspect", "range", "super_resolution", "pulse_width", "classifier"),
    *("target_free_ifovs", "receiver"),
    *("coverage_rule", "segmentation", "inner_radius", "interpolation"),
    *("learning_rate", "vigilance", "label_rule", "score_rule", "training", "gain_sigma"),
    *(
        "learn_in_test",
        "left_out",
        "epochs",
        "grow_every",
        "mnn_learning_rate",
        "tolerance",
        "inputs",
        "annealing",
    ),
)
AFTER = (
    *("error", "error_parameter", "error_value", "channel", "infrared_frame_count", "frame_count"),
    *("kind", "aspects", "least_rejected", "test_vigilance", "source", "aspect_bin"),
)

UNITS = {"aspect_bin": "degree"}  # of pooled aspects, whose values are words
IN_FILES = {"degree": "deg", "m s-1": "m_s", "1": "", "pixel": "", "%": "percent"}
WRITTEN = {"degree": "deg", "urad": "µrad", "1": ""}
SHORT = {"transom_gain": "transom*", "mast_gain": "masts*"}

# In titles, instead of name, value and unit; of a switch the words for off and on.
PHRASES = {
    **dict.fromkeys(("range", "pulse_width"), "{}"),
    "target_free_ifovs": "{} target-free IFOVs",
    "frame_count": "{} frames",
    "infrared_frame_count": "{} infrared frames",
    "label_rule": "named by its {} members",
    "score_rule": "right by {}",
    "training": "learned from {} profiles",
    "epochs": "{} epochs",
    "grow_every": "a node every {} epochs",
    "mnn_learning_rate": "learning rate {}",
    "tolerance": "to an error of {}",
    "inputs": "{} inputs",
}
SWITCHES = {
    "left_out": ("", "true aspect left out"),
    "annealing": ("not annealed", "annealed"),
    "learn_in_test": ("no learning in the test", "learning in the test"),
}

# Value shown by a table or a picture of one setting if there are several; else the first.
NOMINAL: dict[str, Any] = {
    **{"label_rule": "majority", "score_rule": "ship", "training": "expected", "left_out": False},
    **{"aspects": "random", "learn_in_test": False},
    **{
        "learn_in_test": False,
        "inputs": "standardised",
        "annealing": True,
        "coverage_rule": 0.25,
        "inner_radius": 0.5,
    },
    **{"segmentation": "matched", "interpolation": "nearest", "learning_rate": 0.1},
    **{"transom_gain": 1.0, "mast_gain": 1.0, "error_parameter": "none", "autofocus": False},
    **{"cnr": 32.0, "target_free_ifovs": 4000},
    **{"chain": "exact", "azimuth": "pixel", "mirror": "exact", "range_filter": "cluster"},
}


class Column(str):
    """Name of a column, such as `range_km`, with the attributes of its variable."""

    name: str
    units: str
    long_name: str

    def __new__(cls, variable: xr.DataArray) -> Self:
        """Return the column of a variable."""
        name = str(variable.name)
        units = str(variable.attrs.get("units", UNITS.get(name, "1")))
        unit = IN_FILES.get(units)
        if unit is None:
            unit = re.sub(r"[^a-z0-9]+", "_", re.sub(r" (\w+)-1\b", r"_per_\1", units.lower()))
        column = super().__new__(cls, f"{name}_{unit.strip('_')}" if unit else name)
        column.name, column.units = name, units
        column.long_name = str(variable.attrs.get("long_name", ""))
        return column

    @property
    def words(self) -> str:
        """The name, as words."""
        return SHORT.get(self.name, printable(self.name.replace("_", " ")))

    @property
    def unit(self) -> str:
        """The unit as printed; empty if there is none."""
        return WRITTEN.get(self.units, re.sub(r" (\w+)-1\b", r"/\1", printable(self.units)))

    @property
    def heading(self) -> str:
        """The name, and the unit in brackets."""
        return self.words + (f" [{self.unit}]" if self.unit else "")


class Axis(Column):
    """Column that is an axis; a `number` counts the places of one that has other coordinates."""

    number = False

    @property
    def foreseen(self) -> bool:
        """Return whether tables have words for it."""
        return self.name in (*BEFORE, *AFTER, *SHORT)

    @property
    def rank(self) -> tuple[int, str]:
        """Its position among others, in columns and in the nesting of rows."""
        for start, names in ((0, BEFORE), (1000, AFTER)):
            if self.name in names:
                return start + names.index(self.name), ""
        return 500, self.name

    def told(self, value: Any) -> str:
        """Return a value with its axis and unit, such as `cnr 10 dB`."""
        if isinstance(value, bool):
            words = self.name.replace("_", " ")
            return SWITCHES.get(self.name, (f"no {words}", words))[value]
        if self.name == "gain_sigma":
            return "gain known" if value == 0 else f"gain unknown by {value:.0%}"
        phrase = PHRASES.get(self.name, printable(self.name.replace("_", " ")) + " {}")
        return phrase.replace("{}", f"{shown(value)} {self.unit}".strip())


def axes_of(
    dataset: xr.Dataset | xr.DataArray, *, but: Iterable[str] = (*DRAWS, *OF_ARRAYS)
) -> dict[Axis, str | None]:
    """Return the axes of a data set, in order, each with its dimension; None of a single value.

    A joint axis has as many columns as coordinates. Dimensions in `but` are left out.
    """
    found: dict[Axis, str | None] = {}
    gone = {*but, *MARKS}
    coords = {str(name): coord for name, coord in dataset.coords.items() if name not in gone}
    along = [coord.dims for coord in coords.values()]
    for name, coord in coords.items():
        if coord.ndim == 0 or (coord.ndim == 1 and coord.dims[0] not in gone):
            number = name in coord.dims and along.count((name,)) > 1 and name != "aspect_bin"
            axis = Axis(coord)
            axis.number = number
            found[axis] = str(coord.dims[0]) if coord.ndim else None
    for dim in dataset.dims:
        if dim not in gone and str(dim) not in found.values():
            found[Axis(dataset[dim])] = str(dim)
    return {axis: found[axis] for axis in sorted(found, key=lambda axis: axis.rank)}


def printable(text: str) -> str:
    """Return a text with its control and other invisible characters escaped."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else repr(one)[1:-1] for one in text)


def shown(value: Any) -> str:
    """Return a value of an axis as printed."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return NOTHING
    return f"{value:g}" if isinstance(value, float) else printable(str(value)).replace("_", " ")


def told(place: Mapping[Any, Any], axes: Iterable[Axis]) -> list[str]:
    """Return values at a place on some axes in words; of an error, the parameter with its value."""
    words = []
    for axis in axes:
        value = place[axis]
        if axis.name == "error_parameter":
            wrong = f"{shown(value)} wrong by {shown(place.get('error_value'))}"
            words.append("no error" if value == "none" else wrong)
        elif value is not None and not axis.number and axis.name != "error_value":
            words.append(axis.told(value))
    return [word for word in words if word]


def nominal(dataset: xr.Dataset, *, keep: Iterable[str] = (), **wanted: Any) -> xr.Dataset:
    """Return a data set at the wanted or nominal value of every axis, or else the first.

    Dimensions in `keep`, and those of profiles and images, stay.
    """
    place = {}
    for dim in set(map(str, dataset.dims)) - {*keep, *OF_ARRAYS}:
        place[dim] = 0
        for name, value in (NOMINAL | wanted).items():
            if name in dataset.coords and dataset[name].dims == (dim,):
                there = dataset[name].values.tolist()
                place[dim] = there.index(value) if value in there else 0
    return dataset.isel(place)


def which(one: xr.Dataset, of: xr.Dataset | xr.DataArray, *, but: Iterable[str] = ()) -> str:
    """Return the values of one place on the axes that vary, except `but`, each after a comma."""
    place = {
        axis: one[axis.name].values.item()
        for axis, dim in axes_of(of).items()
        if dim and of.sizes[dim] > 1 and axis.name not in but and one[axis.name].ndim == 0
    }
    return "".join(f", {word}" for word in told(place, place))
