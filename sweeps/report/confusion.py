"""Confusion: how often each ship is named each ship, as a frame."""

from __future__ import annotations

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


def confusion_of(store: Any) -> Frame | None:
    """Return the share of the answers to each true ship that name each ship; None without any."""
    parts = []
    for name in groups(store, "classification"):
        answers = read(store, f"classification/{name}")
        if "predicted" in answers and answers.predicted.size <= LARGEST:
            counted = _counted(answers.predicted.load())
            channel = "infrared" if name.endswith("_infrared") else "range"
            labels = {"classifier": name.removesuffix("_infrared"), "channel": channel}
            own = {key: text for key, text in labels.items() if key not in counted.coords}
            parts.append(tidy(counted, replace(DISPLAY, labels=own), ""))
    answered = [part for part in parts if part is not None]
    return stacked(answered) if answered else None


def _counted(predicted: xr.DataArray) -> xr.Dataset:
    """Return the answers of a group by true and named ship, counted over aspects and draws."""
    pooled = [dim for dim in predicted.dims if dim in (*DRAWS, "aspect")]
    ships = np.atleast_1d(predicted.ship.values).tolist()
    named = xr.DataArray(range(len(ships)), {"ship_named": ships}, ("ship_named",))
    counts = (predicted == named).sum(pooled).rename(ship="true_ship").reset_coords(drop=True)
    total = counts.sum("ship_named")
    return xr.Dataset({"share": counts / total.where(total > 0), "count": counts})
