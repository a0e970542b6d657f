"""Content of the report page, for its template and its script."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from ncti.text import printable
from sweeps.engine.declare.paths import PathOrUrl, path_beside
from sweeps.report.changes import (
    change_sentences,
    largest_case,
    settings_sentence,
    settings_that_differ,
)
from sweeps.report.compare import Comparison
from sweeps.report.confusion import NAME as CONFUSION
from sweeps.report.confusion import confusion_frame, read_predictions
from sweeps.report.frames import PART, Column, Frame, values_of
from sweeps.report.headline import accuracy_sentences, headline, headline_for_script
from sweeps.report.page.provenance import iter_settings, status_of, swept_settings, yaml_text
from sweeps.report.pictures import CONFUSED, describe_ships, pictures_of
from sweeps.report.pivot import lay_out, main_value, select_main
from sweeps.report.ranking import main_axis
from sweeps.report.scales import axis_of, figure_of
from sweeps.report.stores import attributes, open_store
from sweeps.report.timings import NAME as TIMINGS
from sweeps.report.words import is_missing

MAX_ROWS = 4_000  # rows of a table; the CSV file has all
MAX_CHART_ROWS = 32_000  # rows of a table that its charts have
BINS = "aspect_bin_deg"  # the axis across that can be selected, too


def store_content(path: PathOrUrl, frames: Mapping[str, Frame]) -> dict[str, Any]:
    """Return the content of a store's page from its tables; OSError if it cannot be read."""
    store = open_store(path)
    attrs = attributes(store)
    predictions = read_predictions(store)
    timings, matrix = frames.get(TIMINGS), confusion_frame(predictions, frames)
    tables = {name: frame for name, frame in frames.items() if name != TIMINGS}
    sentences = headline(tables, attrs)
    axes, main_table = list(attrs.get("swept", ())), next(iter(tables.values()))
    if matrix is not None:
        tables = {main_table.name: main_table, CONFUSION: matrix, **tables}
    settings = list(iter_settings(attrs.get("configuration", {})))
    pictures = pictures_of(path, store, predictions)
    charts = chart_content(tables, axes, path_beside(path).name)
    charts["data"]["headline"] = headline_for_script(tables, attrs, MAX_CHART_ROWS)
    return {
        "store": path_beside(path).name,
        "about": attrs,
        "headline": sentences,
        "accuracy": accuracy_sentences(store),
        "status": status_of(store, timings),
        "settings": [(key, yaml_text(value)) for key, value in settings],
        "swept": swept_settings(store, settings),
        "confused": pictures.pop(CONFUSED, None),
        "pictures": pictures,
        "ships": describe_ships(store),
        "timings": None if timings is None else lay_out(timings),
        **charts,
    }


def comparison_content(compared: Comparison) -> dict[str, Any]:
    """Return the content of the page of a comparison; OSError if a store cannot be read."""
    stores = [open_store(path) for path in compared.paths]
    states = zip(compared.names, map(status_of, stores), strict=True)
    axes = list(attributes(stores[0]).get("swept", ()))
    first, *others = compared.names
    title = f"{', '.join(others)} less {first}"
    return {
        "store": title,
        "about": {"title": "Comparison of sweeps"},
        "headline": change_sentences(compared),
        "accuracy": [settings_sentence(compared)],
        "states": [(name, state) for name, state in states if state.word != "complete"],
        "compared": compared.names,
        "settings": settings_that_differ(compared),
        "pictures": {},
        "ships": [],
        **chart_content(compared.frames, axes, title, case=largest_case(compared)),
    }


