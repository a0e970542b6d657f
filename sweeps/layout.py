"""What a store holds: its groups, its variables, their axes and chunks.

    range_profile         expected, averaged
    classification/acn    training_category, training_correct, category, predicted, correct, passes
    status                view, cell
    tables/acn            see `sweeps.classification.tabulate`

Dimensions carry the names of the grid axes. A chunk belongs to one task: the first axes of a
variable, `whole` of them, are cut at every value, and the others are not cut.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import dask.array as da
import numpy as np
import xarray as xr

from sweeps.schema import SweepConfig
from sweeps.stages import Ship, bin_centres

MISSING, FAILED, DONE = -1, 0, 1

PROFILES, ACN, STATUS, TABLES = "range_profile", "classification/acn", "status", "tables/acn"

AXES: dict[str, dict[str, str]] = {
    "ship": {"long_name": "ship"},
    "aspect": {"units": "degree", "long_name": "aspect, 0 bow-on, 90 port beam"},
    "pulse_width": {"units": "ns", "long_name": "pulse width, full width at 1/e^2"},
    "frame_count": {"units": "1", "long_name": "frames averaged"},
    "range": {"units": "km", "long_name": "slant range"},
    "vigilance": {"units": "1", "long_name": "vigilance in training"},
    "target_free_ifovs": {"units": "1", "long_name": "target-free IFOVs accumulated a frame"},
    "down_range": {"units": "m", "long_name": "down-range from the ship origin"},
}

FLOOR = "target_free_ifovs"  # a dimension only when it has several values
VIEW = ("ship", "aspect")
CELL = ("pulse_width", "range", FLOOR)


@dataclass(frozen=True)
class Variable:
    """One array of a store."""

    group: str
    name: str
    dims: tuple[str, ...]
    whole: int
    fill: float
    dtype: str
    long_name: str


_PROFILE = {"group": PROFILES, "whole": len(VIEW), "fill": np.nan, "dtype": "f4"}
_ANSWER = {"group": ACN, "whole": len(CELL), "fill": -1}
_STATE = {"group": STATUS, "fill": MISSING, "dtype": "i1"}
_TRAINED, _TESTED = (*CELL, "vigilance"), (*CELL, "vigilance", "frame_count")

VARIABLES = tuple(
    Variable(name=name, dims=dims, long_name=long_name, **shared)  # type: ignore[arg-type]
    for name, dims, long_name, shared in (
        (
            "expected",
            (*VIEW, "pulse_width", "range", FLOOR, "down_range"),
            "expected range profile, noise floor included",
            _PROFILE,
        ),
        (
            "averaged",
            (*VIEW, "pulse_width", "frame_count", "range", FLOOR, "down_range"),
            "frame-averaged range profile, noise floor included",
            _PROFILE,
        ),
        (
            "training_category",
            (*_TRAINED, *VIEW),
            "category of the expected profile",
            _ANSWER | {"dtype": "i4"},
        ),
        (
            "training_correct",
            (*_TRAINED, *VIEW),
            "1 where that category has the ship's name",
            _ANSWER | {"dtype": "i1"},
        ),
        (
            "category",
            (*_TESTED, *VIEW),
            "category that the averaged profile falls into",
            _ANSWER | {"dtype": "i4"},
        ),
        (
            "predicted",
            (*_TESTED, *VIEW),
            "ship named, as an index into the ship axis",
            _ANSWER | {"dtype": "i2"},
        ),
        ("correct", (*_TESTED, *VIEW), "1 where the ship is right", _ANSWER | {"dtype": "i1"}),
        (
            "passes",
            _TRAINED,
            "presentations until the categories settled, negative if they did not",
            _ANSWER | {"dtype": "i4", "fill": 0},
        ),
        ("view", VIEW, "state of the profiles of a view", _STATE | {"whole": len(VIEW)}),
        ("cell", (*_TESTED, *VIEW), "state of a cell of the grid", _STATE | {"whole": len(CELL)}),
    )
)


@dataclass(frozen=True)
class Axes:
    """Values of every axis of a sweep, in the order of `AXES`, and what received its profiles."""

    values: Mapping[str, Any]
    receiver: str

    @classmethod
    def of(cls, config: SweepConfig, ships: tuple[Ship, ...]) -> Axes:
        """The axes of a checked configuration."""
        grid = asdict(config.grid.expand())
        return cls(
            receiver=config.ladar.receiver,
            values=grid
            | {
                "ship": tuple(ship.label for ship in ships),
                FLOOR: config.ladar.floor_axis(),
                "down_range": bin_centres(config.ladar),
            },
        )

    def dims(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Those names that are dimensions."""
        return tuple(name for name in names if name != FLOOR or len(self.values[FLOOR]) > 1)

    def coordinates(self, dims: set[Hashable]) -> dict[str, Any]:
        """Coordinates of some dimensions, with units; a single noise floor is a scalar one."""
        coords: dict[str, Any] = {}
        for name, attrs in AXES.items():
            values = self.values[name]
            if name in dims:
                # Strings as objects: fixed-width ones are no part of the zarr 3 format.
                array = np.array(values, dtype=object if name == "ship" else None)
                coords[name] = (name, array, attrs)
            elif name == FLOOR:
                coords[name] = ((), values[0], attrs)
        return coords

    def templates(self) -> dict[str, xr.Dataset]:
        """Data sets of unwritten arrays, by group."""
        variables: dict[str, dict[str, xr.Variable]] = {}
        for variable in VARIABLES:
            dims = self.dims(variable.dims)
            shape = tuple(len(self.values[dim]) for dim in dims)
            lead = len(self.dims(variable.dims[: variable.whole]))
            chunks = (1,) * lead + shape[lead:]
            unwritten = da.full(shape, variable.fill, dtype=variable.dtype, chunks=chunks)
            attrs: dict[str, Any] = {"units": "1", "long_name": variable.long_name}
            if variable.group == PROFILES:
                attrs["receiver"] = self.receiver
            if variable.name == "expected" and self.receiver != "full_profile":
                attrs["long_name"] = "what the receiver reports of each IFOV's expected waveform"
            if variable.group == STATUS:
                attrs["flag_values"] = [MISSING, FAILED, DONE]
                attrs["flag_meanings"] = "missing failed done"
            # An unwritten chunk reads as its fill value, which xarray would leave at 0.
            encoding = {"chunks": chunks, "fill_value": variable.fill}
            array = xr.Variable(dims, unwritten, attrs, encoding)
            variables.setdefault(variable.group, {})[variable.name] = array
        return {
            group: xr.Dataset(
                arrays, self.coordinates({dim for array in arrays.values() for dim in array.dims})
            )
            for group, arrays in variables.items()
        }
