"""What range profiles and silhouettes tell together, beside each of them alone."""

from __future__ import annotations

import xarray as xr
from rich.console import Console

from sweeps.report.axes import printable, shown
from sweeps.report.rows import BIN, Row, grouped, nearest, score_rows
from sweeps.report.screen import note, print_scores, settings
from sweeps.report.silhouettes import frames_in_all, positions

TOLD = ("pulse_width", "target_free_ifovs", "gain_sigma")
PLACED = ("range_km", "frame_count", "infrared_frame_count", "channel", "super_resolution", BIN)
CHANNELS = {"range": "range profile", "infrared": "silhouette", "both": "both"}


def fusion_rows(tables: xr.Dataset) -> list[Row]:
    """Percent correct by sensor and by both, one row a cell and aspect bin.

    `n` counts answers, which the interval takes as fewer where those to one view are alike.
    """
    rows = score_rows(tables, label={})
    for row in rows:
        row["infrared_frames_in_all"] = frames_in_all(row, "infrared_frame_count")
    return rows


def print_fusion(rows: list[Row], console: Console) -> None:
    """Print sensors and both: ranges, resolutions and frames down, aspect bins across."""
    title = "Percent correct by maximum likelihood on profiles, similarity of silhouettes, both"
    for place, group in settings(rows, TOLD, but=PLACED):
        lines = []
        for (slant_range, frames), cell in grouped(group, ("range_km", "frame_count")).items():
            for number, (name, line) in enumerate(_lines(cell, frames).items()):
                first = ("", "") if number else (shown(slant_range), str(frames))
                lines.append(((*first, name), line))
        headings = ("range [km]", "frames", "channel")
        print_scores(f"{title} ({place})", headings, lines, console)
    note(
        "A profile's score is its log-likelihood; a silhouette's is given its weight on other "
        "phases, against templates of other phases; both name one ship at one aspect. Infrared "
        "frames as many as those of profiles, or the nearest number there. 95 % Wilson "
        "intervals; n in the CSV counts answers, which intervals take as fewer (Kish's design "
        "effect) where those to one view are alike.",
        console,
    )


def _lines(cell: list[Row], frames: int) -> dict[str, list[Row]]:
    """Rows of one range and number of frames by what to call them; the range channel once."""
    near = nearest(frames, {row["infrared_frame_count"] for row in cell})
    here = [row for row in cell if row["infrared_frame_count"] == near]
    # Sensors first, then both.
    here.sort(key=lambda row: [*CHANNELS, row["channel"]].index(row["channel"]))
    lines: dict[str, list[Row]] = {}
    for (channel, way), line in grouped(here, ("channel", "super_resolution")).items():
        places, finer = positions(way), "" if way == "none" else f", {printable(way)}"
        name = CHANNELS.get(channel, printable(channel)) + finer * (channel != "range")
        if channel == "infrared":
            name += f" ({places} x {near} images)" if places > 1 else f" ({near} images)"
        lines.setdefault(name, line)
    return lines
