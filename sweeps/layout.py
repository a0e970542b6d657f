"""The arrays of a sweep's store, with its axes: unwritten data sets by group."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import dask.array as da
import numpy as np
import xarray as xr

from ncti.irar import Window
from sweeps.axes import (
    AXES,
    ERRORS,
    FLIGHT_AXES,
    OF_CORRELATION,
    OF_LIKELIHOOD,
    OF_MNN,
    OF_SILHOUETTES,
    OPTIONAL,
    ROW_OF_FLIGHTS,
    WINDOW,
)
from sweeps.flight_schema import WITH_NULL
from sweeps.flight_variables import KINDS, MEASURED, SOURCES, VALIDATION
from sweeps.fusion import CHANNELS
from sweeps.infrared import ANGLE, RADIUS, image_windows
from sweeps.ladar import bin_centres, lags
from sweeps.schema import INFRARED, IRAR, RANGE, SweepConfig
from sweeps.stages import Ship
from sweeps.variables import (
    DONE,
    FAILED,
    IMAGES,
    MISSING,
    PROFILES,
    STATES,
    VARIABLES,
    Variable,
    owned,
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
    classifiers: tuple[str, ...]

    @classmethod
    def of(cls, config: SweepConfig, ships: tuple[Ship, ...], window: Window | None = None) -> Axes:
        """The axes of a checked configuration; of flights with the window of their images."""
        grid = config.grid.expand()
        infrared = config.infrared.expand(grid)
        windows = image_windows(infrared, config.infrared, config.scene)
        named = config.classifier.expand()
        shared = asdict(grid) | {
            "ship": tuple(ship.label for ship in ships),
            "learning_rate": named.learning_rate,
            "label_rule": named.label_rule,
            "score_rule": named.score_rule,
        }
        values = {
            RANGE: shared
            | {
                "target_free_ifovs": config.ladar.floor_axis(),
                "down_range": bin_centres(config.ladar),
                "lag": lags(config),
                "channel": CHANNELS,
                "super_resolution": infrared.super_resolution,
                **{name: getattr(infrared, name) for name in OF_SILHOUETTES},
                "infrared_frame_count": infrared.frame_count,
                "draw": range(max(len(grid.replicate), len(infrared.phase))),
                **{
                    axis: values
                    for axis, values in asdict(named).items()
                    if axis in (*OF_MNN, *OF_CORRELATION, *OF_LIKELIHOOD)
                },
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
        if window is not None:
            flights = asdict(config.irar.expand(grid.replicate))
            values[IRAR] = shared | {
                **flights,
                "error": range(len(flights["error"])),
                "errors": flights["error"],
                "vigilance": grid.vigilance,
                "classifier": config.classifiers,
                "down_range": bin_centres(config.ladar),
                "source": SOURCES,
                "kind": KINDS,
                "row": window.bottom + np.arange(window.rows),
                "column": window.left + np.arange(window.columns),
            }
        return cls(
            {sensor: values[sensor] for sensor in config.sensors},
            config.ladar.receiver,
            windows,
            config.classifiers,
        )

    def dims(self, names: tuple[str, ...], sensor: str) -> tuple[str, ...]:
        """Those names that are dimensions."""
        values = self.values[sensor]
        return tuple(name for name in names if name not in OPTIONAL or len(values[name]) > 1)

    def coordinates(self, group: str, sensor: str, dims: set[str]) -> dict[str, Any]:
        """Coordinates of a group, with units; an optional axis of one value is a scalar one."""
        values = self.values[sensor]
        coords: dict[str, Any] = {}
        for name, attrs in (AXES | FLIGHT_AXES).items():
            alone = name in values and name in OPTIONAL and len(values[name]) == 1
            if name in dims or (alone and name in owned(group)):
                array = np.asarray(values[name] if name in dims else values[name][0])
                array = array.astype(float) if name in WITH_NULL else array  # None: NaN
                # Strings as objects: fixed-width ones are no part of the zarr 3 format.
                array = array.astype(object) if array.dtype.kind == "U" else array
                coords[name] = ((name,) if name in dims else (), array, attrs)
        if group in (VALIDATION, MEASURED):
            for k, (name, attrs) in enumerate(ERRORS.items()):
                array = np.array([error[k] for error in values["errors"]])
                array = array.astype(object) if array.dtype.kind == "U" else array
                coords[name] = (
                    (("error",), array, attrs)
                    if "error" in dims
                    else ((), array.reshape(()), attrs)
                )
        if group == VALIDATION:
            coords["row"] = ("row", values["row"], ROW_OF_FLIGHTS)
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
            asked = variable.classifier is None or bool(
                set(self.classifiers) & {*np.atleast_1d(variable.classifier).tolist()}
            )
            if sensor in self.values and asked:
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
        if variable.group in STATES.values():
            attrs["flag_values"] = [MISSING, FAILED, DONE]
            attrs["flag_meanings"] = "missing failed done"
        if variable.step != 1:
            attrs["scale_factor"] = variable.step  # xarray then reads the integers as numbers
        # An unwritten chunk reads as its fill value, which xarray would leave at 0.
        encoding = {"chunks": chunks, "fill_value": variable.fill}
        unwritten = da.full(shape, variable.fill, dtype=variable.dtype, chunks=chunks)
        return xr.Variable(dims, unwritten, attrs, encoding)
