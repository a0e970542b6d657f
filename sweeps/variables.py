"""What a store holds: its groups, its variables, their axes and chunks.

    range_profile                expected, averaged
    infrared                     image, log_polar, template_log_polar, ...
    classification/acn           training_category, training_correct, category, predicted, ...
    classification/acn_infrared  the same of silhouettes, training_confused
    status                       view, cell
    status_infrared              cell
    validation, ...              see `sweeps.flight_variables`
    tables/...                   see `sweeps.tabulation`

Dimensions carry the names of the grid axes. A chunk belongs to one task: the first axes of a
variable, `whole` of them, are cut at every value, and the others are not cut. The sensors have
groups of their own, since each may have its own ranges and vigilances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sweeps.axes import (
    AVERAGE,
    CELL,
    CELL_INFRARED,
    LOOK,
    OF_CORRELATION,
    OF_FUSION,
    OF_LIKELIHOOD,
    OF_MNN,
    OPTIONAL,
    TEMPLATE,
    VIEW,
)
from sweeps.classifier_schema import CLASSIFIERS, WITH_MOMENTS
from sweeps.flight_variables import (
    ANSWER,
    CELL_MEASURED,
    FLIGHT_GROUPS,
    MEASURED,
    OF_ANSWERS,
    OF_VIEWS,
    STATUS_MEASURED,
    VALIDATION,
)
from sweeps.infrared import STEPS
from sweeps.schema import INFRARED, IRAR, RANGE

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
STATES[MEASURED] = STATUS_MEASURED
REJECTION = {  # by the classifier's name: its answers, its table of rejections
    "acn": ("classification/acn", "tables/rejection_acn"),
    "correlation": ("classification/correlation", "tables/rejection_correlation"),
    "acn_infrared": ("classification/acn_infrared", "tables/rejection_acn_infrared"),
}
TABLES_OF = {name: f"tables/{name}" for name in CLASSIFIERS}
GROUPS = (
    *(PROFILES, STATUS, IMAGES, ACN_INFRARED, *ANSWERS.values(), *STATES.values()),
    *(TABLES_INFRARED, DETECTION, RECONSTRUCTION, *TABLES_OF.values()),
    *(table for _, table in REJECTION.values()),
    *FLIGHT_GROUPS,
)


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
_RULES = ("label_rule", "score_rule")
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
            (*trained, "label_rule", *VIEW),
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
            "similarity",
            (*tested, *VIEW),
            "cosine to that category",
            {"fill": np.nan, "dtype": "f4"},
        ),
        (
            "predicted",
            (*trained, "label_rule", *tested[len(trained) :], *VIEW),
            "ship named, as an index into the ship axis",
            {"dtype": "i2"},
        ),
        (
            "correct",
            (*trained, *_RULES, *tested[len(trained) :], *VIEW),
            "1 where the answer is right",
            {"dtype": "i1"},
        ),
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
            (*_TRAINED, *_RULES, *AVERAGE, *VIEW),
            "state of a cell of the grid",
            {"group": STATUS, "sensor": RANGE, "whole": len(CELL), "classifier": "acn"},
        ),
        (
            "cell",
            (*_TRAINED_INFRARED, *_RULES, *LOOK, *VIEW),
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
        OF_MNN,
        (
            "predicted_bin",
            (*CELL, *OF_MNN, *AVERAGE, *VIEW),
            "number of the aspect bin named",
        ),
        (
            "ship_correct",
            (*CELL, *OF_MNN, *AVERAGE, *VIEW),
            "1 where the ship is right, whatever the aspect bin",
            {"dtype": "i1"},
        ),
        (
            "training_correct",
            (*CELL, *OF_MNN, *VIEW),
            "1 where ship and aspect bin of the expected profile are right",
            {"dtype": "i1"},
        ),
        ("presentations", (*CELL, *OF_MNN), "epochs trained", {"fill": 0, "dtype": "i4"}),
        ("hidden", (*CELL, *OF_MNN), "hidden nodes", {"fill": 0}),
        (
            "loss",
            (*CELL, *OF_MNN),
            "mean square error of the outputs at the end",
            {"fill": np.nan, "dtype": "f4"},
        ),
    ),
    *_named(
        "correlation",
        OF_CORRELATION,
        (
            "similarity",
            (*CELL, *OF_CORRELATION, *AVERAGE, *VIEW),
            "cosine to the most similar profile learned",
            {"fill": np.nan, "dtype": "f4"},
        ),
    ),
    *_named(
        "fusion",
        OF_FUSION,
        (
            "probability",
            (*CELL, *OF_FUSION, "draw", "frame_count", *VIEW),
            "posterior probability of the true ship",
            {"fill": np.nan, "dtype": "f4"},
        ),
        (
            "sharpness",
            (*CELL, *OF_FUSION, "draw", "frame_count"),
            "what a step of a sensor's score is worth in log-probability",
            {"fill": np.nan, "dtype": "f4"},
        ),
        draws=("draw", "frame_count"),
    ),
    *_named(
        "likelihood",
        OF_LIKELIHOOD,
        (
            "probability",
            (*CELL, *OF_LIKELIHOOD, *AVERAGE, *VIEW),
            "posterior probability of the true ship",
            {"fill": np.nan, "dtype": "f4"},
        ),
    ),
    *_variables(_PROFILE | {"group": VALIDATION, "sensor": IRAR}, *OF_VIEWS),
    *_variables(
        {"group": MEASURED, "sensor": IRAR, "whole": len(CELL_MEASURED), "fill": -1, "dtype": "i2"},
        *OF_ANSWERS,
        (
            "cell",
            ANSWER,
            "state of a cell of measured profiles",
            _STATE | {"group": STATUS_MEASURED},
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
