"""Confusion: how often each ship is named each ship, as a frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from sweeps.engine.display import Display
from sweeps.report.frames import DRAWS, PART, Column, Frame, Part, column_of_axis
from sweeps.report.stores import groups, read

TRUE, NAMED, NAME = "true_ship", "ship_named", "confusion"
LARGEST = 2_000_000  # answers that are counted


def confusion_of(store: Any) -> Frame | None:
    """Return the share of the answers to each true ship that name each ship; None without any."""
    tables = []
    for name in groups(store, "classification"):
        answers = read(store, f"classification/{name}")
        if "predicted" in answers and answers.predicted.size <= LARGEST:
            tables.append(_counted(answers[["predicted"]].load(), name))
    if not tables:
        return None
    columns = {name: column for _, found in tables for name, column in found.items()}
    figures = [name for name in columns if columns[name].role != "axis"]
    order = [name for name in columns if name not in (*figures, NAMED)] + [NAMED, *figures]
    rows = pd.concat(
        [table.assign(**{PART: k}) for k, (table, _) in enumerate(tables)], ignore_index=True
    )
    parts = tuple(Part("", Display(NAME, ""), {}, {}, {}) for _ in tables)
    return Frame(
        NAME,
        "Ships named, percent of the answers to each true ship",
        rows[[*order, PART]],
        {name: columns[name] for name in order},
        parts,
        down=("classifier", "channel", TRUE),
        across=NAMED,
    )


def _counted(answers: xr.Dataset, name: str) -> tuple[pd.DataFrame, dict[str, Column]]:
    """Return the answers of a group counted over aspects and draws, a row per pair of ships."""
    predicted = answers.predicted
    pooled = [dim for dim in predicted.dims if dim in (*DRAWS, "aspect")]
    ships = np.atleast_1d(answers.ship.values).tolist()
    counts = xr.concat(
        [(predicted == k).sum(pooled) for k in range(len(ships))],
        xr.DataArray(ships, dims=NAMED, name=NAMED),
    )
    counts = counts.rename("count").rename({"ship": TRUE})
    counts = counts.drop_vars([c for c in counts.coords if c not in counts.dims])
    rows = counts.to_dataframe().reset_index()
    total = counts.sum(NAMED)
    share = (100 * counts / total.where(total > 0)).rename("share")
    rows["share"] = share.to_dataframe().reset_index()["share"].to_numpy()
    columns = {"classifier": Column("classifier", "classifier", "classifier")}
    columns["channel"] = Column("channel", "channel", "channel")
    rows["classifier"] = (
        name.removesuffix("_infrared") if "classifier" not in rows else rows.classifier
    )
    if "channel" not in rows:
        rows["channel"] = "infrared" if name.endswith("_infrared") else "range"
    for dim in counts.dims:
        if str(dim) not in columns:
            column = column_of_axis(counts.to_dataset(), str(dim))
            columns[column.name] = column
            rows = rows.rename(columns={str(dim): column.name})
    columns["share"] = Column("share", "share", "share", "%", role="figure", format=".0f")
    columns["count"] = Column("count", "share", "answers", role="beside")
    return rows, columns
