"""What a store holds: its groups, its variables, their axes and chunks.

    range_profile                expected, averaged
    infrared                     image, log_polar, template_log_polar, ...
    classification/acn           training_category, training_correct, category, predicted, ...
    classification/acn_infrared  the same of silhouettes, training_confused
    status                       view, cell
    status_infrared              cell
    tables/...                   see `sweeps.tabulation`

Dimensions carry the names of the grid axes. A chunk belongs to one task: the first axes of a
variable, `whole` of them, are cut at every value, and the others are not cut. The sensors have
groups of their own, since each may have its own ranges and vigilances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import dask.array as da
import numpy as np
import xarray as xr

from sweeps.infrared import ANGLE, RADIUS, STEPS, image_windows
from sweeps.schema import INFRARED, RANGE, SweepConfig
from sweeps.stages import Ship, bin_centres

MISSING, FAILED, DONE = -1, 0, 1

PROFILES, ACN, STATUS = "range_profile", "classification/acn", "status"
IMAGES, ACN_INFRARED, STATUS_INFRARED = "infrared", "classification/acn_infrared", "status_infrared"
TABLES, TABLES_INFRARED, DETECTION, RECONSTRUCTION = (
    f"tables/{name}" for name in ("acn", "acn_infrared", "detection", "super_resolution")
)
GROUPS = (
    *(PROFILES, ACN, STATUS, IMAGES, ACN_INFRARED, STATUS_INFRARED),
    *(TABLES, TABLES_INFRARED, DETECTION, RECONSTRUCTION),
)

AXES: dict[str, dict[str, str]] = {
    "ship": {"long_name": "ship"},
    "aspect": {"units": "degree", "long_name": "aspect, 0 bow-on, 90 port beam"},
    "pulse_width": {"units": "ns", "long_name": "pulse width, full width at 1/e^2"},
    "frame_count": {"units": "1", "long_name": "frames averaged"},
    "range": {"units": "km", "long_name": "slant range"},
    "learning_rate": {"units": "1", "long_name": "learning rate in training"},
    "vigilance": {"units": "1", "long_name": "vigilance in training"},
    "target_free_ifovs": {"units": "1", "long_name": "target-free IFOVs accumulated a frame"},
    "down_range": {"units": "m", "long_name": "down-range from the ship origin"},
    "super_resolution": {"long_name": "how an image gets finer than the detector"},
    "coverage_rule": {"units": "1", "long_name": "share of a pixel that a ship fills to show"},
    "segmentation": {"long_name": "how a silhouette is cut out of an image"},
    "inner_radius": {"units": "1", "long_name": "inner radius of the map, in sqrt(area / pi)"},
    "interpolation": {"long_name": "how the map samples a silhouette"},
    "phase": {"units": "1", "long_name": "number of the ship's place on the detector's pixels"},
    "order": {"units": "1", "long_name": "number of the order of presentation, 0 as in the grid"},
    "replicate": {"units": "1", "long_name": "number of the draw of the noise"},
    "angle": {"units": "degree", "long_name": "angle about the centroid, from the right upwards"},
    "row": {"units": "1", "long_name": "row of pixels, from the lowest"},
    "col": {"units": "1", "long_name": "column of pixels, from the left"},
    "radius": {"units": "1", "long_name": "place between inner (0) and outer (1) log radius"},
}

VIEW = ("ship", "aspect")
CELL = ("pulse_width", "range", "target_free_ifovs")
TEMPLATE = ("coverage_rule", "inner_radius", "interpolation")
CELL_INFRARED = ("coverage_rule", "segmentation", "inner_radius", "interpolation", "phase")
AVERAGE = ("replicate", "frame_count")
LOOK = ("range", "super_resolution", "frame_count")

# Dimensions only when they have several values; a single one is a scalar coordinate.
OPTIONAL = (
    "learning_rate",
    "target_free_ifovs",
    "coverage_rule",
    "segmentation",
    "inner_radius",
    "interpolation",
    "replicate",
)

WINDOW = {
    name: {"units": "m", "long_name": f"{name} place on the target, the ship origin within a pixel"}
    for name in ("vertical", "horizontal")
}


@dataclass(frozen=True)
class Variable:
    """One array of a store."""

    group: str
    sensor: str | None  # None: there whichever sensor looks
    name: str
    dims: tuple[str, ...]
    whole: int
    fill: float
    dtype: str
    long_name: str
    units: str = "1"
    step: float = 1.0  # integers count steps of this size


_PROFILE = {"group": PROFILES, "sensor": RANGE, "whole": len(VIEW), "fill": np.nan, "dtype": "f4"}
_IMAGE = {
    "group": IMAGES,
    "sensor": INFRARED,
    "whole": len(VIEW),
    "fill": np.nan,
    "dtype": "f4",
}
_MAP = _IMAGE | {"fill": 0, "dtype": "u1", "step": 1 / STEPS}
_STATE = {"fill": MISSING, "dtype": "i1"}
_TRAINED = (*CELL, "learning_rate", "vigilance")
_TRAINED_INFRARED = (*CELL_INFRARED, "order", "learning_rate", "vigilance")


def _variables(shared: Mapping[str, Any], *rows: tuple[Any, ...]) -> tuple[Variable, ...]:
    """Variables that have much in common; a row has a name, axes, a meaning, what differs."""
    return tuple(
        Variable(name=name, dims=dims, long_name=long_name, **{**shared, **dict(*differs)})
        for name, dims, long_name, *differs in rows
    )


def _answers(
    group: str,
    sensor: str,
    whole: int,
    trained: tuple[str, ...],
    tested: tuple[str, ...],
    what: str,
    test: str,
) -> tuple[Variable, ...]:
    """What a classifier answers, of any sensor."""
    return _variables(
        {"group": group, "sensor": sensor, "whole": whole, "fill": -1, "dtype": "i4"},
        ("training_category", (*trained, *VIEW), f"category of the {what}"),
        (
            "training_correct",
            (*trained, *VIEW),
            "1 where that category has the ship's name",
            {"dtype": "i1"},
        ),
        (
            "training_confused",
            (*trained, *VIEW),
            "1 where views of another ship share that category",
            {"dtype": "i1"},
        ),
        ("category", (*tested, *VIEW), f"category that the {test} falls into"),
        (
            "predicted",
            (*tested, *VIEW),
            "ship named, as an index into the ship axis",
            {"dtype": "i2"},
        ),
        ("correct", (*tested, *VIEW), "1 where the ship is right", {"dtype": "i1"}),
        (
            "passes",
            trained,
            "presentations until the categories settled, negative if they did not",
            {"fill": 0},
        ),
    )


VARIABLES = (
    *_variables(
        _PROFILE,
        (
            "expected",
            (*VIEW, "pulse_width", "range", "target_free_ifovs", "down_range"),
            "expected range profile, noise floor included",
        ),
        (
            "averaged",
            (*VIEW, "pulse_width", *AVERAGE, "range", "target_free_ifovs", "down_range"),
            "frame-averaged range profile, noise floor included",
        ),
    ),
    *_variables(
        _IMAGE,
        (
            "image",
            (*VIEW, "coverage_rule", *LOOK, "row", "col"),
            "frame-averaged image of the first phase, contrast against the mean sea",
            {"units": "K"},
        ),
        (
            "detection_probability",
            (*VIEW, "coverage_rule", "phase", "range", "frame_count"),
            "probability that a pixel of the ship passes the detector's threshold",
        ),
        (
            "reconstruction_error",
            (*VIEW, "coverage_rule", "phase", *LOOK),
            "rms difference from the noiseless image of half the pixel, over the contrast",
        ),
    ),
    *_variables(
        _MAP,
        (
            "log_polar",
            (*VIEW, *CELL_INFRARED, *LOOK, "angle", "radius"),
            "log-polar map of the silhouette cut out of the image",
        ),
        (
            "template_log_polar",
            (*VIEW, *TEMPLATE, "phase", "angle", "radius"),
            "log-polar map of the noiseless silhouette at the training range",
        ),
    ),
    *_answers(
        ACN,
        RANGE,
        len(CELL),
        _TRAINED,
        (*_TRAINED, *AVERAGE),
        "expected profile",
        "averaged profile",
    ),
    *_answers(
        ACN_INFRARED,
        INFRARED,
        len(CELL_INFRARED),
        _TRAINED_INFRARED,
        (*_TRAINED_INFRARED, *LOOK),
        "noiseless silhouette",
        "silhouette",
    ),
    *_variables(
        _STATE,
        (
            "view",
            VIEW,
            "state of what the sensors see of a view",
            {"group": STATUS, "sensor": None, "whole": len(VIEW)},
        ),
        (
            "cell",
            (*_TRAINED, *AVERAGE, *VIEW),
            "state of a cell of the grid",
            {"group": STATUS, "sensor": RANGE, "whole": len(CELL)},
        ),
        (
            "cell",
            (*_TRAINED_INFRARED, *LOOK, *VIEW),
            "state of a cell of the infrared channel",
            {"group": STATUS_INFRARED, "sensor": INFRARED, "whole": len(CELL_INFRARED)},
        ),
    ),
)


@dataclass(frozen=True)
class Axes:
    """Values of every axis of a sweep, by sensor, and what its users should know of them.

    Attributes
    ----------
    values : mapping of str to mapping
        By sensor and axis, in the order of `AXES`.
    receiver : str
        What received the range profiles.
    windows : mapping
        Coordinates of the pixels of images.
    """

    values: Mapping[str, Mapping[str, Any]]
    receiver: str
    windows: Mapping[str, Any]

    @classmethod
    def of(cls, config: SweepConfig, ships: tuple[Ship, ...]) -> Axes:
        """The axes of a checked configuration."""
        grid = config.grid.expand()
        infrared = config.infrared.expand(grid)
        windows = image_windows(infrared, config.infrared, config.scene)
        shared = asdict(grid) | {
            "ship": tuple(ship.label for ship in ships),
            "learning_rate": config.classifier.learning_rates(),
        }
        values = {
            RANGE: shared
            | {
                "target_free_ifovs": config.ladar.floor_axis(),
                "down_range": bin_centres(config.ladar),
            },
            INFRARED: shared
            | asdict(infrared)
            | {
                "replicate": (),  # its phases are its draws
                "angle": ANGLE,
                "radius": RADIUS,
                "row": np.arange(windows["vertical"].shape[-1]),
                "col": np.arange(windows["horizontal"].shape[-1]),
            },
        }
        return cls(
            {sensor: values[sensor] for sensor in config.sensors}, config.ladar.receiver, windows
        )

    def dims(self, names: tuple[str, ...], sensor: str) -> tuple[str, ...]:
        """Those names that are dimensions."""
        values = self.values[sensor]
        return tuple(name for name in names if name not in OPTIONAL or len(values[name]) > 1)

    def coordinates(self, group: str, sensor: str, dims: set[str]) -> dict[str, Any]:
        """Coordinates of a group, with units; an optional axis of one value is a scalar one."""
        values = self.values[sensor]
        coords: dict[str, Any] = {}
        for name, attrs in AXES.items():
            if name in dims or (name in values and name in OPTIONAL and len(values[name]) == 1):
                array = np.asarray(values[name] if name in dims else values[name][0])
                # Strings as objects: fixed-width ones are no part of the zarr 3 format.
                array = array.astype(object) if array.dtype.kind == "U" else array
                coords[name] = ((name,) if name in dims else (), array, attrs)
        if group == IMAGES:
            for name, pixel in (("vertical", "row"), ("horizontal", "col")):
                along = ("range", "super_resolution", pixel)
                coords[name] = (along, self.windows[name], WINDOW[name])
        return coords

    def templates(self) -> dict[str, xr.Dataset]:
        """Data sets of unwritten arrays, by group."""
        groups: dict[tuple[str, str], dict[str, xr.Variable]] = {}
        for variable in VARIABLES:
            sensor = variable.sensor or next(iter(self.values))
            if sensor in self.values:
                there = groups.setdefault((variable.group, sensor), {})
                there[variable.name] = self._unwritten(variable, sensor)
        return {
            group: xr.Dataset(
                arrays,
                self.coordinates(
                    group, sensor, {str(dim) for array in arrays.values() for dim in array.dims}
                ),
            )
            for (group, sensor), arrays in groups.items()
        }

    def _unwritten(self, variable: Variable, sensor: str) -> xr.Variable:
        dims = self.dims(variable.dims, sensor)
        shape = tuple(len(self.values[sensor][dim]) for dim in dims)
        lead = len(self.dims(variable.dims[: variable.whole], sensor))
        chunks = (1,) * lead + shape[lead:]
        attrs: dict[str, Any] = {"units": variable.units, "long_name": variable.long_name}
        if variable.group == PROFILES:
            attrs["receiver"] = self.receiver
        if variable.name == "expected" and self.receiver != "full_profile":
            attrs["long_name"] = "what the receiver reports of each IFOV's expected waveform"
        if variable.group in (STATUS, STATUS_INFRARED):
            attrs["flag_values"] = [MISSING, FAILED, DONE]
            attrs["flag_meanings"] = "missing failed done"
        if variable.step != 1:
            attrs["scale_factor"] = variable.step  # xarray then reads the integers as numbers
        # An unwritten chunk reads as its fill value, which xarray would leave at 0.
        encoding = {"chunks": chunks, "fill_value": variable.fill}
        unwritten = da.full(shape, variable.fill, dtype=variable.dtype, chunks=chunks)
        return xr.Variable(dims, unwritten, attrs, encoding)
