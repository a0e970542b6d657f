"""Confusion: how often each ship is named each ship, as a frame."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from sweeps.engine.declare.display import Display, Figure
from sweeps.report.frames import DRAWS, Frame, stacked, tidy
from sweeps.report.stores import groups, read

NAME = "confusion"
LARGEST = 2_000_000  # answers that are counted
DISPLAY = Display(
    NAME,
    "Ships named, percent of the answers to each true ship",
    (Figure("share", percent=True, format=".0f", beside={"answers": "count"}),),
    rows=("classifier", "channel", "true_ship"),
    columns="ship_named",
)


def read_predictions(store: Any) -> dict[str, xr.DataArray]:
    """Return the ships named by each classifier of a store, unless these are too many to count."""
    found = {}
    for name in groups(store, "classification"):
        answers = read(store, f"classification/{name}")
        if "predicted" in answers and answers.predicted.size <= LARGEST:
            found[name] = answers.predicted.load()
    return found


def confusion_of(
    predictions: Mapping[str, xr.DataArray], frames: Mapping[str, Frame]
) -> Frame | None:
    """Return the share of the answers to each true ship that name each ship; None without any.

    Rows have the classifier and channel of the tables of a group's scores, among the `frames`.
    """
    tables = [part for frame in frames.values() for part in frame.parts]
    labels = {part.group.removeprefix("tables/"): part.display.labels for part in tables}
    parts = []
    for name, predicted in predictions.items():
        counted = _counted(predicted)
        given = labels.get(name) or {"classifier": name}
        kept = {*DISPLAY.rows} - {*counted.coords}
        own = {key: text for key, text in given.items() if key in kept}
        parts.append(tidy(counted, replace(DISPLAY, labels=own), ""))
    answered = [part for part in parts if part is not None]
    return stacked(answered) if answered else None


def most_confused(
    predictions: Mapping[str, xr.DataArray],
) -> tuple[tuple[str, str], float] | None:
    """Return the two ships that are named each other most often, and the aspect where most so.

    Over all classifiers and settings, by the share of the answers to both. None without any.
    """
    counts = [
        _named(predicted, ("ship", "aspect"))
        for predicted in predictions.values()
        if {"ship", "aspect"} <= {*predicted.dims}
    ]
    if not counts:
        return None
    whole = xr.concat(counts, "group", join="outer", fill_value=0).sum("group")
    ships = whole.ship_named.values.tolist()
    total = whole.sel(true_ship=ships).transpose("true_ship", "ship_named", "aspect").values
    share = total / np.maximum(total.sum(axis=1, keepdims=True), 1)
    mutual = share + share.transpose(1, 0, 2)
    over = np.triu(mutual.mean(axis=2), 1)
    one, other = np.unravel_index(over.argmax(), over.shape)
    if not over[one, other] > 0:
        return None
    aspect = float(whole.aspect.values[mutual[one, other].argmax()])
    return (str(ships[one]), str(ships[other])), aspect


def _counted(predicted: xr.DataArray) -> xr.Dataset:
    """Return the answers of a group by true and named ship, counted over aspects and draws."""
    kept = [dim for dim in predicted.dims if dim not in (*DRAWS, "aspect")]
    counts = _named(predicted, kept)
    total = counts.sum("ship_named")
    return xr.Dataset({"share": counts / total.where(total > 0), "count": counts})


def _named(predicted: xr.DataArray, kept: Sequence[Hashable]) -> xr.DataArray:
    """Return how often each ship is named, with the true ship among the dimensions kept."""
    ships = np.atleast_1d(predicted.ship.values).tolist()
    named = xr.DataArray(range(len(ships)), {"ship_named": ships}, ("ship_named",))
    pooled = [dim for dim in predicted.dims if dim not in kept]
    counts: xr.DataArray = (predicted == named).sum(pooled)
    return counts.rename(ship="true_ship").reset_coords(drop=True)
