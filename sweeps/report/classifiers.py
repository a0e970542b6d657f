"""All classifiers of range profiles side by side, and how far each is below the best possible."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr
from rich.console import Console

from sweeps.report.axes import Axis, printable, told
from sweeps.report.rows import (
    BIN,
    Row,
    axes_in,
    beside_source,
    grouped,
    score_rows,
    several,
    together,
)
from sweeps.report.screen import by_training, note, print_scores, settings
from sweeps.report.source import source_figures

TITLES = {
    "acn": "ACN",
    "mnn": "MNN, ship and aspect group",
    "mnn_ship": "MNN, ship alone",
    "correlation": "correlation",
    "likelihood": "maximum likelihood",
}
CELL = ("range", "target_free_ifovs", "pulse_width")  # told in every title
BOUND = "likelihood"


def names_profiles(table: xr.Dataset) -> bool:
    """Return whether a table scores a classifier of range profiles."""
    figures, axes = {"accuracy", "ci_low", "ci_high", "n"}, {*CELL, "frame_count", "aspect_low"}
    return figures <= set(table) and axes <= set(table.coords)


def classifier_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """Percent correct of every classifier, given its tables by name, in every setting.

    One row for each cell, number of frames (none for the profiles it was trained with) and aspect
    bin: percent correct with its interval, number of profiles, the source's figure, and by how many
    points it is below the bound.

    Notes
    -----
    The bound is maximum likelihood with the gain that is known least, the same for all rows and
    named in them, and with the true aspect left out where the row's classifier leaves it out.
    It names ships: what is right by category or aspect group, too, is another question. A
    likelihood that knows more of the gain lies above it, at points below 0.
    """
    parts = []
    for name, table in tables.items():
        for prefix, label in (("", name), ("ship_", f"{name}_ship"), ("training_", name)):
            if f"{prefix}accuracy" in table:
                rows = score_rows(table, prefix, label={"classifier": label})
                parts.append(beside_source(rows, table, label))
    rows = together(*parts)
    likelihoods = [row for row in rows if row["classifier"] == BOUND]
    gain = max((row["gain_sigma"] for row in likelihoods), default=None)
    place = several(likelihoods, but=("gain_sigma", "left_out"))
    bounds = {
        _place(row, place): row["percent_correct"]
        for row in likelihoods
        if row["gain_sigma"] == gain
    }
    for row in rows:
        bound, ours = bounds.get(_place(row, place)), row["percent_correct"]
        of_ships = row["classifier"] != "mnn" and row.get("score_rule") in (None, "ship")
        known = bound is not None and ours is not None and of_ships
        known = known and row.get("frame_count") is not None
        row["bound_gain_sigma"] = gain if known else None
        row["points_below_bound"] = round(bound - ours, 1) if known else None
    return rows


def _place(row: Row, axes: list[Axis]) -> tuple[object, ...]:
    """What a row shares with its bound; what learns every aspect has none left out."""
    return (*(row.get(axis) for axis in axes), bool(row.get("left_out")))


def print_classifiers(rows: list[Row], console: Console) -> None:
    """Print all classifiers by number of frames, one table a pulse width and range."""
    vigilance = _shown_vigilance(rows)
    printed = [row for row in rows if row.get("vigilance") in (None, vigilance)]
    tests = [row for row in printed if row["frame_count"] is not None]
    own = [axis for axis in axes_in(rows) if any(row[axis] is None for row in tests)]
    for place, group in settings(printed, CELL, but=(*own, "frame_count", BIN)):
        bounded = any(row["points_below_bound"] is not None for row in group)
        lines = []
        for (count,), part in by_training(grouped(group, ("frame_count",)).items()):
            every = grouped(part, ("classifier", *own))
            for number, line in enumerate(every.values()):
                first = "" if number else str(count or "training")
                lines.append(((first, _title(line[0], group, own)), line))
        print_scores(
            f"Percent correct by classifier ({place})",
            ("frames", "classifier"),
            lines,
            console,
            dim=("below\nbound",) * bounded,
            more=_below if bounded else None,
        )
    gains = {row["bound_gain_sigma"]: axis for axis in axes_in(rows) for row in rows}
    known = [gain for gain in gains if gain is not None]
    if known:
        (words,) = told({gain_axis(rows): max(known)}, [gain_axis(rows)])
        note(
            "Below bound: points that maximum likelihood with exact mean and covariance of every "
            f"view, {words}, has more, overall, without the true aspect where that "
            "is left out: the classifier's share of its errors. What it lacks to 100 is the "
            "noise's. It is the best on average; in a few views another may do better by chance.",
            console,
        )


def gain_axis(rows: list[Row]) -> Axis:
    """The axis that says how well the gain is known."""
    return next(axis for axis in axes_in(rows) if axis.name == "gain_sigma")


def _below(line: list[Row]) -> tuple[str]:
    """By how much a classifier is below the bound, overall."""
    below = line[-1]["points_below_bound"]
    return ("" if below is None or line[0]["classifier"] == BOUND else f"{below:.0f}",)


def _shown_vigilance(rows: list[Row]) -> float | None:
    """The source's vigilance if it is there, else the largest."""
    there = {row["vigilance"] for row in rows if row.get("vigilance") is not None}
    wanted: float = source_figures()["table4_percent_correct"]["vigilance"]
    return wanted if wanted in there else max(there, default=None)


def _title(row: Row, group: list[Row], own: list[Axis]) -> str:
    """The classifier, and what tells this setting from its others."""
    name = str(row["classifier"])
    same = [other for other in group if other["classifier"] == name]
    axes = [axis for axis in several(same) if axis in own]
    return ", ".join((TITLES.get(name, printable(name)), *told(row, axes)))
