"""Charts of frames: one Vega-Lite specification each, whose rows and axis the page gives it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sweeps.report.frames import Column, Frame, values_of

SERIES = "series"  # field of the name of a curve
SHIFT = "shift"  # field of its offset [pixel], so that intervals stand side by side
ALONG, UP = 6, 30  # ratio of its ends from which an axis is logarithmic


def specification(frame: Frame, figure: str) -> dict[str, Any]:
    """Return the chart of a figure: a curve per series with intervals, and the chance level.

    The page adds the rows, with fields `series` and `shift`, and the axis `x`.
    """
    column = frame.columns[figure]
    low, high, chance = (
        next(iter(frame.of_role(r, figure)), "") for r in ("low", "high", "chance")
    )
    y: dict[str, Any] = {
        "field": figure,
        "type": "quantitative",
        "title": column.heading,
        "scale": scale_of(frame.rows[figure].dropna().tolist(), UP),
    }
    if column.unit == "%":
        y["scale"] = {"domain": [0, 100], "nice": False}
    shared = {
        "color": {"field": SERIES, "type": "nominal", "title": None, "scale": {"domain": []}},
        "opacity": {"condition": {"param": "picked", "value": 1}, "value": 0.08},
    }
    place = {"xOffset": {"expr": f"datum.{SHIFT}"}}
    layers: list[dict[str, Any]] = []
    if low and high:
        ends = {"y": {**y, "field": low}, "y2": {"field": high}}
        layers.append({"mark": {"type": "rule", **place}, "encoding": {**ends, **shared}})
    dashed: dict[str, Any] = {"field": SERIES, "title": None, "scale": {"domain": []}}
    line = {"y": y, "strokeDash": dashed, **shared}
    layers.append({"mark": {"type": "line", **place}, "encoding": line})
    picked = {"name": "picked", "select": {"type": "point", "fields": [SERIES]}, "bind": "legend"}
    zoom = {"name": "zoom", "select": "interval", "bind": "scales"}
    layers.append(
        {
            "mark": {"type": "point", "filled": True, "size": 45, "tooltip": {"content": "data"}},
            "encoding": {"y": y, "shape": {"field": SERIES, "legend": None}, **shared},
            "params": [picked, zoom],
        }
    )
    layers[-1]["mark"] |= place
    if chance:
        level = {"field": chance, "type": "quantitative", "aggregate": "max", "title": y["title"]}
        across = {"x": {"value": 0}, "x2": {"value": "width"}, "y": level}
        layers.append({"mark": {"type": "rule", "strokeDash": [2, 3]}, "encoding": across})
    return {
        "$schema": "https://vega.github.io/schema/vega-lite/v6.json",
        "height": 250,
        "layer": layers,
        "config": {"legend": {"orient": "bottom", "columns": 2, "labelLimit": 300}},
    }


def scale_of(values: Sequence[Any], span: float) -> dict[str, Any]:
    """Return the scale of some numbers: logarithmic if positive and of ends of a large ratio."""
    logarithmic = bool(values) and min(values) > 0 and max(values) > span * min(values)
    return {"type": "log"} if logarithmic else {"zero": False}


def axis_of(column: Column, frame: Frame) -> dict[str, Any]:
    """Return the encoding of an axis: of numbers a scale, of words their places."""
    values = [value for value in values_of(frame.rows, column.name) if value != "overall"]
    numeric = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    found: dict[str, Any] = {"field": column.name, "title": column.heading}
    if not numeric:
        return found | {"type": "nominal", "sort": values, "axis": {"labelAngle": 0}}
    ticks = {"values": values} if len(values) <= 8 else {"tickCount": 6}
    labels = {"labelExpr": "format(datum.value, '~g')", "labelOverlap": True}
    return found | {
        "type": "quantitative",
        "scale": {**scale_of(values, ALONG), "padding": 14, "nice": False},
        "axis": {**ticks, **labels},
    }
