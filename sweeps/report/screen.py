"""Tables on the screen."""

from __future__ import annotations

from collections.abc import Iterable

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from sweeps.report.silhouettes import CHOICES, POSITIONS
from sweeps.report.tables import Row, first_rules, source_figures

SOURCE = "source"
NOTHING = "–"  # where there is no figure
WIDTH = 100  # columns that the widest table needs; narrower and its figures would be cut


def print_categories(rows: list[Row], console: Console) -> None:
    """Print how many categories formed: pulse widths down, vigilances across."""
    console.width = max(console.width, WIDTH)
    for setting, group in grouped(rows, ("range_km", "target_free_ifovs", "learning_rate")).items():
        vigilances = sorted({row["vigilance"] for row in group})
        table = Table(title=f"Categories formed by the ACN ({_setting(setting, group[0])})")
        table.add_column(escape("pulse width [ns]"), justify="right")
        table.add_column("profiles", justify="right")
        for vigilance in vigilances:
            table.add_column(f"vigilance {vigilance:g}", justify="right")
        figures = source_figures()["table3_categories"]
        table.add_column(f"{SOURCE}, {figures['vigilance']:g}", justify="right", style="dim")
        for (pulse_width,), cells in grouped(group, ("pulse_width_ns",)).items():
            formed = {row["vigilance"]: row for row in cells}
            theirs = [row["source_categories"] for row in cells if row["source_categories"]]
            table.add_row(
                f"{pulse_width:g}",
                str(cells[0]["training_profiles"]),
                *(_count(formed[vigilance]) for vigilance in vigilances),
                str(theirs[0]) if theirs else "",
            )
        console.print(table)
        if not all(row["settled"] for row in group if row["categories"]):
            console.print("* categories still changed in the last pass", style="dim")


def print_accuracy(rows: list[Row], console: Console) -> None:
    """Print percent correct with its interval: numbers of frames down, aspect bins across.

    One vigilance is printed, the source's if it is there; the CSV has them all.
    """
    console.width = max(console.width, WIDTH)
    figures = source_figures()["table4_percent_correct"]
    keys = ("range_km", "target_free_ifovs", "learning_rate", "pulse_width_ns", "vigilance")
    vigilances = {row["vigilance"] for row in rows}
    shown = figures["vigilance"] if figures["vigilance"] in vigilances else max(vigilances)
    noted = False
    printed = [row for row in first_rules(rows) if row["vigilance"] == shown]
    for setting, group in grouped(printed, keys).items():
        bins = list(dict.fromkeys(row["aspect_bin_deg"] for row in group))
        title = f"Percent correct, ACN ({_setting(setting[:3], group[0])}, {setting[3]:g} ns, "
        table = Table(title=title + f"vigilance {setting[4]:g})")
        table.add_column("frames", justify="right")
        beside = any(row["source_percent"] is not None for row in group)
        for label in bins:
            table.add_column(label if label == "overall" else f"{label}°", justify="right")
            if beside and label != "overall":
                table.add_column(SOURCE, justify="right", style="dim")
        tests = grouped(group, ("frame_count",))
        first = [key for key in tests if key[0] is None]
        for key in first + sorted((key for key in tests if key[0] is not None), reverse=True):
            cells = {row["aspect_bin_deg"]: row for row in tests[key]}
            line = ["training" if key[0] is None else str(key[0])]
            for label in bins:
                row = cells[label]
                line.append(percent_text(row))
                if beside and label != "overall":
                    theirs = row["source_percent"]
                    line.append("" if theirs is None else str(theirs))
            table.add_row(*line)
        console.print(table)
        noted = noted or beside
    if noted:
        console.print(f"Source: {figures['note']}", style="dim")
    if len(vigilances) > 1:
        console.print("95 % Wilson intervals; other vigilances are in the CSV", style="dim")
    else:
        console.print("95 % Wilson intervals", style="dim")


