"""Writing of the report page: reads a store, and renders the templates."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from sweeps.report import rows
from sweeps.report.axes import printable
from sweeps.report.fair import read_compared
from sweeps.report.own import BEGINNING, PAGE, UNKNOWN, is_free, put_page, sealed
from sweeps.report.page import confusion, layout, summary
from sweeps.report.page.cells import Cells
from sweeps.report.page.charts import shape_of
from sweeps.report.page.cubes import NAMED, TRUE, Axes, Axis, Cube, cubes_of, placed
from sweeps.report.page.pictures import Draw, pictures_of
from sweeps.report.page.ships import ships_of
from sweeps.report.places import page_file
from sweeps.report.work import read_work

HIDDEN = (TRUE, NAMED)  # axes without a selector
LARGEST = 200_000  # values of a variable; images and profiles have more
SOURCES = (".py", ".html", ".css", ".js")
STAMP = "ncti-store"  # name of the meta element that identifies the store of a page


def write_page(store: Path, draw: Draw) -> list[Path]:
    """Write the page of a store beside it, atomically.

    Returns the path if another file is in its place. `draw` draws a kind of figure from a store,
    like `sweeps.report.figures.draw`. Raises OSError if the store cannot be read, or the page
    cannot be written.
    """
    path = page_file(store)
    if not is_free(path):  # found before drawing
        return [path]
    return [] if put_page(path, page_of(store, draw).encode("utf-8", "replace")) else [path]


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


def page_of(path: Path, draw: Draw) -> str:
    """Return the page of a store. Raises OSError if the store cannot be read."""
    store = rows.opened(path)
    attributes = rows.attributes(store)
    axes, cubes, titles = _read(store, path.name)
    cells = Cells(cubes, axes)
    whole, classifiers = layout.score_sections(cubes, axes)
    settings = list(summary.flat(attributes.get("configuration", {})))
    several = [axis for axis in axes.values() if len(axis.texts) > 1 and axis.name not in HIDDEN]
    status = summary.status_of(store)
    content = {
        "store": path.name,
        "stamp": _stamp(path),
        "own": PAGE,
        "digest": UNKNOWN,
        "title": str(attributes.get("title", "Parameter sweep")),
        "status": status,
        "settings": [(key, summary.written(value)) for key, value in settings],
        "swept": summary.swept(settings, summary.units_of(store)),
        "selectors": several,
        "whole": whole,
        "classifiers": classifiers,
        "legend": layout.legend(cubes),
        "varied": {sheet.by for one in classifiers for sheet in one.sheets},
        "first": next((s.by for one in classifiers for s in one.sheets if s.shown), ""),
        "shape_of": shape_of,
        "charts": layout.score_charts(cubes, axes),
        "others": layout.other_sections(cubes, axes, titles),
        "matrices": confusion.laid_out(cubes, axes),
        "pictures": list(pictures_of(path, store, draw)),
        "ships": ships_of(store),
        "work": read_work(path),
        "provenance": summary.provenance(attributes),
        "seed": attributes.get("seed"),
        "cells": cells,
        "data": cells.data(),
    }
    return sealed(_rendered(content)).decode()


def _read(store: Any, name: str) -> tuple[dict[str, Axis], list[Cube], dict[str, str]]:
    """Return the axes and cubes of all tables of a store, and the tables' own titles."""
    axes, found, titles = Axes(), [], {}
    given = [f"tables/{one}" for one in rows.groups(store, "tables")]
    given += ["validation"] * ("validation" in rows.groups(store))
    for group in given:
        table = read_compared(store, group)
        small = [one for one in table.data_vars if table[one].size <= LARGEST]
        table = table[small].load()
        found += cubes_of(table, group, name, axes)
        if "title" in table.attrs:
            titles[group] = printable(str(table.attrs["title"]))
    for one in rows.groups(store, "classification"):
        group = f"classification/{one}"
        answers = rows.read(store, group)
        if "predicted" in answers:
            found += confusion.matrices_of(answers[["predicted"]].load(), group, name, axes)
    known = axes.finished()
    return known, [placed(cube, known) for cube in found], titles


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
    style, script = text("page.css"), text("page.js")
    return environment.get_template("page.html").render(
        **content,
        style=Markup(style),
        script=Markup(script),
        policy=_policy(style, script),
    )


def _policy(style: str, script: str) -> str:
    """Return a content security policy that allows this style, script and embedded pictures."""
    allowed = {"style-src": style, "script-src": script}
    hashes = (
        f"{key} 'sha256-{base64.b64encode(hashlib.sha256(one.encode()).digest()).decode()}'"
        for key, one in allowed.items()
    )
    return "; ".join(
        ("default-src 'none'", *hashes, "img-src data:", "base-uri 'none'", "form-action 'none'")
    )
