"""The tables of a sweep as rows, ours beside the source's."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files
from typing import Any

import xarray as xr
import yaml

Row = dict[str, Any]


@lru_cache
def source_figures() -> dict[str, Any]:
    """Figures of the article."""
    text = files("sweeps.report").joinpath("source_figures.yaml").read_text(encoding="utf-8")
    figures: dict[str, Any] = yaml.safe_load(text)
    return figures


def category_rows(tables: xr.Dataset) -> list[Row]:
    """Categories formed in each training (the article's Table 3).

    Parameters
    ----------
    tables : xarray.Dataset
        The store's table group.

    Returns
    -------
    list of dict
        One row a training: axes, categories, training profiles, their ratio, whether the
        categories settled, and the source's count where it has one.
    """
    source = source_figures()["table3_categories"]
    rows = []
    for axes, cell in _cells(tables[["category_count", "view_count", "settled"]]):
        categories, views = int(cell.category_count), int(cell.view_count)
        rows.append(
            axes
            | {
                "categories": categories,
                "training_profiles": views,
                "compression": round(views / categories, 2) if categories else None,
                "settled": bool(cell.settled),
                "source_categories": source["categories"].get(axes["pulse_width_ns"])
                if axes["vigilance"] == source["vigilance"]
                else None,
            }
        )
    return rows


def accuracy_rows(tables: xr.Dataset) -> list[Row]:
    """Percent correct by aspect bin (the article's Table 4), training profiles first.

    Parameters
    ----------
    tables : xarray.Dataset
        The store's table group.

    Returns
    -------
    list of dict
        One row for each aspect bin of a training or test: axes, which profiles, percent
        correct with its Wilson interval, number of profiles, and the source's figure.
    """
    rows = []
    for prefix in ("training_", ""):
        names = [prefix + name for name in ("accuracy", "ci_low", "ci_high", "n")]
        for axes, cell in _cells(tables[names]):
            frames = axes.pop("frame_count", None)
            label = axes.pop("aspect_bin")
            fraction, low, high, n = (cell[name].item() for name in names)
            rows.append(
                axes
                | {
                    "profiles": "training" if prefix else "averaged",
                    "frame_count": frames,
                    "aspect_bin_deg": label,
                    "percent_correct": _percent(fraction),
                    "ci_low": _percent(low),
                    "ci_high": _percent(high),
                    "n": int(n),
                    "source_percent": _source_percent(axes, frames, label),
                }
            )
    return rows


def _source_percent(axes: Row, frames: int | None, label: str) -> int | None:
    source = source_figures()["table4_percent_correct"]
    same = all(
        axes[ours] == source[theirs]
        for ours, theirs in (("vigilance", "vigilance"), ("pulse_width_ns", "pulse_width"))
    )
    figures = source["training"] if frames is None else source["frames"].get(frames)
    if not same or figures is None or label == "overall":
        return None
    lowest = float(label.split("-")[0])
    if lowest > 90:
        return None
    column = sum(lowest >= start for start in source["bin_starts"]) - 1
    percent: int = figures[column]
    return percent


def _cells(dataset: xr.Dataset) -> Iterator[tuple[Row, xr.Dataset]]:
    """Every cell of a data set with the values of its axes, units in their names."""
    names = {"pulse_width": "pulse_width_ns", "range": "range_km"}
    order = ["range", "pulse_width", "target_free_ifovs", "vigilance", "frame_count", "aspect_bin"]
    dims = [name for name in order if name in dataset.dims]
    scalars = {
        name: dataset[name].item()
        for name in order
        if name in dataset.coords and name not in dataset.dims
    }
    stacked = dataset.load().stack(cell=dims)
    for values, index in zip(stacked.indexes["cell"], range(stacked.sizes["cell"]), strict=True):
        axes = scalars | dict(zip(dims, values, strict=True))
        row = {names.get(name, name): axes[name] for name in order if name in axes}
        yield row, stacked.isel(cell=index)


def _percent(fraction: float) -> float | None:
    return None if math.isnan(fraction) else round(100 * fraction, 1)
