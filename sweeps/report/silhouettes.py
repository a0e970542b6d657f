"""Tables of the infrared channel beside the source's, and of both channels together."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import xarray as xr
from rich.console import Console

from sweeps.report.axes import axes_of, printable, shown
from sweeps.report.layout import sheet, show
from sweeps.report.rows import (
    BIN,
    Row,
    beside_source,
    cells,
    finite,
    formation_rows,
    grouped,
    is_fair,
    nearest,
    of_one,
    rounded,
    score_rows,
    setting,
    several,
    source_figures,
    table_rows,
    together,
)
from sweeps.report.screen import (
    SOURCE,
    frames_text,
    note,
    percent_text,
    print_grid,
    print_scores,
    settings,
)

POSITIONS = {"shifted": 4}  # positions of the detector, with as many frames at each
SENSOR = {  # heading and digits
    "attenuation_db": ("attenuation [dB]", ".2f"),
    "contrast_k": ("contrast [K]", ".3f"),
    "snr": ("SNR", ".1f"),
}
OF_SENSOR = ("extinction", "contrast_at_zero", "nedt")
TOLD = ("pulse_width", "target_free_ifovs", "gain_sigma")  # of both channels, in titles
PLACED = ("range_km", "frame_count", "infrared_frame_count", "channel", "super_resolution", BIN)
CHANNELS = {"range": "range profile", "infrared": "silhouette", "both": "both"}


def positions(way: str) -> int:
    """Return the number of positions of the detector for an image."""
    return POSITIONS.get(way, 1)


def frames_in_all(row: Row, key: str = "frame_count") -> int | None:
    """Return the total frames for an image: shifted ones add up over four positions."""
    return None if row[key] is None else positions(row["super_resolution"]) * row[key]


def sensor_rows(images: xr.Dataset, configuration: Mapping[str, Any]) -> list[Row]:
    """Return attenuation and contrast of a ship (the article's Table 1), by range and frames.

    Settings of the sensor are the images' coordinates, or else of the configuration's `infrared`.
    """
    # Imported here, since it is slow to import.
    from ncti.infrared import attenuation, contrast, snr

    source = source_figures()["table1_sensor"]
    own = [name for name in OF_SENSOR if name in images.coords and images[name].ndim]
    given = {name: setting(images, configuration, name) for name in set(OF_SENSOR) - set(own)}
    kept = ("range", "frame_count", *own)
    axes = images.drop_vars([name for name in images.variables if name not in kept])
    rows = []
    for place, _ in cells(axes):
        scene = given | {axis.name: place[axis] for axis in axes_of(axes) if axis.name in own}
        frames, metres = place["frame_count"], place["range_km"] * 1e3
        scene["extinction"] *= 1e-3
        nedt, extinction = scene.pop("nedt"), scene["extinction"]
        figures = {
            "attenuation_db": round(attenuation(metres, extinction=extinction), 3),
            "contrast_k": round(contrast(metres, **scene), 4),
            "snr": round(snr(metres, frame_count=frames, nedt=nedt, **scene), 3),
        }
        printed = source["ranges"].get(place["range_km"]) if frames == source["frame_count"] else {}
        row = dict(place)
        for name, figure in figures.items():
            row |= {name: figure, f"source_{name}": (printed or {}).get(name)}
        rows.append(row)
    return rows


def print_sensor(rows: list[Row], console: Console) -> None:
    """Print attenuation and contrast of a ship: ranges down."""
    wanted = source_figures()["table1_sensor"]["frame_count"]
    frames = nearest(wanted, (row["frame_count"] for row in rows))
    here = [row for row in rows if row["frame_count"] == frames]
    for place, group in settings(here, (), but=("range_km",)):
        headings = [text for name, _ in SENSOR.values() for text in (name, SOURCE)]
        title = f"Passive-infrared sensor, {frames} frames averaged" + (place and f", {place}")
        table = sheet(title, "range [km]", *headings, keys=1)
        for column in table.columns[2::2]:
            column.style = "dim"
        for row in group:
            texts = [shown(row["range_km"])]
            for name, (_, digits) in SENSOR.items():
                texts += [format(row[name], digits), row[f"source_{name}"] or ""]
            table.add_row(*texts)
        show(table, console)


def silhouette_category_rows(tables: xr.Dataset) -> list[Row]:
    """Return categories formed from silhouettes, a row per training, over its phases and orders."""
    source, rows = source_figures()["table5_percent_correct"], []
    for row in formation_rows(tables):
        row["of_first_phase_and_order"] = row.pop("first")
        row["training_silhouettes"] = row.pop("views")
        row["settled"] = row.pop("settled")
        asked = row["vigilance"] == source["vigilance"] and is_fair(row, tables, "acn_infrared")
        rows.append(row | {"source_categories": source["categories"] if asked else None})
    return rows


def print_silhouette_categories(rows: list[Row], console: Console) -> None:
    """Print how many categories formed from silhouettes: trainings down."""
    choices = several(rows, but=("vigilance",))
    table = sheet(
        "Categories formed by the ACN from noiseless silhouettes",
        *(axis.heading for axis in choices),
        *("vigilance", "silhouettes", "categories", "least", "most"),
        dim=(SOURCE,),
        keys=len(choices) + 1,
    )
    for row in rows:
        count = row["categories"]
        table.add_row(
            *(shown(row[axis]) for axis in (*choices, "vigilance", "training_silhouettes")),
            "failed" if count is None else f"{count:.1f}" + ("" if row["settled"] else "*"),
            *(shown(row[name]) for name in ("least", "most")),
            str(row["source_categories"] or ""),
        )
    show(table, console)
    if not all(row["settled"] for row in rows if row["trainings"]):
        note("* some categories still changed in the last pass", console)


def silhouette_accuracy_rows(tables: xr.Dataset) -> list[Row]:
    """Return percent correct by aspect bin (the article's Table 5), training silhouettes first."""
    training = score_rows(tables, "training_", silhouettes="training")
    rows = together(training, score_rows(tables, silhouettes="cut out"))
    for row in rows:
        row["frames_in_all"] = frames_in_all(row)
    return beside_source(rows, tables, "acn_infrared")


def print_silhouette_accuracy(rows: list[Row], console: Console) -> None:
    """Print percent correct of silhouettes at the source's vigilance and frames, or the nearest."""
    figures = source_figures()["table5_percent_correct"]
    rows = of_one(rows)
    tested = [row for row in rows if row["frame_count"] is not None]
    frames = nearest(figures["frame_count"], (row["frame_count"] for row in tested))
    vigilance = nearest(figures["vigilance"], (row["vigilance"] for row in rows))
    rows = [row for row in rows if row["vigilance"] == vigilance]
    rows = [row for row in rows if row["frame_count"] in (None, frames)]
    placed = ("range_km", "super_resolution", "frame_count", BIN)
    for place, group in settings(rows, ("vigilance",), but=placed):
        lines = [
            (_look(slant_range, way, frames), line)
            for (slant_range, way), line in grouped(group, placed[:2]).items()
        ]
        title = f"Percent correct of silhouettes, ACN ({frames} frames, {place})"
        print_scores(title, "range", lines, console)
        if any(row["source_percent"] is not None for row in group):
            note(f"Source: {figures['note']}", console)
    for places in sorted({positions(row["super_resolution"]) for row in tested} - {1}):
        words = f"{frames} frames at each of {places} positions of the detector"
        note(f"{places} x {frames}: {words}", console)
    note(
        "Means over phases and orders of presentation, which the 95 % Wilson intervals include; "
        "their standard deviation, other frames and other vigilances are in the CSV file.",
        console,
    )


def _look(slant_range: float | None, way: str, frames: int) -> str:
    """Return a range, and the super-resolution with its number of frames."""
    if slant_range is None:
        return "training"
    finer = "" if way == "none" else f", {shown(way)}"
    more = f", {positions(way)} x {frames}" if positions(way) > 1 else ""
    return f"{slant_range:g} km{finer}{more}"


def detection_rows(tables: xr.Dataset) -> list[Row]:
    """Return the probability of detecting the ship, by range, frames and aspect bin."""
    columns = {"probability": ("probability", finite), "lowest_of_views": ("lowest", finite)}
    return table_rows(tables, columns, {})


def print_detection(rows: list[Row], false_alarm: float, console: Console) -> None:
    """Print the probability of detection: ranges down, numbers of frames across."""
    whole = [row for row in rows if row[BIN] == "overall"]
    several_alarms = any(axis.name == "false_alarm" for axis in several(whole))
    alarms = "" if several_alarms else f", false alarms {false_alarm:g} a pixel"
    counts = sorted({row["frame_count"] for row in whole})
    print_grid(
        whole,
        lambda words: f"Ships detected{alarms}{words} [%]",
        {"range_km": "range [km]"},
        ("frame_count", {count: frames_text(count) for count in counts}),
        "probability",
        lambda share: f"{100 * share:.3g}",
        console,
    )


def reconstruction_rows(tables: xr.Dataset) -> list[Row]:
    """Return the error of images, relative to the noiseless image of half the pixel."""
    rows = []
    for axes, cell in cells(tables[["error", "error_spread"]]):
        figures = {"error": rounded(cell["error"], 4), "spread": rounded(cell["error_spread"], 4)}
        rows.append(axes | {"frames_in_all": frames_in_all(axes)} | figures)
    return rows


def print_reconstruction(rows: list[Row], console: Console) -> None:
    """Print the error of images by resolution: ranges and frames down."""
    ways = {}
    for way in dict.fromkeys(row["super_resolution"] for row in rows):
        more = f", {positions(way)} x frames" if positions(way) > 1 else ""
        ways[way] = "no super-resolution" if way == "none" else f"{way} 2x{more}"
    title = "Error of images against the noiseless one of half the pixel, over contrast"
    print_grid(
        rows,
        lambda words: title + words,
        {"range_km": "range [km]", "frame_count": "frames"},
        ("super_resolution", ways),
        "error",
        lambda error: f"{error:.3f}",
        console,
    )


def fusion_rows(tables: xr.Dataset) -> list[Row]:
    """Return percent correct by sensor and by both, a row for each cell and aspect bin."""
    rows = score_rows(tables)
    for row in rows:
        row["infrared_frames_in_all"] = frames_in_all(row, "infrared_frame_count")
    return rows


def print_fusion(rows: list[Row], console: Console) -> None:
    """Print each sensor and both: ranges, resolutions and frames down, aspect bins across.

    Lines that are the same in every setting, such as silhouettes for every pulse width, come once.
    """
    tables = [(place, _sections(group)) for place, group in settings(rows, TOLD, but=PLACED)]
    first = _texts_of(tables[0][1]) if tables else {}
    same = {key for key in first if all(_texts_of(one).get(key) == first[key] for _, one in tables)}
    same = {key for key in same if key[1].startswith(CHANNELS["infrared"])}
    if len(tables) == 1:
        same = set()
    title = "Percent correct by maximum likelihood on profiles and by both sensors"
    if same:
        alone = "Percent correct by similarity of silhouettes (in every setting)"
        print_scores(alone, "sensor", _lines_of(tables[0][1], keep=same), console)
    else:
        title = "Percent correct by maximum likelihood on profiles, similarity of silhouettes, both"
    for place, sections in tables:
        keep = _texts_of(sections).keys() - same
        print_scores(f"{title} ({place})", "sensor", _lines_of(sections, keep=keep), console)
    note(
        "The score of a profile is its log-likelihood. That of a silhouette, by templates of other "
        "phases, is weighted by its accuracy on other phases. Both identify one ship at one aspect."
        " Infrared frames are as many as those of profiles, or nearly. 95 % Wilson intervals; "
        "n in the CSV file counts answers, of which those that are alike for one view, or in one "
        "draw, count for less (Kish's design effect).",
        console,
    )


Sections = dict[str, dict[str, list[Row]]]  # rows by range and frames, then by sensor


def _sections(group: list[Row]) -> Sections:
    """Return rows of one setting: a section for each range and number of frames."""
    return {
        f"{shown(slant_range)} km, {frames_text(frames)}": _lines(cell, frames)
        for (slant_range, frames), cell in grouped(group, ("range_km", "frame_count")).items()
    }


def _texts_of(sections: Sections) -> dict[tuple[str, str], list[str]]:
    """Return the printed text of every line, by section and sensor."""
    return {
        (section, name): [percent_text(row) for row in line]
        for section, lines in sections.items()
        for name, line in lines.items()
    }


def _lines_of(
    sections: Sections, keep: Collection[tuple[str, str]]
) -> Iterator[tuple[str, list[Row]]]:
    """Return lines of some sections and sensors for `print_scores`."""
    for section, lines in sections.items():
        kept = [(name, line) for name, line in lines.items() if (section, name) in keep]
        if kept:
            yield section, []
            yield from kept


def _lines(cell: list[Row], frames: int) -> dict[str, list[Row]]:
    """Return rows of one range and number of frames by label; the range channel once."""
    near = nearest(frames, {row["infrared_frame_count"] for row in cell})
    here = [row for row in cell if row["infrared_frame_count"] == near]
    # Sensors first, then both.
    here.sort(key=lambda row: [*CHANNELS, row["channel"]].index(row["channel"]))
    lines: dict[str, list[Row]] = {}
    for (channel, way), line in grouped(here, ("channel", "super_resolution")).items():
        places, finer = positions(way), "" if way == "none" else f", {printable(way)}"
        name = CHANNELS.get(channel, printable(channel)) + finer * (channel != "range")
        if channel == "infrared" and (places > 1 or near != frames):
            name += f" ({places} x {near})" if places > 1 else f" ({frames_text(near)})"
        lines.setdefault(name, line)
    return lines
