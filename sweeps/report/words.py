"""Names, units and values as people read them, and the values that are shown first."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import pandas as pd

from ncti.text import printable

NOTHING = "–"  # for a missing figure
FILE_UNITS = {"degree": "deg", "m s-1": "m_s", "1": "", "pixel": "", "%": "percent"}
PRINTED_UNITS = {"degree": "°", "urad": "µrad", "1": ""}
UNITS = {"aspect_bin": "degree"}  # of pooled aspects, whose values are words

# Printed names of classifiers and sensors, which have short names in the configuration.
WORDS = {
    **{"acn": "ACN", "mnn": "MNN", "likelihood": "maximum likelihood", "fusion": "fusion"},
    **{"pca_qda": "PCA with QDA", "mlp": "MLP", "cnn": "CNN"},
    **{"range": "range profile", "infrared": "silhouette", "both": "both sensors"},
}
WORD_AXES = ("classifier", "channel")
ABBREVIATIONS = ("cnr", "ifov", "nedt")  # in names of axes

# From the simplest: of equals a headline names the first.
SIMPLEST = (
    *("correlation", "acn", "pca_qda", "likelihood", "random_forest", "gradient_boosting"),
    *("mnn", "mlp", "cnn", "fusion"),
    *("range", "infrared", "both"),
)

OVERALL = "overall"  # bin of all aspects

# Value of an axis that is shown first: the article's, or the nominal one; else the first.
MAIN: dict[str, Any] = {
    **{"range": 100.0, "pulse_width": 30.0, "vigilance": 0.95, "frame_count": 16},
    **{"infrared_frame_count": 16, "super_resolution": "none", "gain_sigma": 1.0, "cnr": 32.0},
    **{"label_rule": "majority", "score_rule": "ship", "training": "expected", "left_out": False},
    **{"aspects": "random", "learn_in_test": False, "inputs": "standardised", "annealing": True},
    **{"coverage_rule": 0.25, "inner_radius": 0.5, "segmentation": "matched"},
    **{"interpolation": "nearest", "learning_rate": 0.1, "target_free_ifovs": 4000},
    **{"transom_gain": 1.0, "mast_gain": 1.0, "error_parameter": "none", "autofocus": False},
    **{"split": "aspect-random", "fitted": "all", "fleet": 4},
    **{"chain": "exact", "azimuth": "pixel", "mirror": "exact", "range_filter": "cluster"},
    "kind": ("measured", "test"),
    **{"aspect_bin": OVERALL, "channel": "both", "aspect": 175.0, "source": "measured"},
}


def words_of(name: str) -> str:
    """Return the name of an axis as people write it."""
    words = printable(name.replace("_", " ")).split(" ")
    return " ".join(word.upper() if word in ABBREVIATIONS else word for word in words)


def file_name(name: str, units: str) -> str:
    """Return the name of a column with its unit, such as `range_km`."""
    unit = FILE_UNITS.get(units)
    if unit is None:
        unit = re.sub(r"[^a-z0-9]+", "_", re.sub(r" (\w+)-1\b", r"_per_\1", units.lower()))
    return f"{name}_{unit.strip('_')}" if unit.strip("_") else name


def unit_of(units: str) -> str:
    """Return a unit as printed; empty if there is none."""
    return PRINTED_UNITS.get(units, re.sub(r" (\w+)-1\b", r"/\1", printable(units)))


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, in the plural if need be."""
    return f"{number:,} {noun}" + "s" * (number != 1)


def is_missing(value: Any) -> bool:
    """Return whether a value of a frame is absent."""
    return value is None or value is pd.NA or bool(value != value)


def is_number(value: Any) -> bool:
    """Return whether a value is a number, not a boolean."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def value_text(value: Any, format: str = "g") -> str:
    """Return a value as printed, floats by a format."""
    if is_missing(value):
        return NOTHING
    if isinstance(value, bool) or type(value).__name__ == "bool":
        return "yes" if value else "no"
    if isinstance(value, float) and math.isfinite(value):
        return format_number(value, format)
    return printable(str(value)).replace("_", " ")


def format_number(value: float, format: str) -> str:
    """Return a formatted number: small whole numbers in full, and never a negative zero."""
    if format == ".4g" and value.is_integer() and abs(value) < 10_000:
        return str(int(value))
    text = f"{value:{format}}"
    return text.lstrip("-") if not text.strip("-0.%") else text


def preferred_value(name: str, values: Sequence[Any]) -> Any:
    """Return the value of an axis to show first: the main one, the nearest number, or the first."""
    main = MAIN.get(name)
    for choice in main if isinstance(main, tuple) else (main,):
        if choice in values:
            return choice
    if all(map(is_number, (main, *values))):
        return min(values, key=lambda value: (abs(value - main), value))
    return values[0]
