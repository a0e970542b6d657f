"""Scales of charts, of a figure and along an axis, in the terms of Vega-Lite.

The page's script, `page/templates/charts.js`, adds the rows at the selection.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sweeps.report.frames import Column, Frame, values_of
from sweeps.report.words import OVERALL, is_number

LOG_RATIO_ALONG, LOG_RATIO_UP = 6, 30  # ratio of its ends from which an axis is logarithmic
EDGE_PADDING = 6  # pixels between the ends of a bounded scale and the frame, for markers


def figure_of(frame: Frame, figure: str) -> dict[str, Any]:
    """Return the encoding of a figure, and the columns of its interval and its level of chance."""
    column = frame.columns[figure]
    y: dict[str, Any] = {"field": figure, "type": "quantitative", "title": column.heading}
    values = frame.rows[figure].dropna().tolist()
    bound = 1 if column.format.endswith("%") else 100 if column.unit == "%" else 0
    difference = column.format.startswith("+")  # may be below 0, where its chart has a line
    if bound and not difference:
        y["scale"] = {"domain": [0, bound], "nice": False, "padding": EDGE_PADDING}
    else:
        y["scale"] = {"zero": True} if difference else scale_of(values, LOG_RATIO_UP)
    if bound == 1:
        y["axis"] = {"format": ".0%"}
    # Python's and d3's formats are the same, but for the digits of `g`.
    text = ".3~g" if column.format.endswith("g") else column.format
    related = frame.related_columns(figure)
    return {"y": y, "format": text, "difference": difference, **related}


def axis_of(column: Column, frame: Frame) -> dict[str, Any]:
    """Return the encoding of an axis: a scale for numbers, positions for bins and words.

    Values are joined by lines along bins (ordinal), but not along words (nominal).
    """
    values = [value for value in values_of(frame.rows, column.name) if value != OVERALL]
    encoding: dict[str, Any] = {"field": column.name, "title": column.heading}
    if not all(map(is_number, values)):
        bins = all(column.text(value)[:1].isdigit() for value in values)
        kind = "ordinal" if bins else "nominal"
        return encoding | {"type": kind, "sort": values, "axis": {"labelAngle": 0}}
    ticks = {"values": values} if len(values) <= 8 else {"tickCount": 6}
    labels = {"labelExpr": "format(datum.value, '~g')", "labelOverlap": True}
    return encoding | {
        "type": "quantitative",
        "scale": {**scale_of(values, LOG_RATIO_ALONG), "padding": 22, "nice": False},
        "axis": {**ticks, **labels},
    }


def scale_of(values: Sequence[Any], span: float) -> dict[str, Any]:
    """Return the scale of some numbers: logarithmic if positive with a ratio above `span`."""
    logarithmic = bool(values) and min(values) > 0 and max(values) > span * min(values)
    return {"type": "log"} if logarithmic else {"zero": False}
