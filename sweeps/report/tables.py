"""The tables of a sweep as rows, ours beside the source's."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
import xarray as xr
import yaml

Row = dict[str, Any]

# Of axes in a table, the slowest first.
ORDER = (
    "range",
    "super_resolution",
    "pulse_width",
    "target_free_ifovs",
    "coverage_rule",
    "segmentation",
    "inner_radius",
    "interpolation",
    "learning_rate",
    "vigilance",
    "label_rule",
    "score_rule",
    "channel",
    "infrared_frame_count",
    "training",
    "gain_sigma",
    "left_out",
    "epochs",
    "grow_every",
    "mnn_learning_rate",
    "tolerance",
    "inputs",
    "annealing",
    "frame_count",
    "aspects",
    "least_rejected",
    "test_vigilance",
    "aspect_bin",
)


# What the source leaves open of its network: the first of each is shown on the screen.
RULES = ("label_rule", "score_rule")


def first_rules(rows: list[Row]) -> list[Row]:
    """Rows of the first rule for names, and the first for what is right."""
    shown: dict[str, object] = {}
    for row in rows:
        for name in RULES:
            if row.get(name) is not None:
                shown.setdefault(name, row[name])
    return [row for row in rows if all(row.get(name) in (None, shown.get(name)) for name in RULES)]


@lru_cache
def source_figures() -> dict[str, Any]:
    """Figures of the article."""
    text = files("sweeps.report").joinpath("source_figures.yaml").read_text(encoding="utf-8")
    figures: dict[str, Any] = yaml.safe_load(text)
    return figures


def has_source_views(tables: xr.Dataset) -> bool:
    """Whether a sweep has as many views as the article's: four ships, 31 aspects."""
    return bool((tables.view_count == source_figures()["experiment"]["views"]).all())


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
    formed = tables[["category_count", "view_count", "settled"]]
    # Categories form before they are named.
    for axes, cell in cells(formed.drop_vars(RULES, errors="ignore")):
        categories, views = cell["category_count"], cell["view_count"]
        rows.append(
            axes
            | {
                "categories": categories,
                "training_profiles": views,
                "compression": round(views / categories, 2) if categories else None,
                "settled": bool(cell["settled"]),
                "source_categories": source["categories"].get(axes["pulse_width_ns"])
                if axes["vigilance"] == source["vigilance"] and _as_in_source(axes, tables)
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
    lowest = dict(zip(tables.aspect_bin.values, tables.aspect_low.values.tolist(), strict=True))
    for prefix in ("training_", ""):
        names = [prefix + name for name in ("accuracy", "ci_low", "ci_high", "n")]
        for axes, cell in cells(tables[names]):
            frames = axes.pop("frame_count", None)
            label = axes.pop("aspect_bin")
            rules = {name: axes.pop(name, None) for name in RULES}
            fraction, low, high, n = (cell[name] for name in names)
            rows.append(
                axes
                | {
                    "profiles": "training" if prefix else "averaged",
                    **rules,
                    "frame_count": frames,
                    "aspect_bin_deg": label,
                    "percent_correct": percent(fraction),
                    "ci_low": percent(low),
                    "ci_high": percent(high),
                    "n": n,
                    "source_percent": _source_percent(axes, frames, lowest[label])
                    if _as_in_source(axes, tables)
                    else None,
                }
            )
    return rows


def _as_in_source(axes: Row, tables: xr.Dataset) -> bool:
    """Whether range and receiver are the article's; its ships and aspects are another matter."""
    experiment = source_figures()["experiment"]
    return bool(
        axes["range_km"] == experiment["range"]
        and tables.attrs["receiver"] == experiment["receiver"]
    )


def _source_percent(axes: Row, frames: int | None, lowest: float) -> int | None:
    """The article's figure for the bin whose lowest aspect is given (NaN for all of them)."""
    source = source_figures()["table4_percent_correct"]
    same = all(
        axes[ours] == source[theirs]
        for ours, theirs in (("vigilance", "vigilance"), ("pulse_width_ns", "pulse_width"))
    )
    figures = source["training"] if frames is None else source["frames"].get(frames)
    if not same or figures is None or not lowest <= 90:
        return None
    percent: int = figures[sum(lowest >= start for start in source["bin_starts"]) - 1]
    return percent


def cells(dataset: xr.Dataset, order: tuple[str, ...] = ORDER) -> Iterator[tuple[Row, Row]]:
    """Axes and values of every cell of a data set, units in the names of the axes."""
    names = {"pulse_width": "pulse_width_ns", "range": "range_km"}
    dims = [name for name in order if name in dataset.dims]
    scalars = {
        name: dataset[name].item()
        for name in order
        if name in dataset.coords and name not in dataset.dims
    }
    axes = [dataset[name].values.tolist() for name in dims]
    arrays = {name: array.transpose(*dims).values for name, array in dataset.items()}
    for index in np.ndindex(*(len(values) for values in axes)):
        here = scalars | {name: axes[i][index[i]] for i, name in enumerate(dims)}
        row = {names.get(name, name): here[name] for name in order if name in here}
        yield row, {str(name): array[index].item() for name, array in arrays.items()}


def percent(fraction: float) -> float | None:
    """A fraction in per cent, to a tenth; none of NaN."""
    return None if math.isnan(fraction) else round(100 * fraction, 1)
