"""Tables of classifiers: the source's, all classifiers, and rejection of unknown ships."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import xarray as xr
from rich.console import Console

from sweeps.report.axes import NOTHING, Axis, printable, shown, told
from sweeps.report.layout import sheet, show
from sweeps.report.rows import (
    BIN,
    ENDS,
    Column,
    Row,
    as_in_source,
    axes_in,
    beside_source,
    finite,
    formation_rows,
    grouped,
    is_fair,
    nearest,
    of_one,
    percent,
    rounded,
    score_rows,
    several,
    source_figures,
    table_rows,
    together,
)
from sweeps.report.screen import by_frames, frames_text, note, print_grid, print_scores, settings

__all__ = ["accuracy_rows", "category_rows", "source_figures"]

CELL = ("range", "target_free_ifovs", "pulse_width")  # given in every title
BOUND = "likelihood"
TITLES = {
    "acn": "ACN",
    "mnn": "MNN, ship + aspects",
    "mnn_ship": "MNN, ship alone",
    "correlation": "correlation",
    "likelihood": "maximum likelihood",
}
REJECTING = {"acn": "ACN", "acn_infrared": "ACN on silhouettes"}
COUNTS = ("n_known", "n_unknown")  # of answers
REJECTED = ("rejected_unknown", "rejected_known", "correct_known")
AT_LEAST = "correct_where_rejected"
AREAS = ("auroc", "oscr")


def category_rows(tables: xr.Dataset) -> list[Row]:
    """Return categories formed (the article's Table 3), a row per training, over all orders."""
    source, rows = source_figures()["table3_categories"], []
    for row in formation_rows(tables):
        asked = as_in_source({"receiver": tables.attrs.get("receiver")} | row)
        asked = asked and row["vigilance"] == source["vigilance"] and is_fair(row, tables, "acn")
        theirs = source["categories"].get(row["pulse_width_ns"]) if asked else None
        del row["first"]
        views, settled = row.pop("views"), row.pop("settled")
        row["training_profiles"] = views
        row["compression"] = round(views / row["categories"], 2) if row["categories"] else None
        rows.append(row | {"settled": settled, "source_categories": theirs})
    return rows


def accuracy_rows(tables: xr.Dataset) -> list[Row]:
    """Return percent correct by aspect bin (the article's Table 4), training profiles first."""
    training = score_rows(tables, "training_", profiles="training")
    averaged = score_rows(tables, profiles="averaged")
    return beside_source(together(training, averaged), tables, "acn")


def print_categories(rows: list[Row], console: Console) -> None:
    """Print numbers of categories: pulse widths down, vigilances across."""
    vigilances = sorted({row["vigilance"] for row in rows})
    theirs = source_figures()["table3_categories"]["vigilance"]
    for place, group in settings(rows, CELL[:2], but=("pulse_width_ns", "vigilance")):
        table = sheet(
            f"Categories formed by the ACN ({place})",
            *("pulse width [ns]", "profiles", *(f"vigilance {one:g}" for one in vigilances)),
            dim=(f"source, {theirs:g}",),
            keys=1,
        )
        for (width,), line in grouped(group, ("pulse_width_ns",)).items():
            formed = {row["vigilance"]: row for row in line}
            beside = [row["source_categories"] for row in line if row["source_categories"]]
            table.add_row(
                *(shown(width), str(line[0]["training_profiles"])),
                *(_count(formed.get(vigilance)) for vigilance in vigilances),
                str(beside[0]) if beside else "",
            )
        show(table, console)
        if not all(row["settled"] for row in group if row["categories"]):
            note("* categories still changed in the last pass", console)
        if any(row["trainings"] > 1 for row in group):
            note("Means over orders of presentation; ±: standard deviation over them", console)


def _count(row: Row | None) -> str:
    if row is None:
        return ""
    if not row["categories"]:
        return "failed"
    several = f" ±{row['spread']:.1f}" if row["trainings"] > 1 else ""
    return f"{row['categories']:.{1 if several else 0}f}{several}" + "*" * (not row["settled"])


def print_accuracy(rows: list[Row], console: Console) -> None:
    """Print percent correct by number of frames and aspect bin, at the source's vigilance."""
    chosen = shown_vigilance(rows)
    printed = [row for row in of_one(rows) if row["vigilance"] == chosen]
    for place, group in settings(printed, (*CELL, "vigilance"), but=("frame_count", BIN)):
        print_scores(f"Percent correct, ACN ({place})", "frames", by_frames(group), console)
    if any(row["source_percent"] is not None for row in printed):
        note(f"Source: {source_figures()['table4_percent_correct']['note']}", console)
    others = "; other vigilances are in the CSV file" * (
        len({row["vigilance"] for row in rows}) > 1
    )
    note(f"95 % Wilson intervals{others}", console)


def shown_vigilance(rows: list[Row]) -> float | None:
    """Return the source's vigilance if it was swept, else the largest."""
    there = {row["vigilance"] for row in rows if row.get("vigilance") is not None}
    wanted: float = source_figures()["table4_percent_correct"]["vigilance"]
    return wanted if wanted in there else max(there, default=None)


def names_profiles(table: xr.Dataset) -> bool:
    """Return whether a table scores a classifier of range profiles."""
    figures, axes = {"accuracy", *ENDS, "n"}, {*CELL, "frame_count", "aspect_low"}
    return figures <= set(table) and axes <= set(table.coords)


def classifier_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """Return percent correct of every classifier in every setting, given its tables by name.

    Training profiles are included, without a number of frames.

    Notes
    -----
    The bound is maximum likelihood with the least known gain, the same for all rows and
    named in them, and with the true aspect left out if the row's classifier leaves it out.
    It is scored by ship, not by category or aspect group. A
    likelihood that knows more of the gain lies above it, at points below 0.
    """
    parts = []
    for name, table in tables.items():
        for prefix, label in (("", name), ("ship_", f"{name}_ship"), ("training_", name)):
            if f"{prefix}accuracy" in table:
                rows = score_rows(table, prefix, classifier=label)
                parts.append(beside_source(rows, table, label))
    rows = together(*parts)
    likelihoods = [row for row in rows if row["classifier"] == BOUND]
    gain = max((row["gain_sigma"] for row in likelihoods), default=None)
    axes = several(likelihoods, but=("gain_sigma", "left_out"))

    def place(row: Row) -> tuple[object, ...]:
        """Return the values that a row shares with its bound."""
        return (*(row.get(axis) for axis in axes), bool(row.get("left_out")))

    bounds = {
        place(row): row["percent_correct"] for row in likelihoods if row["gain_sigma"] == gain
    }
    for row in rows:
        bound, ours = bounds.get(place(row)), row["percent_correct"]
        of_ships = row["classifier"] != "mnn" and row.get("score_rule") in (None, "ship")
        bounded = of_ships and None not in (bound, ours, row.get("frame_count"))
        row["bound_gain_sigma"] = gain if bounded else None
        row["points_below_bound"] = round(bound - ours, 1) if bounded else None
    return rows


def print_classifiers(rows: list[Row], console: Console) -> None:
    """Print all classifiers by number of frames, one table for each pulse width and range."""
    vigilance = shown_vigilance(rows)
    printed = [row for row in rows if row.get("vigilance") in (None, vigilance)]
    tests = [row for row in printed if row["frame_count"] is not None]
    own = [axis for axis in axes_in(rows) if any(row[axis] is None for row in tests)]
    for place, group in settings(printed, CELL, but=(*own, "frame_count", BIN)):
        lines: list[tuple[str, list[Row]]] = []
        for frames, part in by_frames(group):
            lines.append((frames, []))
            for line in grouped(part, ("classifier", *own)).values():
                lines.append((_title(line[0], group, own), line))
        print_scores(f"Percent correct by classifier ({place})", "classifier", lines, console)
        _print_below(place, group, own, console)
    others = (row for row in printed if row["classifier"] != BOUND)
    gains = [row["bound_gain_sigma"] for row in others if row["bound_gain_sigma"] is not None]
    if gains:
        axis = next(axis for axis in axes_in(rows) if axis.name == "gain_sigma")
        note(
            "Points below the bound: distance to maximum likelihood with exact mean and "
            f"covariance of every view, {axis.told(max(gains))}, overall, without the true aspect "
            "if that is left out: the classifier's own share of errors. The rest, from the bound "
            "to 100, is due to noise. The bound is the best on average; in a few views another "
            "classifier may do better by chance.",
            console,
        )


def _print_below(place: str, group: list[Row], own: list[Axis], console: Console) -> None:
    """Print how far classifiers are below the bound: numbers of frames across."""
    rows = [
        {
            "classifier": _title(row, group, own),
            **{name: row[name] for name in ("frame_count", "points_below_bound")},
        }
        for row in group
        if row[BIN] == "overall" and row["classifier"] != BOUND
    ]
    rows = [row for row in rows if row["points_below_bound"] is not None]
    counts = sorted({row["frame_count"] for row in rows})
    if rows:
        print_grid(
            rows,
            lambda words: f"Points below the bound, all aspects ({place})",
            {"classifier": "classifier"},
            ("frame_count", {count: frames_text(count) for count in counts}),
            "points_below_bound",
            lambda points: f"{points:.0f}",
            console,
        )


def _title(row: Row, group: list[Row], own: list[Axis]) -> str:
    """Return the classifier, and the values that distinguish this setting from its others."""
    name = str(row["classifier"])
    same = [other for other in group if other["classifier"] == name]
    axes = [axis for axis in several(same) if axis in own]
    return ", ".join((TITLES.get(name, printable(name)), *told(row, axes)))


def rejection_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """Return rejection and correct rates at every test vigilance, given tables by classifier."""
    columns: dict[str, Column] = {
        (f"{name}{end}" if end else f"percent_{name}"): (f"{name}{end}", percent)
        for name in REJECTED
        for end in ("", *(f"_{end}" for end in ENDS))
    }
    columns |= {name: (name, int) for name in COUNTS}
    return together(
        *(table_rows(table, columns, {"classifier": name}) for name, table in tables.items())
    )


def curve_rows(tables: Mapping[str, xr.Dataset]) -> list[Row]:
    """Return correct rates at given shares of rejected answers to unknown ships."""
    columns: dict[str, Column] = {
        "rejected_up_to": ("rejected_up_to", finite),
        "percent_correct": (AT_LEAST, percent),
        **{end: (f"{AT_LEAST}_{end}", percent) for end in ENDS},
        **{name: (name, partial(rounded, digits=3)) for name in AREAS},
        **{name: (name, int) for name in COUNTS},
    }
    rows = []
    for name, table in tables.items():
        for row in table_rows(table, columns, {"classifier": name}):
            least = {"least_percent_rejected": percent(row.pop("least_rejected"))}
            axes = {key: row[key] for key in ("classifier", *axes_in([row]))}
            rows.append(axes | least | row)
    return together(rows)


def print_rejection(rows: list[Row], console: Console) -> None:
    """Print correct rates of known ships at given shares of rejected unknown ones."""
    rows = of_one(rows)
    named = several(rows, but=("aspects", "frame_count"))
    # Axes that some classifiers lack are given with the classifier's name.
    own = [axis for axis in named if any(row[axis] is None for row in rows)]
    shared = [axis for axis in axes_in(rows) if axis in named and axis not in own]
    shared += [axis for axis in axes_in(rows) if axis.name in ("aspects", "frame_count")]
    leasts = list(dict.fromkeys(row["least_percent_rejected"] for row in rows))
    table = sheet(
        "Known ships identified correctly [%], by share of unknown ships rejected",
        "known +\nunknown",
        *(f"{least:g}%" if least else "none" for least in leasts),
        *("AUROC", "OSCR"),
        left=("classifier",),
    )
    for place, group in grouped(rows, shared).items():
        table.add_row(", ".join(told(dict(zip(shared, place, strict=True)), shared)))
        for (name, *_), line in grouped(group, ("classifier", *own)).items():
            found = {row["least_percent_rejected"]: row for row in line}
            areas = (line[0][name] for name in AREAS)
            words = [REJECTING.get(name, TITLES.get(name, printable(str(name))))]
            table.add_row(
                "  " + ", ".join([*words, *told(line[0], own)]),
                f"{line[0]['n_known']} +\n{line[0]['n_unknown']}",
                *(_with_interval(found.get(least)) for least in leasts),
                *(NOTHING if area is None else f"{area:.2f}" for area in areas),
            )
    show(table, console)
    note(
        "At the least test vigilance that rejects at least that share. known + unknown: numbers of "
        "answers. AUROC, OSCR: areas under the curves of known ships accepted, and of those "
        "accepted and identified, over unknown ships accepted; by chance 0.5 and half the "
        "accuracy. Below each figure its 95 % Wilson interval, for that test vigilance; answers "
        "that are alike for one view, or in one draw, count for less (Kish's design effect).",
        console,
    )


def print_rates(rows: list[Row], console: Console) -> None:
    """Print rejection and correct rates at some test vigilances."""
    rows = of_one(rows)
    named = [axis for axis in several(rows) if axis.name != "test_vigilance"]
    there = {row["test_vigilance"] for row in rows}
    shown_ones = {nearest(tenth / 10, there) for tenth in range(11)}
    table = sheet(
        "Ships rejected and identified correctly [%] by test vigilance",
        *("test vigilance", "unknown rejected", "known rejected", "known correct"),
        left=("classifier",),
    )
    for key, group in grouped(rows, ("classifier", *named)).items():
        name = REJECTING.get(key[0], TITLES.get(key[0], printable(str(key[0]))))
        label = ", ".join([name, *told(group[0], named)])
        for row in group:
            if row["test_vigilance"] in shown_ones:
                figures = (row[f"percent_{figure}"] for figure in REJECTED)
                texts = (NOTHING if one is None else f"{one:.0f}" for one in figures)
                table.add_row(label, f"{row['test_vigilance']:g}", *texts)
                label = ""
    show(table, console)
    note("Intervals and all test vigilances are in the CSV file.", console)


def _with_interval(row: Row | None) -> str:
    """Return the correct rate of known ships, with the interval below."""
    if row is None or row["percent_correct"] is None:
        return NOTHING
    return f"{row['percent_correct']:.0f}\n{row['ci_low']:.0f}-{row['ci_high']:.0f}"
