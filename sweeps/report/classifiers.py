"""All classifiers of range profiles side by side, and how far each is below the best possible."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import xarray as xr
from rich.console import Console
from rich.table import Table

from sweeps.report.screen import WIDTH, grouped, percent_text
from sweeps.report.tables import Row, cells, percent, source_figures

# Axes of a setting of some classifier, and what to call them in a line of a table.
SETTINGS = {
    "vigilance": "vigilance {:g}",
    "learning_rate": "learning rate {:g}",
    "label_rule": "named by its {} members",
    "score_rule": "right by {}",
    "training": "learned from {} profiles",
    "gain_sigma": "",  # see gain_text
    "left_out": "true aspect left out",
    "epochs": "{:g} epochs",
    "grow_every": "a node every {:g} epochs",
    "mnn_learning_rate": "learning rate {:g}",
    "tolerance": "to an error of {:g}",
    "inputs": "{} inputs",
    "annealing": "annealed",
}
TITLES = {
    "acn": "ACN",
    "mnn": "MNN, ship and aspect group",
    "mnn_ship": "MNN, ship alone",
    "correlation": "correlation",
    "likelihood": "maximum likelihood",
}
CELL = ("range_km", "pulse_width_ns", "target_free_ifovs")
BOUND = "likelihood"


def classifier_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """Percent correct of every classifier in every setting.

    Parameters
    ----------
    tables : mapping of str to xarray.Dataset
        The store's table groups by the classifier's name.

    Returns
    -------
    list of dict
        One row for each classifier, setting, cell, number of frames (none for the profiles it
        was trained with) and aspect bin: percent correct with its interval, number of profiles,
        the source's figure, and by how many points it is below the bound.

    Notes
    -----
    The bound is maximum likelihood with the gain that is known least, the same for all rows and
    named in them, and with the true aspect left out where the row's classifier leaves it out.
    It names ships: what is right by category or aspect group, too, is another question. A
    likelihood that knows more of the gain lies above it, at points below 0.
    """
    rows: list[Row] = []
    for name, table in tables.items():
        kinds = [(name, "")] + [(f"{name}_ship", "ship_")] * ("ship_accuracy" in table)
        kinds += [(name, "training_")] * ("training_accuracy" in table)
        lowest = dict(zip(table.aspect_bin.values, table.aspect_low.values.tolist(), strict=True))
        for label, prefix in kinds:
            names = [prefix + part for part in ("accuracy", "ci_low", "ci_high", "n")]
            for axes, cell in cells(table[names]):
                fraction, low, high, n = (cell[part] for part in names)
                rows.append(
                    {"classifier": label}
                    | {key: axes.get(key) for key in (*CELL, *SETTINGS)}
                    | {
                        "frame_count": axes.get("frame_count"),
                        "aspect_bin_deg": axes["aspect_bin"],
                        "percent_correct": percent(fraction),
                        "ci_low": percent(low),
                        "ci_high": percent(high),
                        "n": n,
                        "source_percent": source_percent(
                            label, axes, lowest[axes["aspect_bin"]], table.attrs["receiver"]
                        ),
                    }
                )
    likelihoods = [row for row in rows if row["classifier"] == BOUND]
    gain = max((row["gain_sigma"] for row in likelihoods), default=None)
    bounds = {
        _place(row): row["percent_correct"] for row in likelihoods if row["gain_sigma"] == gain
    }
    for row in rows:
        bound, ours = bounds.get(_place(row)), row["percent_correct"]
        of_ships = row["classifier"] != "mnn" and row["score_rule"] in (None, "ship")
        known = bound is not None and ours is not None and of_ships
        row["bound_gain_sigma"] = gain if known else None
        row["points_below_bound"] = round(bound - ours, 1) if known else None
    return rows


def source_percent(classifier: str, axes: Row, lowest: float, receiver: str) -> int | None:
    """The article's figure for a classifier's aspect bin, given by its lowest aspect."""
    figures = source_figures()
    table: dict[str, Any] = {
        "acn": figures["table4_percent_correct"],
        "mnn": figures["table2_percent_correct"],
    }.get(classifier, {})
    there = (
        axes["range_km"] == figures["experiment"]["range"]
        and receiver == figures["experiment"]["receiver"]
        and axes["pulse_width_ns"] == table.get("pulse_width")
        and axes.get("vigilance") == table.get("vigilance")
    )
    frames = axes.get("frame_count")
    tested = table.get("frames", {})
    row = (table.get("training") if frames is None else tested.get(frames)) if there else None
    if row is None or not lowest <= 90:
        return None
    found: int = row[sum(lowest >= start for start in table["bin_starts"]) - 1]
    return found


def print_classifiers(rows: list[Row], console: Console) -> None:
    """Print all classifiers by number of frames, one table a pulse width and range."""
    console.width = max(console.width, WIDTH)
    shown = [row for row in rows if row["vigilance"] in (None, _shown_vigilance(rows))]
    for (slant_range, pulse_width, floor), group in grouped(shown, CELL).items():
        bins = list(dict.fromkeys(row["aspect_bin_deg"] for row in group))
        place = f"{slant_range:g} km, {floor} target-free IFOVs, {pulse_width:g} ns"
        table = Table(title=f"Percent correct by classifier ({place})")
        table.add_column("frames", justify="right")
        table.add_column("classifier")
        for label in bins:
            table.add_column(label if label == "overall" else f"{label}°", justify="right")
        bounded = any(row["points_below_bound"] is not None for row in group)
        if bounded:
            table.add_column("below\nbound", justify="right", style="dim")
        own = _several(group)
        # Training first, as of endless frames.
        counts = sorted(
            {row["frame_count"] for row in group}, key=lambda n: n or math.inf, reverse=True
        )
        for count in counts:
            lines = grouped(
                [row for row in group if row["frame_count"] == count],
                ("classifier", *SETTINGS),
            )
            for number, (key, line) in enumerate(lines.items()):
                found = {row["aspect_bin_deg"]: row for row in line}
                below = found[bins[-1]]["points_below_bound"]
                table.add_row(
                    "" if number else str(count or "training"),
                    _title(str(key[0]), line[0], own),
                    *(percent_text(found[label]) for label in bins),
                    *(["" if below is None or key[0] == BOUND else f"{below:.0f}"] * bounded),
                )
                theirs = [found[label]["source_percent"] for label in bins]
                if any(figure is not None for figure in theirs):
                    figures = ("" if figure is None else str(figure) for figure in theirs)
                    table.add_row("", "  source", *figures, style="dim")
            table.add_section()
        console.print(table)
    gains = {row["bound_gain_sigma"] for row in rows} - {None}
    if gains:
        console.print(
            "Below bound: points that maximum likelihood with exact mean and covariance of every "
            f"view, {gain_text(max(gains))}, has more, overall, without the true aspect where that "
            "is left out: the classifier's share of its errors. What it lacks to 100 is the "
            "noise's. It is the best on average; in a few views another may do better by chance.",
            style="dim",
        )


def _place(row: Row) -> tuple[object, ...]:
    """What a row shares with its bound; what learns every aspect has none left out."""
    here = tuple(row[key] for key in (*CELL, "frame_count", "aspect_bin_deg"))
    return (*here, bool(row["left_out"]))


def _shown_vigilance(rows: list[Row]) -> float | None:
    """The source's vigilance if it is there, else the largest."""
    there = {row["vigilance"] for row in rows if row["vigilance"] is not None}
    wanted: float = source_figures()["table4_percent_correct"]["vigilance"]
    return wanted if wanted in there else max(there, default=None)


def _several(rows: list[Row]) -> dict[str, list[str]]:
    """Settings of each classifier that its rows do not all share."""
    return {
        str(name): [key for key in SETTINGS if len({row[key] for row in group}) > 1]
        for (name,), group in grouped(rows, ("classifier",)).items()
    }


def _title(name: str, row: Row, own: Mapping[str, list[str]]) -> str:
    """The classifier and what tells this setting from its others."""
    parts = [TITLES[name]]
    for key in own[name]:
        value = row[key]
        if value is None:  # of what it was trained with, which no rule scores
            continue
        if isinstance(value, bool):
            parts += [SETTINGS[key]] if value else [f"not {SETTINGS[key]}"] * (key == "annealing")
        elif key == "gain_sigma":
            parts.append(gain_text(value))
        else:
            parts.append(SETTINGS[key].format(value))
    return ", ".join(parts)


def gain_text(sigma: float) -> str:
    """How well the gain is known."""
    return "gain known" if sigma == 0 else f"gain unknown by {sigma:.0%}"