def print_sensor(rows: list[Row], console: Console) -> None:
    """Print what the air leaves of a ship's warmth: ranges down."""
    figures = source_figures()["table1_sensor"]
    frames = _nearest(figures["frame_count"], (row["frame_count"] for row in rows))
    table = Table(title=f"Passive-infrared sensor, {frames} frames averaged")
    table.add_column(escape("range [km]"), justify="right")
    for name in ("attenuation [dB]", "contrast [K]", "SNR"):
        table.add_column(escape(name), justify="right")
        table.add_column(SOURCE, justify="right", style="dim")
    for row in (row for row in rows if row["frame_count"] == frames):
        cells = [f"{row['range_km']:g}"]
        for name, digits in (("attenuation_db", ".2f"), ("contrast_k", ".3f"), ("snr", ".1f")):
            cells += [format(row[name], digits), row[f"source_{name}"] or ""]
        table.add_row(*cells)
    console.print(table)


def print_silhouette_categories(rows: list[Row], console: Console) -> None:
    """Print how many categories formed from silhouettes: trainings down."""
    console.width = max(console.width, WIDTH)
    choices = _several(rows)
    table = Table(title="Categories formed by the ACN from noiseless silhouettes")
    for name in choices:
        table.add_column(name.replace("_", " "), justify="right")
    for name in ("vigilance", "silhouettes", "categories", "least", "most"):
        table.add_column(name, justify="right")
    table.add_column(SOURCE, justify="right", style="dim")
    for row in rows:
        table.add_row(
            *(_plain(row[name]) for name in choices),
            f"{row['vigilance']:g}",
            str(row["training_silhouettes"]),
            _mean_count(row),
            NOTHING if row["least"] is None else str(row["least"]),
            NOTHING if row["most"] is None else str(row["most"]),
            str(row["source_categories"] or ""),
        )
    console.print(table)
    if not all(row["settled"] for row in rows if row["trainings"]):
        console.print("* some categories still changed in the last pass", style="dim")


def print_silhouette_accuracy(rows: list[Row], console: Console) -> None:
    """Print percent correct of silhouettes: ranges and resolutions down, aspect bins across.

    One vigilance and one number of frames are printed, the source's if they are there; the CSV
    has them all.
    """
    console.width = max(console.width, WIDTH)
    rows = first_rules(rows)
    figures = source_figures()["table5_percent_correct"]
    tested = [row for row in rows if row["frame_count"] is not None]
    frames = _nearest(figures["frame_count"], (row["frame_count"] for row in tested))
    vigilance = _nearest(figures["vigilance"], (row["vigilance"] for row in rows))
    shown = [
        row
        for row in rows
        if row["frame_count"] in (None, frames) and row["vigilance"] == vigilance
    ]
    bins = list(dict.fromkeys(row["aspect_bin_deg"] for row in shown))
    for setting, group in grouped(shown, CHOICES).items():
        beside = any(row["source_percent"] is not None for row in group)
        title = f"Percent correct of silhouettes, ACN ({frames} frames, vigilance {vigilance:g}"
        for name, value in zip(CHOICES, setting, strict=True):
            if name in _several(rows):
                title += f", {name.replace('_', ' ')} {_plain(value)}"
        table = Table(title=f"{title})", box=SIMPLE_HEAD)
        table.add_column("range")
        for label in bins:
            table.add_column(label if label == "overall" else f"{label}°", justify="right")
        for (slant_range, way), cells in grouped(group, ("range_km", "super_resolution")).items():
            by_bin = {row["aspect_bin_deg"]: row for row in cells}
            table.add_row(
                "training"
                if slant_range is None
                else f"{slant_range:g} km{_sharper(str(way), frames)}",
                *(_spread_text(by_bin[label]) for label in bins),
            )
            theirs = [by_bin[label]["source_percent"] for label in bins]
            if any(value is not None for value in theirs):
                values = ("" if value is None else str(value) for value in theirs)
                table.add_row(f"  {SOURCE}", *values, style="dim")
        console.print(table)
        if beside:
            console.print(f"Source: {figures['note']}", style="dim")
    for places in sorted({POSITIONS[row["super_resolution"]] for row in tested} - {1}):
        note = f"{places} x {frames}: {frames} frames at each of {places} places of the detector"
        console.print(note, style="dim")
    console.print(
        "Means over phases and orders of presentation with 95 % Wilson intervals of one set of "
        "views; ±: standard deviation over them. Other frames and vigilances are in the CSV",
        style="dim",
    )


