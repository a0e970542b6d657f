"""Confusion matrix of ships, as a frame."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from ncti.evaluate.answers import DRAWS
from sweeps.engine.declare.display import Display, Figure
from sweeps.report.frames import HIDDEN_COORDS, Frame, stack_frames, tidy_frame
from sweeps.report.stores import list_groups, read_group

NAME = "confusion"
MAX_ANSWERS = 2_000_000  # answers that are counted
DISPLAY = Display(
    NAME,
    "Ships named, percent of the answers to each true ship",
    (Figure("share", percent=True, format=".0f", extra_columns={"answers": "count"}),),
    rows=("classifier", "channel", "true_ship"),
    columns="ship_named",
)


def read_predictions(store: Any) -> dict[str, xr.DataArray]:
    """Return each classifier's predictions, except those with too many answers to count."""
    predictions = {}
    for name in list_groups(store, "classification"):
        answers = read_group(store, f"classification/{name}")
        if "predicted" in answers and answers.predicted.size <= MAX_ANSWERS:
            predictions[name] = answers.predicted.load()
    return predictions


def confusion_frame(
    predictions: Mapping[str, xr.DataArray], frames: Mapping[str, Frame]
) -> Frame | None:
    """Return the share of each predicted ship among the answers to each true ship, or None.

    Rows take classifier and channel from the tables of scores of their group, among `frames`.
    """
    tables = [part for frame in frames.values() for part in frame.parts]
    labels = {part.group.removeprefix("tables/"): part.display.labels for part in tables}
    parts = []
    for name, predicted in predictions.items():
        counted = _count_answers(predicted)
        group_labels = labels.get(name) or {"classifier": name}
        label_names = {*DISPLAY.rows} - {*counted.coords}
        row_labels = {key: text for key, text in group_labels.items() if key in label_names}
        parts.append(tidy_frame(counted, replace(DISPLAY, labels=row_labels), ""))
    return stack_frames(parts) if parts else None


def most_confused(
    predictions: Mapping[str, xr.DataArray],
) -> tuple[tuple[str, str], float] | None:
    """Return the two ships most often confused with each other, and their worst aspect.

    Over all classifiers and settings, by the share of the answers to both. None if no pair is.
    """
    counts = [
        _count_predictions(predicted, ("ship", "aspect"))
        for predicted in predictions.values()
        if {"ship", "aspect"} <= {*predicted.dims}
    ]
    if not counts:
        return None
    pooled = xr.concat(counts, "group", join="outer", fill_value=0).sum("group")
    ships = pooled.ship_named.values.tolist()
    total = pooled.sel(true_ship=ships).transpose("true_ship", "ship_named", "aspect").values
    share = total / np.maximum(total.sum(axis=1, keepdims=True), 1)
    mutual = share + share.transpose(1, 0, 2)
    pair_share = np.triu(mutual.mean(axis=2), 1)
    first, second = np.unravel_index(pair_share.argmax(), pair_share.shape)
    if not pair_share[first, second] > 0:
        return None
    aspect = float(pooled.aspect.values[mutual[first, second].argmax()])
    return (str(ships[first]), str(ships[second])), aspect


def _count_answers(predicted: xr.DataArray) -> xr.Dataset:
    """Return counts of a group's answers by true and predicted ship, over aspects and draws."""
    dims = [dim for dim in predicted.dims if dim not in (*DRAWS, "aspect")]
    counts = _count_predictions(predicted, dims)
    along = {
        name: coordinate
        for name, coordinate in predicted.coords.items()
        if coordinate.ndim == 1 and name not in (*coordinate.dims, *HIDDEN_COORDS)
        if coordinate.dims[0] in counts.dims
    }
    counts = counts.assign_coords(along)
    total = counts.sum("ship_named")
    return xr.Dataset({"share": counts / total.where(total > 0), "count": counts})


def _count_predictions(predicted: xr.DataArray, dims: Sequence[Hashable]) -> xr.DataArray:
    """Return counts of each predicted ship along `dims`, which include the true ship."""
    ships = np.atleast_1d(predicted.ship.values).tolist()
    candidates = xr.DataArray(range(len(ships)), {"ship_named": ships}, ("ship_named",))
    pooled = [dim for dim in predicted.dims if dim not in dims]
    counts: xr.DataArray = (predicted == candidates).sum(pooled)
    return counts.rename(ship="true_ship").reset_coords(drop=True)