def chart_content(
    frames: Mapping[str, Frame],
    swept: Sequence[str],
    store: str,
    *,
    along: str = "",
    colour: str = "",
    case: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Return the tables of a page, its selectors, and the data of its charts.

    `along` and `colour` are the columns of the axes of charts and of their colours, by default
    those of the headline. `case` has the values to select at first, by column.
    """
    # Rows and charts run along the axis of the headline.
    main = next(iter(frames.values()))
    other_axes = [name for name in main.varying_axes if name not in curves_of(main)]
    numbers = numeric_swept_axes(main, swept)
    against = next(filter(None, [along, main_axis(main, swept), *other_axes]), "")
    second = next((name for name in [*numbers, *other_axes] if name not in (against, BINS)), "")
    return {
        "against": against,
        # Without declared curves, a curve for each value of the second axis.
        "colour": colour or ("" if curves_of(main) else second),
        "curves": ", ".join(main.columns[name].words for name in curves_of(main)[:1]),
        "axes": axes_of(frames, case),
        "tables": [table_of(table, against, swept, case) for table in frames.values()],
        "data": {
            "store": store,
            "headline": None,
            "against": against,
            "second": second,
            "tables": {name: data_of(table) for name, table in frames.items()},
            # The position in this list is a classifier's colour, the same in every chart.
            "colours": list(
                dict.fromkeys(colour for frame in frames.values() for colour in colours_of(frame))
            ),
        },
    }


def numeric_swept_axes(frame: Frame, swept: Sequence[str]) -> list[str]:
    """Return the numeric swept axes that are not down or across, by number of values."""
    varying = [name for name in frame.varying_axes if name not in (*frame.down, frame.across)]
    names = [n for axis in swept for n in varying if frame.columns[n].axis == axis]
    numeric = [name for name in names if frame.rows[name].dtype.kind in "fiu"]
    return sorted(numeric, key=lambda name: -frame.rows[name].nunique())


def curves_of(frame: Frame) -> list[str]:
    """Return the declared axes down with several values; a chart has a curve for each value."""
    return [name for name in frame.down if name in frame.varying_axes]


def colours_of(frame: Frame) -> list[str]:
    """Return the words of the first declared axis down: curves of one of them have one colour."""
    words = [name for name in frame.down[:1] if frame.rows[name].dtype == object]
    return [text for name in words for text in _words_of(frame, name).values()]


def axes_of(
    frames: Mapping[str, Frame], case: Mapping[str, Any] | None = None
) -> list[dict[str, Any]]:
    """Return the selectors: axes of several values that are not down or across everywhere."""
    columns, values = dict[str, Column](), dict[str, list[Any]]()
    for frame in frames.values():
        for name in frame.varying_axes:
            if name in curves_of(frame) or (name == frame.across and name != BINS):
                continue
            columns.setdefault(name, frame.columns[name])
            axis_values = values.setdefault(name, [])
            axis_values += [v for v in values_of(frame.rows, name) if v not in axis_values]
    selectors = []
    for name, column in columns.items():
        if all(isinstance(value, int | float) for value in values[name]):
            values[name].sort()
        first = main_value(name, column.axis, values[name], case)
        options = [(json.dumps(_json_value(v)), column.text(v), v == first) for v in values[name]]
        selectors.append({"name": name, "column": column, "options": options})
    return selectors


def table_of(
    frame: Frame, against: str, swept: Sequence[str], case: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return a table of the page: all rows, with those of the first selection visible."""
    chosen = set(select_main(frame, [*curves_of(frame), against], case).rows.index)
    order = [frame.columns[name].axis for name in (against,) if name in frame.columns]
    table = lay_out(frame, [*order, *swept])
    lines = []
    for line in table.lines[:MAX_ROWS]:
        labels = [cell.row for cell in line.cells if cell.row is not None]
        lines.append((line, bool(chosen.intersection(labels)), labels[0] if labels else 0))
    return {
        "frame": frame,
        "figures": [frame.columns[name] for name in frame.figures],
        "down": table.down,
        "heads": table.heads,
        "lines": lines,
        "more": len(table.lines) - len(lines),
        "notes": table.notes,
    }


def data_of(frame: Frame) -> dict[str, Any]:
    """Return a frame for the script: its rows and the encodings of its charts."""
    rows, curves, columns = frame.rows.head(MAX_CHART_ROWS), curves_of(frame), frame.columns
    numeric = [name for name in frame.varying_axes if frame.rows[name].dtype.kind in "fiu"]
    along = [name for name in frame.varying_axes if name not in curves or name in numeric]
    along.sort(key=lambda name: (name == frame.across, -frame.rows[name].nunique()))
    return {
        "rows": {
            name: [_json_value(value) for value in rows[name].tolist()] for name in (*columns, PART)
        },
        "labels": rows.index.tolist(),
        "axes": frame.columns_of_role("axis"),
        "series": curves,
        "colour": next(iter(frame.down), ""),
        "words": {
            name: _words_of(frame, name)
            for name in (*frame.down, *[frame.across] * bool(frame.across))
        },
        "across": frame.across,
        # In the order in which charts prefer them; a matrix has no chart but its heat map.
        "along": [] if frame.name == CONFUSION else along,
        "x": {name: axis_of(columns[name], frame) for name in along},
        "figures": {name: figure_of(frame, name) for name in frame.figures},
        "matrix": [frame.across, frame.down[-1]] if frame.name == CONFUSION else [],
        "parts": [
            {
                "group": part.group,
                "variables": dict(part.variables),
                "dims": dict(part.dims),
                "names": dict(part.names),
                "labels": list(part.display.labels),
            }
            for part in frame.parts
        ],
        "factors": {name: column.factor for name, column in columns.items()},
        "headings": {name: column.heading for name, column in columns.items()},
    }


def _json_value(value: Any) -> Any:
    """Return a value of a frame for JSON, with control characters escaped."""
    if is_missing(value) or (isinstance(value, float) and not math.isfinite(value)):
        return None
    return printable(value) if isinstance(value, str) else value


def _words_of(frame: Frame, name: str) -> dict[str, str]:
    """Return the words of the values of an axis, by value."""
    words = frame.columns[name].text
    return {printable(str(value)): words(value) for value in values_of(frame.rows, name)}
