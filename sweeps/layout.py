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

from sweeps.classifier_schema import CLASSIFIERS, WITH_MOMENTS
from sweeps.fusion import CHANNELS
from sweeps.infrared import ANGLE, RADIUS, STEPS, image_windows
from sweeps.schema import INFRARED, RANGE, SweepConfig
from sweeps.stages import Ship, bin_centres, lags

MISSING, FAILED, DONE = -1, 0, 1

PROFILES, ACN, STATUS = "range_profile", "classification/acn", "status"
IMAGES, ACN_INFRARED, STATUS_INFRARED = "infrared", "classification/acn_infrared", "status_infrared"
TABLES, TABLES_INFRARED, DETECTION, RECONSTRUCTION = (
    f"tables/{name}" for name in ("acn", "acn_infrared", "detection", "super_resolution")
)
# By the classifier's name: its answers, their states, its tables.
ANSWERS = {name: f"classification/{name}" for name in CLASSIFIERS}
STATES = {ACN: STATUS, ACN_INFRARED: STATUS_INFRARED} | {
    ANSWERS[name]: f"status_{name}" for name in CLASSIFIERS if name != "acn"
}
TABLES_OF = {name: f"tables/{name}" for name in CLASSIFIERS}
GROUPS = (
    *(PROFILES, STATUS, IMAGES, ACN_INFRARED, *ANSWERS.values(), *STATES.values()),
    *(TABLES_INFRARED, DETECTION, RECONSTRUCTION, *TABLES_OF.values()),
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
    "training": {"long_name": "what is learned: expected profiles, or other draws of noisy ones"},
    "gain_sigma": {"units": "1", "long_name": "prior standard deviation of the target's gain"},
    "left_out": {"units": "1", "long_name": "1 where nothing is learned of the true aspect"},
    "epochs": {"units": "1", "long_name": "presentations of the training profiles at most"},
    "grow_every": {"units": "1", "long_name": "presentations before another hidden node"},
    "mnn_learning_rate": {"units": "1", "long_name": "learning rate of the multilayered network"},
    "inputs": {"long_name": "what the multilayered network sees of a profile"},
    "annealing": {"units": "1", "long_name": "1 where gains are annealed"},
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
    "channel": {"long_name": "sensor that names the ship"},
    "infrared_frame_count": {"units": "1", "long_name": "infrared frames averaged"},
    "draw": {"units": "1", "long_name": "number of the pair of a replicate and a phase"},
    "radius": {"units": "1", "long_name": "place between inner (0) and outer (1) log radius"},
    "lag": {"units": "m", "long_name": "lag of a covariance, down-range"},
}

VIEW = ("ship", "aspect")
CELL = ("pulse_width", "range", "target_free_ifovs")
TEMPLATE = ("coverage_rule", "inner_radius", "interpolation")
CELL_INFRARED = ("coverage_rule", "segmentation", "inner_radius", "interpolation", "phase")
AVERAGE = ("replicate", "frame_count")
LOOK = ("range", "super_resolution", "frame_count")

