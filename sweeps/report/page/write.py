"""The report page: one file with everything in it, made from the frames of a store."""

from __future__ import annotations

import base64
import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from sweeps.report.chart import axis_of, specification
from sweeps.report.compare import sentences
from sweeps.report.confusion import confusion_of
from sweeps.report.frames import PART, Frame, values_of
from sweeps.report.headline import headline, main_axis
from sweeps.report.own import BEGINNING, PAGE, UNKNOWN, is_free, put_page, sealed
from sweeps.report.page import summary
from sweeps.report.page.pictures import pictures_of
from sweeps.report.page.ships import ships_of
from sweeps.report.pivot import at_main, laid_out, ordered
from sweeps.report.places import page_file
from sweeps.report.stores import attributes, opened
from sweeps.report.summary import tables_of
from sweeps.report.words import missing, preferred, printable
from sweeps.report.work import NAME as WORK

SOURCES = (".py", ".html", ".css", ".js", ".yaml")
STAMP = "ncti-store"  # name of the meta element that identifies the store of a page
MOST = 4_000  # rows of a table; the CSV file has all
FALLBACK = "frame_count"  # the axis of charts where nothing was swept


def write_page(
    store: Path, beside: Path | None = None, *, first: Frame | None = None
) -> list[Path]:
    """Write the page of a store beside it, or beside another path, atomically.

    With `first`, differences from another store, which come first. Returns the path if another
    file is in its place. Raises OSError if the store cannot be read, or the page cannot be written.
    """
    path = page_file(beside or store)
    if not is_free(path):  # found before drawing
        return [path]
    return [] if put_page(path, page_of(store, first).encode("utf-8", "replace")) else [path]


def is_current(store: Path) -> bool:
    """Return whether the page beside a store was made from it by this code."""
    try:
        with page_file(store).open(encoding="utf-8") as file:
            return f'<meta name="{STAMP}" content="{_stamp(store)}">' in file.read(BEGINNING)
    except (OSError, UnicodeDecodeError):
        return False


def _stamp(store: Path) -> str:
    """Return a digest of a store's attributes, of the version and of the report's sources."""
    try:
        known = version("ncti-sweep")
    except PackageNotFoundError:
        known = ""
    digest = hashlib.sha256(known.encode() + (store / "zarr.json").read_bytes())
    for content in _sources(files("sweeps.report")):
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()[:32]


def _sources(folder: Traversable) -> Iterator[bytes]:
    """Yield the content of every module and template below a folder, by name."""
    for one in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if one.is_dir():
            yield from _sources(one)
        elif one.name.endswith(SOURCES):
            yield one.read_bytes()


def page_of(path: Path, first: Frame | None = None) -> str:
    """Return the page of a store, with a table before its own; OSError if it cannot be read."""
    store = opened(path)
    about = attributes(store)
    own = tables_of(path)
    work = own.pop(WORK, None)
    frames = ({first.name: first} if first is not None else {}) | own
    matrix = confusion_of(store)
    whole = frames | ({matrix.name: matrix} if matrix is not None else {})
    whole = {name: _with_part(one) for name, one in whole.items()}
    swept = list(about.get("swept", ()))
    against = against_of(whole, swept)
    settings = list(summary.flat(about.get("configuration", {})))
    selectors = selectors_of(whole)
    content = {
        "store": path.name,
        "stamp": _stamp(path),
        "own": PAGE,
        "digest": UNKNOWN,
        "title": str(about.get("title", "Parameter sweep")),
        "headline": headline(own, about) if first is None else sentences(first),
        "status": summary.status_of(store),
        "settings": [(key, summary.written(value)) for key, value in settings],
        "swept": summary.swept(settings, summary.units_of(store)),
        "selectors": selectors,
        "against": against,
        "axes": axes_of(whole),
        "tables": [table_of(one, against, swept, path.name) for one in whole.values()],
        "pictures": list(pictures_of(path, store)),
        "ships": ships_of(store),
        "work": None if work is None else laid_out(work),
        "provenance": summary.provenance(about),
        "seed": about.get("seed"),
        "data": {
            "store": path.name,
            "selectors": [one["name"] for one in selectors],
            "tables": {name: data_of(one) for name, one in whole.items()},
            # Their places give curves a colour, the same in every chart.
            "curves": list(
                dict.fromkeys(
                    name for one in frames.values() for name in _series_of(_with_part(one))
                )
            ),
        },
    }
    return sealed(_rendered(content)).decode()


