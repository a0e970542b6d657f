"""Figures of the article, and which of them stand beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from typing import Any

import xarray as xr
import yaml

TABLES = {"acn": "table4", "mnn": "table2", "acn_infrared": "table5"}  # by what named the ships


@lru_cache
def source_figures() -> dict[str, Any]:
    """Figures of the article."""
    text = files("sweeps.report").joinpath("source_figures.yaml").read_text(encoding="utf-8")
    figures: dict[str, Any] = yaml.safe_load(text)
    return figures


def has_source_views(tables: xr.Dataset) -> bool:
    """Whether a sweep has as many views as the article's: four ships, 31 aspects."""
    return bool((tables.view_count == source_figures()["experiment"]["views"]).all())


def as_in_source(row: Mapping[str, Any]) -> bool:
    """Whether range and receiver are the article's; its ships and aspects are another matter."""
    experiment = source_figures()["experiment"]
    return (row.get("range_km"), row.get("receiver")) == (
        experiment["range"],
        experiment["receiver"],
    )


def source_percent(classifier: str, row: Mapping[str, Any], lowest: float) -> int | None:
    """The article's percent correct for a row, if it has one.

    Of the classifier that named the ships, for the bin whose lowest aspect [deg] is given, NaN for
    all of them; the row has its axes by column, and its `receiver`.
    """
    if classifier not in TABLES:
        return None
    table = source_figures()[f"{TABLES[classifier]}_percent_correct"]
    frames = row.get("frame_count")
    same = {"vigilance": "vigilance", "pulse_width": "pulse_width_ns", "frame_count": "frame_count"}
    if any(name in table and row.get(key) != table[name] for name, key in same.items()):
        return None
    if classifier == "acn_infrared":
        way, slant_range = row["super_resolution"], row["range_km"]
        if lowest != lowest:
            whole: int | None = table["overall"].get(way, {}).get(slant_range)
            return whole
        figures = table.get(way, {}).get(slant_range)
    elif not as_in_source(row):
        return None
    else:
        figures = table["training"] if frames is None else table["frames"].get(frames)
    if figures is None or not lowest <= 90:
        return None
    found: int = figures[sum(lowest >= start for start in table["bin_starts"]) - 1]
    return found
