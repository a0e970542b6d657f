"""What range profiles and silhouettes tell together, beside each of them alone."""

from __future__ import annotations

import xarray as xr
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sweeps.axes import OF_SILHOUETTES
from sweeps.report.classifiers import gain_text
from sweeps.report.screen import WIDTH, grouped, percent_text
from sweeps.report.silhouettes import POSITIONS
from sweeps.report.tables import Row, cells, percent

AXES = (
    "range_km",
    "pulse_width_ns",
    "target_free_ifovs",
    "gain_sigma",
    *OF_SILHOUETTES,
    "super_resolution",
    "infrared_frame_count",
    "frame_count",
    "channel",
)
PARTS = ("accuracy", "ci_low", "ci_high", "n")


def fusion_rows(tables: xr.Dataset) -> list[Row]:
    """Percent correct by sensor and by both, by aspect bin.

    Parameters
    ----------
    tables : xarray.Dataset
        The store's table group.

    Returns
    -------
    list of dict
        One row for each channel, cell, prior of the gain, resolution, numbers of frames and
        aspect bin, with the way in which silhouettes are made; `n` counts
        answers, which the interval takes as fewer where those to one view are alike.
    """
    rows = []
    for axes, cell in cells(tables[list(PARTS)]):
        fraction, low, high, n = (cell[part] for part in PARTS)
        rows.append(
            {key: axes[key] for key in AXES}
            | {
                "infrared_frames_in_all": axes["infrared_frame_count"]
                * POSITIONS[axes["super_resolution"]],
                "aspect_bin_deg": axes["aspect_bin"],
                "percent_correct": percent(fraction),
                "ci_low": percent(low),
                "ci_high": percent(high),
                "n": n,
            }
        )
    return rows


def print_fusion(rows: list[Row], console: Console) -> None:
    """Print sensors and both: ranges, resolutions and frames down, aspect bins across."""
    console.width = max(console.width, WIDTH)
    for (pulse_width, floor, gain), group in grouped(rows, AXES[1:4]).items():
        bins = list(dict.fromkeys(row["aspect_bin_deg"] for row in group))
        title = "Percent correct by maximum likelihood on profiles, similarity of silhouettes, both"
        assert isinstance(gain, float)
        place = f"{pulse_width:g} ns, {floor} target-free IFOVs, {gain_text(gain)}"
        table = Table(title=f"{title} ({place})")
        table.add_column(escape("range [km]"), justify="right")
        table.add_column("frames", justify="right")
        table.add_column("channel")
        for label in bins:
            table.add_column(label if label == "overall" else f"{label}°", justify="right")
        for (slant_range, frames), cell in grouped(group, ("range_km", "frame_count")).items():
            for number, (name, line) in enumerate(_lines(cell, frames).items()):
                found = {row["aspect_bin_deg"]: row for row in line}
                table.add_row(
                    "" if number else f"{slant_range:g}",
                    "" if number else str(frames),
                    name,
                    *(percent_text(found[label]) for label in bins),
                    style="bold" if name.startswith("both") else "",
                )
            table.add_section()
        console.print(table)
    console.print(
        "A profile's score is its log-likelihood; a silhouette's is given its weight on other "
        "phases, against templates of other phases; both name one ship at one aspect. Infrared "
        "frames as many as those of profiles, or the nearest number there. 95 % Wilson "
        "intervals; n in the CSV counts answers, which intervals take as fewer (Kish's design "
        "effect) where those to one view are alike.",
        style="dim",
    )


def _lines(cell: list[Row], frames: object) -> dict[str, list[Row]]:
    """Rows of one range and number of frames by what to call them; the range channel once."""
    assert isinstance(frames, int)
    counts = {row["infrared_frame_count"] for row in cell}
    near = min(counts, key=lambda count: (abs(count - frames), count))
    lines: dict[str, list[Row]] = {}
    for row in (row for row in cell if row["infrared_frame_count"] == near):
        way = row["super_resolution"]
        name = "range profile"
        if row["channel"] != "range":
            name = "silhouette" if row["channel"] == "infrared" else "both"
            places = POSITIONS[way]
            finer = "" if way == "none" else f", {way}"
            count = f"{places} x {near}" if places > 1 else f"{near}"
            name += f"{finer} ({count} images)" if name == "silhouette" else finer
        same = lines.setdefault(name, [])
        if row["aspect_bin_deg"] not in [other["aspect_bin_deg"] for other in same]:
            same.append(row)
    # Sensors first, then both.
    return dict(sorted(lines.items(), key=lambda item: item[0].startswith("both")))