def print_detection(rows: list[Row], false_alarm: float, console: Console) -> None:
    """Print how often ships are found: ranges down, numbers of frames across."""
    whole = [row for row in rows if row["aspect_bin_deg"] == "overall"]
    frames = sorted({row["frame_count"] for row in whole})
    rules = sorted({row["coverage_rule"] for row in whole})
    ruled = f", coverage rule {rules[0]:g}" if len(rules) > 1 else ""
    table = Table(title=f"Ships detected, false alarms {false_alarm:g} a pixel{ruled} [%]")
    table.add_column(escape("range [km]"), justify="right")
    for count in frames:
        table.add_column("1 frame" if count == 1 else f"{count} frames", justify="right")
    for (slant_range,), group in grouped(whole, ("range_km",)).items():
        found = {row["frame_count"]: row for row in group if row["coverage_rule"] == rules[0]}
        chances = (found[count]["probability"] for count in frames)
        table.add_row(
            f"{slant_range:g}",
            *(NOTHING if chance is None else f"{100 * chance:.3g}" for chance in chances),
        )
    console.print(table)


def print_reconstruction(rows: list[Row], console: Console) -> None:
    """Print the error of images by resolution: ranges and frames down."""
    ways = list(dict.fromkeys(row["super_resolution"] for row in rows))
    rules = sorted({row["coverage_rule"] for row in rows})
    title = "Error of images against the noiseless one of half the pixel, over contrast"
    if len(rules) > 1:
        title += f" (coverage rule {rules[0]:g})"
    table = Table(title=title)
    table.add_column(escape("range [km]"), justify="right")
    table.add_column("frames", justify="right")
    for way in ways:
        places = POSITIONS[way]
        frames = f", {places} x frames" if places > 1 else ""
        name = "no super-resolution" if way == "none" else f"{way} 2x{frames}"
        table.add_column(name, justify="right")
    for key, group in grouped(rows, ("range_km", "frame_count")).items():
        errors = {
            row["super_resolution"]: row["error"]
            for row in group
            if row["coverage_rule"] == rules[0]
        }
        table.add_row(
            f"{key[0]:g}",
            str(key[1]),
            *(NOTHING if errors[way] is None else f"{errors[way]:.3f}" for way in ways),
        )
    console.print(table)


def _spread_text(row: Row) -> str:
    """Percent correct, its interval and its spread."""
    spread = "" if row["percent_correct"] is None else f" ±{row['spread']:.0f}"
    return percent_text(row) + spread


def _several(rows: list[Row]) -> list[str]:
    """Choices that the rows do not all share."""
    return [name for name in CHOICES if len({row[name] for row in rows}) > 1]


def _nearest(wanted: float, there: Iterable[float]) -> float:
    return min(there, key=lambda value: (abs(value - wanted), value))


def _plain(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def grouped(rows: list[Row], keys: tuple[str, ...]) -> dict[tuple[object, ...], list[Row]]:
    """Rows by the values of some keys, in the order they come."""
    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return groups


def _setting(setting: tuple[object, ...], row: Row) -> str:
    slant_range, floor, rate = setting
    return f"{slant_range:g} km, {floor} target-free IFOVs" + (
        f", learning rate {rate:g}" if rate != 0.1 else ""
    )


def _count(row: Row) -> str:
    if not row["categories"]:
        return "failed"
    return f"{row['categories']}" + ("" if row["settled"] else "*")


def _mean_count(row: Row) -> str:
    if row["categories"] is None:
        return "failed"
    return f"{row['categories']:.1f}" + ("" if row["settled"] else "*")


def _sharper(way: str, frames: float) -> str:
    """How an image got finer than the detector, and at what cost of frames."""
    if way == "none":
        return ""
    places = POSITIONS[way]
    return f", {way}" + (f", {places} x {frames}" if places > 1 else "")


def percent_text(row: Row) -> str:
    """Percent correct and its interval."""
    if row["percent_correct"] is None:
        return NOTHING
    return f"{row['percent_correct']:.0f} [{row['ci_low']:.0f}-{row['ci_high']:.0f}]"
