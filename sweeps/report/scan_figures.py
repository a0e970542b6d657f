"""Picture of a scan: the field of regard with its visits, their time, and what all draws find."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from sweeps.report.style import (
    BLACK,
    BLUE,
    GOLD,
    GREEN,
    HEADING,
    LABEL,
    RUST,
    SKY,
    SMALL,
    TITLE,
    bare,
    nested,
)
from sweeps.stages.scan_tables import DECOY, NOWHERE

COLOURS = {
    "right": GREEN,
    "wrong": RUST,
    "rejected": BLUE,
    "imager": GOLD,
    "missed": "0.5",
    "visits": SKY,
}
SAYS = {
    "right": "ship, identified",
    "wrong": "taken for a ship, wrongly",
    "rejected": "rejected: no known ship",
    "missed": "not detected",
}
PARTS = (
    ("imaging", "imager", "imager"),
    ("slewing", "missed", "moves"),
    ("dwelling", "visits", "visits"),
)
LABELS = 2.6  # percent of the field's height, between a box and its label


def draw_scan(scan: xr.Dataset, table: xr.Dataset, given: dict[str, Any]) -> Figure:
    """Draw the first field at the middle range, its time line, and figures over all draws.

    Parameters
    ----------
    scan : xarray.Dataset
        Group `scan` of a store.
    table : xarray.Dataset
        Its group `tables/scan`.
    given : dict
        The store's configuration.
    """
    scan, table = (_nominal(one) for one in (scan, table))
    place = scan
    if "range" in scan.dims:
        place = place.isel(range=scan.sizes["range"] // 2)
    if "replicate" in scan.dims:
        place = place.isel(replicate=0)
    if "frame_count" in scan.dims:
        place = place.isel(frame_count=-1)
    figure = Figure(figsize=(11.0, 6.6), dpi=150, layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(2.1, 1), height_ratios=(1, 1, 0.42))
    _field(figure.add_subplot(grid[:2, 0]), place, given)
    _time_line(figure.add_subplot(grid[2, 0]), place, given)
    _found(figure.add_subplot(grid[0, 1]), table)
    _times(figure.add_subplot(grid[1:, 1]), table)
    for axes in figure.axes:
        axes.tick_params(labelsize=SMALL)
        axes.xaxis.label.set_fontsize(LABEL)
        axes.yaxis.label.set_fontsize(LABEL)
    figure.suptitle("Ships detected by the imager, identified by the laser radar", fontsize=TITLE)
    return figure


def _nominal(data: xr.Dataset) -> xr.Dataset:
    """Return the data at the first value of every axis that is not drawn."""
    kept = ("range", "replicate", "frame_count", "target", "detection", "edge")
    return data.isel({dim: 0 for dim in data.dims if dim not in kept})


def outcome(source: int, named: int, accepted: bool, ships: int) -> str:
    """Return the outcome of a visit: `right`, `wrong` or `rejected`."""
    if not accepted:
        return "rejected"
    return "right" if source == named and source < ships else "wrong"


def _visits(place: xr.Dataset) -> list[tuple[str, str, Any, Any]]:
    """Return outcome, label, detected and visited box of each visit, from left to right."""
    names = place.target.values.tolist()
    ships = len(names) - (names[-1] == DECOY)
    found = []
    for nth in range(place.sizes["detection"]):
        one = place.isel(detection=nth)
        source, named = int(one.source), int(one.named)
        if source < NOWHERE:
            continue
        what = outcome(source, named, bool(one.accepted == 1), ships)
        label = "" if source == NOWHERE else names[source].capitalize()
        if what == "wrong":
            label = f"{label or 'Sea'}, taken for {names[named].capitalize()}"
        found.append((what, label, one.box.values, one.visit.values))
    return found


def _field(axes: Axes, place: xr.Dataset, given: dict[str, Any]) -> None:
    """Draw the field of regard: detections, visits and missed ships."""
    width, height = given["scan"]["width"], given["scan"]["height"]
    degrees = np.degrees(given["ladar"]["ifov"] * 1e-6)
    middle = np.array([np.ceil(width / degrees), np.ceil(height / degrees)]) / 2
    seen = set()
    for what, label, box, visit in _visits(place):
        seen.add(what)
        for edges, filled in ((visit, False), (box, True)):
            corner = (edges[:2] - middle) * degrees
            side = (edges[2:] - edges[:2]) * degrees
            style = {"fc": COLOURS[what], "lw": 0} if filled else {"fill": False, "lw": 0.8}
            axes.add_patch(Rectangle(corner, *side, ec=COLOURS[what], **style))
        at = (np.array([visit[0], visit[3]]) - middle) * degrees
        above = at[0], at[1] + LABELS / 100 * height
        axes.annotate(label, above, fontsize=SMALL, color=COLOURS[what])
    for target in np.flatnonzero(place.hot.values == 0):
        one = place.isel(target=target)
        at = (np.array([one.column, one.row]) - middle) * degrees
        axes.plot(*at, "x", color=COLOURS["missed"], ms=6)
        where: Any = {"xytext": (5, 5), "textcoords": "offset points", "fontsize": SMALL}
        axes.annotate(str(one.target.item()).capitalize(), at, color=COLOURS["missed"], **where)
        seen.add("missed")
    for what in SAYS:
        if what in seen:
            axes.plot([], [], "s", color=COLOURS[what], ms=6, label=SAYS[what])
    axes.set(xlim=(-width / 2, width / 2), ylim=(-height / 2, height / 2), aspect="equal")
    axes.set(xlabel="bearing [°]", ylabel="elevation [°]")
    axes.legend(loc="upper right", fontsize=SMALL, frameon=False, ncols=2)
    frames = f"{int(place.frame_count)} frames"
    what = f"Field of regard at {float(place.range):g} km, {frames}"
    axes.set_title(f"{what}: detections (filled) and visits (outlined)", fontsize=HEADING)


def _time_line(axes: Axes, place: xr.Dataset, given: dict[str, Any]) -> None:
    """Draw the imager and all visits, one after the other."""
    sizes = given["scan"]
    axes.barh(0, float(place.imaging), color=COLOURS["imager"], ec="white", lw=0.4)
    now, visits = float(place.imaging), _visits(place)
    for what, _, _, visit in visits:
        now += sizes["slew_time"]
        columns, rows = (visit[2:] - visit[:2]) // sizes["detector"]
        taken = columns * rows * int(place.frame_count) / sizes["pulse_rate"]
        axes.barh(0, taken, left=now, color=COLOURS[what], ec="white", lw=0.4)
        now += taken
    axes.set(yticks=[], xlabel="time [s]", xlim=(0, 1.01 * now))
    axes.set_title(
        f"Imager {float(place.imaging):.1f} s, then {len(visits)} visits: {now:.1f} s in all, "
        f"{float(place.alone):.0f} s by the laser radar alone",
        fontsize=HEADING,
    )
    bare(axes)
    axes.spines["left"].set_visible(False)


def _lines(table: xr.Dataset) -> tuple[Any, xr.Dataset]:
    """Return ranges, and the table with the axes range and frame count."""
    for name in ("range", "frame_count"):
        if name not in table.dims:
            table = table.expand_dims(name)
    return table.range.values, table


def _found(axes: Axes, table: xr.Dataset) -> None:
    """Draw shares over all draws, with intervals, by range, for the largest number of frames."""
    ranges, table = _lines(table)
    last = table.isel(frame_count=-1)
    axes.plot(ranges, 100 * last.chance, ":", color=BLACK, lw=1.2, label="detected, closed form")
    shown = (
        ("detected", "0.4", "s-", "ships detected"),
        ("right", COLOURS["right"], "o-", "identified, of the detected"),
        ("rejected", COLOURS["rejected"], "^--", "decoys rejected"),
    )
    for nth, (name, colour, style, label) in enumerate(shown):
        share = 100 * last[f"share_{name}"].values
        ends = [100 * last[f"share_{name}_{end}"].values for end in ("low", "high")]
        there = np.isfinite(share)
        error = np.maximum([share - ends[0], ends[1] - share], 0)[:, there]
        how: dict[str, Any] = {"color": colour, "mfc": "white", "label": label}
        how |= nested(nth, len(shown))
        axes.errorbar(ranges[there], share[there], error, fmt=style, **how)
    axes.set(ylim=(0, 104), ylabel="percent", xlabel="slant range [km]", xticks=ranges)
    draws, frames = int(table.draws.max()), int(last.frame_count)
    axes.set_title(f"{draws} draws, {frames} frames, 95 % intervals", fontsize=HEADING)
    axes.legend(fontsize=SMALL - 0.5, frameon=False, loc="lower left")
    bare(axes)


def _times(axes: Axes, table: xr.Dataset) -> None:
    """Draw the mean time by part beside that of the laser radar alone, by range and frames."""
    ranges, table = _lines(table)
    places, labels, at = [], [], 0.0
    for count in table.frame_count.values:
        for where in ranges:
            one = table.sel(frame_count=count, range=where)
            left = 0.0
            for part, colour, _ in PARTS:
                axes.barh(at, float(one[part]), left=left, color=COLOURS[colour])
                left += float(one[part])
            axes.barh(at, float(one.alone), color="none", ec="0.5", lw=0.8)
            gain = f"{float(one.gain):.0f}×"
            axes.text(float(one.alone) * 1.02, at, gain, va="center", fontsize=SMALL)
            places.append(at)
            labels.append(f"{where:g} km, {count}")
            at += 1
        at += 0.5
    keys = [Patch(color=COLOURS[colour], label=label) for _, colour, label in PARTS]
    keys.append(Patch(fc="none", ec="0.5", lw=0.8, label="laser radar alone"))
    axes.set(yticks=places, yticklabels=labels, xlabel="mean time [s]")
    axes.set_xlim(0, 1.15 * float(table.alone.max()))
    axes.invert_yaxis()
    axes.legend(handles=keys, fontsize=SMALL, frameon=False, loc="upper right")
    axes.set_title("Time by range and frames", fontsize=HEADING)
    bare(axes)
