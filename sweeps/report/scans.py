"""Rows and the printed table of scans of the field of regard."""

from __future__ import annotations

import xarray as xr
from rich.console import Console

from sweeps.report.axes import NOTHING
from sweeps.report.layout import sheet, show
from sweeps.report.rows import Column, Row, finite, percent, several, table_rows
from sweeps.report.screen import note, settings

SHARES = ("detected", "right", "wrong", "away", "found", "decoys", "rejected", "false_rejected")
TIMES = ("imaging", "slewing", "dwelling", "total", "alone")
BOTH_TIMES = ("total", "alone")
ENDS = ("low", "high")


def scan_rows(tables: xr.Dataset) -> list[Row]:
    """Return shares [%] with intervals and totals, and the time of each part."""
    columns: dict[str, Column] = {"draws": ("draws", int)}
    for name in SHARES:
        variable = f"share_{name}"
        columns[f"percent_{name}"] = (variable, percent)
        columns |= {f"{name}_ci_{end}": (f"{variable}_{end}", percent) for end in ENDS}
        columns[f"{name}_of"] = (f"{variable}_of", int)
    columns["percent_detected_in_closed_form"] = ("chance", percent)
    columns |= {name: (name, finite) for name in ("false_a_field", "alarms_a_field")}
    columns |= {f"{name}_s": (name, finite) for name in TIMES} | {"gain": ("gain", finite)}
    return table_rows(tables, columns, {})


def print_scan(rows: list[Row], console: Console) -> None:
    """Print shares found and times: ranges and frames down."""
    for place, group in settings(rows, ("pulse_width",), but=("range_km", "frame_count")):
        table = sheet(
            f"Scan of the field of regard ({place})",
            *("range\n[km]", "frames", "ships\ndetected\n[%]", "closed\nform\n[%]"),
            *("of these\nidenti-\nfied [%]", "decoys\nrejected\n[%]", "sea\nvisited,\ntimes"),
            *("sea\nrejected\n[%]", "imager\n[s]", "moves\n[s]", "visits\n[s]", "in all\n[s]"),
            *("laser\nradar\nalone [s]", "x as\nlong"),
            keys=2,
        )
        for row in group:
            table.add_row(
                *(f"{row['range_km']:g}", f"{row['frame_count']}"),
                _share(row, "detected"),
                _figure(row["percent_detected_in_closed_form"], 0),
                *(_share(row, name) for name in ("right", "rejected")),
                _figure(row["false_a_field"]),
                _share(row, "false_rejected"),
                *(_figure(row[f"{name}_s"]) for name in TIMES),
                _figure(row["gain"]),
            )
        show(table, console)
    one = rows[0]
    more = "" if several(rows, but=("range_km", "frame_count")) else f", {one['draws']} draws"
    note(
        f"Below each share its 95 % Wilson interval{more}. Ships are at aspects without a "
        "template. Identified: the most probable ship is the true one, and its similarity exceeds "
        "the rejection threshold. Frames are those of the laser radar; alone, it takes as many at "
        "every place of the field.",
        console,
    )


def print_found(rows: list[Row], console: Console) -> None:
    """Print the main figures of scans: shares with intervals, and times."""
    for place, group in settings(rows, ("pulse_width",), but=("range_km", "frame_count")):
        table = sheet(
            f"Ships found in a scan of the field of regard ({place})",
            *("range [km]", "frames", "detected [%]", "of these\nidentified [%]"),
            *("time of the\nsearch [s]", "laser radar\nalone [s]"),
            keys=2,
        )
        for row in group:
            shares = (_share(row, name).replace("\n", " [") for name in ("detected", "right"))
            table.add_row(
                *(f"{row['range_km']:g}", f"{row['frame_count']}"),
                *(share if share == NOTHING else f"{share}]" for share in shares),
                *(_figure(row[f"{name}_s"]) for name in BOTH_TIMES),
            )
        show(table, console)
    note("With 95 % Wilson intervals.", console)


def _figure(value: float | None, digits: int = 1) -> str:
    """Return a number, or a dash."""
    return NOTHING if value is None else f"{value:.{digits}f}"


def _share(row: Row, name: str) -> str:
    """Return a share in percent, with the interval below."""
    share = row[f"percent_{name}"]
    if share is None:
        return NOTHING
    return f"{share:.0f}\n{row[f'{name}_ci_low']:.0f}-{row[f'{name}_ci_high']:.0f}"