def _with_part(frame: Frame) -> Frame:
    """Return a frame whose rows all have a part."""
    if PART in frame.rows:
        return frame
    return replace(frame, rows=frame.rows.assign(**{PART: 0}))


def series_axes(frame: Frame) -> list[str]:
    """Return the declared axes down of several values: a curve for each of their values."""
    return [name for name in frame.down if name in frame.several()]


def _series_of(frame: Frame) -> list[str]:
    axes = series_axes(frame)
    places = frame.rows[axes].drop_duplicates().itertuples(index=False) if axes else []
    return [
        ", ".join(
            frame.columns[name].text(value)
            for name, value in zip(axes, place, strict=True)
            if not missing(value)
        )
        for place in places
    ]


def axes_of(frames: Mapping[str, Frame]) -> dict[str, str]:
    """Return headings of the axes of several values, which charts may be against, by column."""
    found: dict[str, str] = {}
    for one in frames.values():
        for name in one.several():
            if not set((one.columns[name].axis,)) & {"classifier", "channel", "scored"}:
                found.setdefault(name, one.columns[name].heading)
    return found


def against_of(frames: Mapping[str, Frame], swept: list[str]) -> str:
    """Return the axis down and along charts at first: the swept one, else that of frames."""
    first = next(iter(frames.values()))
    names = [name for name in first.several() if name not in (first.across, *series_axes(first))]
    found = main_axis(first, swept) or (FALLBACK if FALLBACK in names else "")
    return found or next(iter([*names, *axes_of(frames)]), "")


def selectors_of(frames: Mapping[str, Frame]) -> list[dict[str, Any]]:
    """Return the axes to select: of several values, and not down or across everywhere."""
    found: dict[str, dict[str, Any]] = {}
    for one in frames.values():
        for name in one.several():
            if name in series_axes(one) or (name == one.across and name != "aspect_bin_deg"):
                continue
            column, values = one.columns[name], values_of(one.rows, name)
            known = found.setdefault(
                name,
                {"name": name, "column": column, "heading": column.heading, "values": []},
            )
            known["values"] += [value for value in values if value not in known["values"]]
    for axis in found.values():
        values = axis["values"]
        if all(isinstance(value, int | float) for value in values):
            values.sort()
        first, column = preferred(axis["column"].axis, values), axis["column"]
        axis["options"] = [(json.dumps(_for_json(v)), column.text(v), v == first) for v in values]
    return list(found.values())


def table_of(frame: Frame, against: str, swept: list[str], store: str) -> dict[str, Any]:
    """Return a table of the page: all rows, of which those of the first selection are shown."""
    keep = [*series_axes(frame), against]
    chosen = set(at_main(frame, keep).rows.index)
    order = [frame.columns[name].axis for name in (against,) if name in frame.columns]
    table = laid_out(frame, [*order, *swept])
    names = ordered(frame, [*order, *swept])
    lines = []
    for line in table.lines[:MOST]:
        labels = [cell.row for cell in line.cells if cell.row is not None]
        lines.append((line, bool(chosen.intersection(labels)), labels[0] if labels else 0))
    seen = [line.keys for line, is_shown, _ in lines if is_shown]
    fixed = [len({keys[k] for keys in seen} - {""}) < 2 for k in range(len(names))]
    return {
        "name": frame.name,
        "title": frame.title,
        "down": list(zip(names, table.down, fixed, strict=True)),
        "heads": table.heads,
        "lines": lines,
        "more": len(table.lines) - len(lines),
        "notes": table.notes,
        "figures": [(name, frame.columns[name].heading) for name in frame.figures],
        "meanings": [(frame.columns[n].words, frame.columns[n].meaning) for n in frame.figures],
        "charted": frame.name != "confusion",
        "code": _code_of(frame, lines[0][2], store) if lines else "",
    }