# Dimensions only when they have several values; a single one is a scalar coordinate.
_OF_MNN = ("epochs", "grow_every", "mnn_learning_rate", "inputs", "annealing")
_OF_CORRELATION, _OF_LIKELIHOOD = ("training", "left_out"), ("gain_sigma", "left_out")
_OF_FUSION = ("channel", "super_resolution", "infrared_frame_count")
OPTIONAL = (
    *_OF_MNN,
    "training",
    *_OF_LIKELIHOOD,
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
    classifier: str | tuple[str, ...] | None = None  # None: there whoever names the ships


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


def _named(
    name: str,
    own: tuple[str, ...],
    *more: tuple[Any, ...],
    draws: tuple[str, ...] = AVERAGE,
) -> tuple[Variable, ...]:
    """What a classifier of range profiles answers, besides the Adaptive Clustering Network."""
    tested = (*CELL, *own, *draws, *VIEW)
    state = {"dtype": "i1", "fill": MISSING, "group": STATES[ANSWERS[name]]}
    return _variables(
        {
            "group": ANSWERS[name],
            "sensor": RANGE,
            "classifier": name,
            "whole": len(CELL),
            "fill": -1,
            "dtype": "i2",
        },
        ("predicted", tested, "ship named, as an index into the ship axis"),
        ("correct", tested, "1 where the answer is right", {"dtype": "i1"}),
        *more,
        ("cell", tested, f"state of a cell of {name}", state),
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
        {
            "group": group,
            "sensor": sensor,
            "classifier": "acn",
            "whole": whole,
            "fill": -1,
            "dtype": "i4",
        },
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
        (
            "covariance",
            (*VIEW, "pulse_width", "range", "target_free_ifovs", "lag", "down_range"),
            "covariance of one frame at this bin and the one a lag further",
            {"classifier": WITH_MOMENTS},
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
            {"group": STATUS, "sensor": RANGE, "whole": len(CELL), "classifier": "acn"},
        ),
        (
            "cell",
            (*_TRAINED_INFRARED, *LOOK, *VIEW),
            "state of a cell of the infrared channel",
            {
                "group": STATUS_INFRARED,
                "sensor": INFRARED,
                "whole": len(CELL_INFRARED),
                "classifier": "acn",
            },
        ),
    ),
    *_named(
        "mnn",
        _OF_MNN,
        (
            "predicted_bin",
            (*CELL, *_OF_MNN, *AVERAGE, *VIEW),
            "number of the aspect bin named",
        ),
        (
            "ship_correct",
            (*CELL, *_OF_MNN, *AVERAGE, *VIEW),
            "1 where the ship is right, whatever the aspect bin",
            {"dtype": "i1"},
        ),
        (
            "training_correct",
            (*CELL, *_OF_MNN, *VIEW),
            "1 where ship and aspect bin of the expected profile are right",
            {"dtype": "i1"},
        ),
        ("presentations", (*CELL, *_OF_MNN), "epochs trained", {"fill": 0, "dtype": "i4"}),
        ("hidden", (*CELL, *_OF_MNN), "hidden nodes", {"fill": 0}),
        (
            "loss",
            (*CELL, *_OF_MNN),
            "mean square error of the outputs at the end",
            {"fill": np.nan, "dtype": "f4"},
        ),
    ),
    *_named(
        "correlation",
        _OF_CORRELATION,
        (
            "similarity",
            (*CELL, *_OF_CORRELATION, *AVERAGE, *VIEW),
            "cosine to the most similar profile learned",
            {"fill": np.nan, "dtype": "f4"},
        ),
    ),
    *_named(
        "fusion",
        _OF_FUSION,
        (
            "probability",
            (*CELL, *_OF_FUSION, "draw", "frame_count", *VIEW),
            "posterior probability of the true ship",
            {"fill": np.nan, "dtype": "f4"},
        ),
        (
            "sharpness",
            (*CELL, *_OF_FUSION, "draw", "frame_count"),
            "what a step of a sensor's score is worth in log-probability",
            {"fill": np.nan, "dtype": "f4"},
        ),
        draws=("draw", "frame_count"),
    ),
    *_named(
        "likelihood",
        _OF_LIKELIHOOD,
        (
            "probability",
            (*CELL, *_OF_LIKELIHOOD, *AVERAGE, *VIEW),
            "posterior probability of the true ship",
            {"fill": np.nan, "dtype": "f4"},
        ),
    ),
)


def owned(group: str) -> set[str]:
    """Optional axes of the variables of a group, whether they have several values or one."""
    return {
        dim
        for variable in VARIABLES
        if variable.group == group
        for dim in variable.dims
        if dim in OPTIONAL
    }


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
    def of(cls, config: SweepConfig, ships: tuple[Ship, ...]) -> Axes:
        """The axes of a checked configuration."""
        grid = config.grid.expand()
        infrared = config.infrared.expand(grid)
        windows = image_windows(infrared, config.infrared, config.scene)
        named = config.classifier.expand()
        shared = asdict(grid) | {
            "ship": tuple(ship.label for ship in ships),
            "learning_rate": named.learning_rate,
        }
        values = {
            RANGE: shared
            | {
                "target_free_ifovs": config.ladar.floor_axis(),
                "down_range": bin_centres(config.ladar),
                "lag": lags(config),
                "channel": CHANNELS,
                "super_resolution": infrared.super_resolution,
                "infrared_frame_count": infrared.frame_count,
                "draw": range(max(len(grid.replicate), len(infrared.phase))),
                **{
                    axis: values
                    for axis, values in asdict(named).items()
                    if axis in (*_OF_MNN, *_OF_CORRELATION, *_OF_LIKELIHOOD)
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
        return cls(
            {sensor: values[sensor] for sensor in config.sensors},
            config.ladar.receiver,
            windows,
            named.name,
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
            alone = name in values and name in OPTIONAL and len(values[name]) == 1
            if name in dims or (alone and name in owned(group)):
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