def _code_of(frame: Frame, label: Any, store: str) -> str:
    """Return the Python that reads the main figure of a row; empty if it has no variable."""
    row = frame.rows.loc[label].to_dict()
    part = frame.parts[int(row[PART])] if frame.parts else None
    figure = frame.figures[0]
    if part is None or figure not in part.variables:
        return ""
    values = {dim: row[part.names[dim]] for dim in part.dims[figure] if dim in part.names}
    place = ", ".join(
        f"{dim}={value.item() if hasattr(value, 'item') else value!r}"
        for dim, value in values.items()
        if not missing(value)
    )
    opened_as = f"xr.open_zarr({store!r}, group={part.group!r})"
    factor = "100 * " if frame.columns[figure].unit == "%" else ""
    return f"{factor}float({opened_as}[{part.variables[figure]!r}].sel({place}))"


def data_of(frame: Frame) -> dict[str, Any]:
    """Return a frame for the script: its rows, and how its charts are specified."""
    rows = frame.rows.head(MOST * 8)
    return {
        "rows": {
            name: [_for_json(value) for value in rows[name].tolist()]
            for name in (*frame.columns, PART)
        },
        "labels": rows.index.tolist(),
        "axes": frame.of_role("axis"),
        "series": series_axes(frame),
        "words": {name: _words_of(frame, name) for name in series_axes(frame)},
        "across": frame.across,
        "x": {
            name: axis_of(frame.columns[name], frame)
            for name in frame.several()
            if name not in series_axes(frame) or frame.rows[name].dtype.kind in "fiu"
        },
        "specs": {name: specification(frame, name) for name in frame.figures}
        if frame.name != "confusion"
        else {},
        "parts": [
            {
                "group": part.group,
                "variables": dict(part.variables),
                "dims": {name: list(dims) for name, dims in part.dims.items()},
                "names": dict(part.names),
                "labels": list(part.display.labels),
            }
            for part in frame.parts
        ],
        "units": {name: column.unit for name, column in frame.columns.items()},
        "headings": {name: column.heading for name, column in frame.columns.items()},
    }


def _for_json(value: Any) -> Any:
    """Return a value of a frame as JSON has it, control characters of texts escaped."""
    if missing(value) or (isinstance(value, float) and not math.isfinite(value)):
        return None
    return printable(value) if isinstance(value, str) else value


def _words_of(frame: Frame, name: str) -> dict[str, str]:
    words = frame.columns[name].text
    return {printable(str(value)): words(value) for value in values_of(frame.rows, name)}


def _rendered(content: Mapping[str, Any]) -> str:
    """Return the rendered page; everything but templates is escaped."""
    from jinja2 import Environment, FunctionLoader
    from markupsafe import Markup

    folder = files("sweeps.report.page").joinpath("templates")

    def text(name: str) -> str:
        return folder.joinpath(name).read_text(encoding="utf-8")

    def visible(value: Any) -> Any:
        """Return the value of an expression, with control characters of texts escaped."""
        if isinstance(value, str) and not isinstance(value, Markup):
            return printable(value)
        return value

    environment = Environment(
        loader=FunctionLoader(text),
        autoescape=True,
        finalize=visible,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style, scripts = text("page.css"), [text("vega.js"), text("page.js")]
    return environment.get_template("page.html").render(
        **content,
        style=Markup(style),
        scripts=list(map(Markup, scripts)),
        policy=_policy([style], scripts),
    )


def _policy(styles: list[str], scripts: list[str]) -> str:
    """Return a content security policy that allows these styles, scripts and embedded pictures."""

    def digests(texts: list[str]) -> str:
        found = (hashlib.sha256(one.encode()).digest() for one in texts)
        return " ".join(f"'sha256-{base64.b64encode(one).decode()}'" for one in found)

    allowed = (f"style-src {digests(styles)}", f"script-src {digests(scripts)}")
    rest = ("img-src data:", "base-uri 'none'", "form-action 'none'")
    return "; ".join(("default-src 'none'", *allowed, *rest))
