"""The file of the report page: self-contained, and replaced only if a report wrote it."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import sweeps.report
from ncti.text import printable
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.paths import PathOrUrl
from sweeps.engine.objects import Objects
from sweeps.engine.store.arrays import METADATA
from sweeps.report import explain
from sweeps.report.frames import Frame
from sweeps.report.outputs import (
    HEAD_BYTES,
    NO_DIGEST,
    PAGE_META,
    is_free,
    page_file,
    seal_page,
    write_atomically,
)
from sweeps.report.stores import error_reason

if TYPE_CHECKING:
    from sweeps.report.compare import Comparison

FOLDER = Path(sweeps.report.__file__).parent
TEMPLATES = FOLDER / "page" / "templates"
SOURCES = (".py", ".html", ".css", ".js", ".json", ".yaml", ".md")
STAMP = "ncti-store"  # name of the meta element that identifies the store of a page


def write_store_page(path: PathOrUrl, frames: Mapping[str, Frame]) -> list[Path]:
    """Write the page of a store with its tables; see `_write_page`."""
    from sweeps.report.page.content import store_content

    return _write_page(path, lambda: store_content(path, frames), path)


def write_comparison_page(compared: Comparison) -> list[Path]:
    """Write the page of a comparison; see `_write_page`."""
    from sweeps.report.page.content import comparison_content

    return _write_page(compared.output_path, lambda: comparison_content(compared), *compared.paths)


def _write_page(
    path: PathOrUrl, make: Callable[[], Mapping[str, Any]], *stores: PathOrUrl
) -> list[Path]:
    """Write the page beside a path atomically, with the content made of some stores.

    Returns the path of the page if another file is in its place. Raises ConfigurationError if a
    store cannot be read, or the page cannot be written.
    """
    page = page_file(path)
    if not is_free(page):  # found before drawing
        return [page]
    try:
        write_atomically(page, seal_page(render_template("page.html", make(), _stamp(*stores))))
    # zarr and xarray raise various errors for damaged groups without a table.
    except Exception as error:
        fault = getattr(error, "strerror", None) or error_reason(error)
        raise ConfigurationError(f"the report page is not written: {fault}") from error
    return []


def is_current(store: PathOrUrl) -> bool:
    """Return whether the page beside a store was made from it by this code."""
    try:
        with page_file(store).open(encoding="utf-8") as file:
            return f'<meta name="{STAMP}" content="{_stamp(store)}">' in file.read(HEAD_BYTES)
    except (OSError, UnicodeDecodeError):
        return False


def _stamp(*stores: PathOrUrl) -> str:
    """Return a digest of stores' attributes and of the report's sources."""
    attributes = b"".join(Objects(store).get(METADATA) or b"" for store in stores)
    digest = hashlib.sha256(attributes)
    for file in sorted(FOLDER.rglob("*")):
        if file.suffix in SOURCES:
            digest.update(file.read_bytes())
    return digest.hexdigest()[:32]


def render_template(template: str, content: Mapping[str, Any], stamp: str = "") -> str:
    """Render a template to HTML; escape the content, but not the template."""
    from jinja2 import Environment, FileSystemLoader
    from markupsafe import Markup

    def escape_value(value: Any) -> Any:
        """Return the value of an expression, with control characters of texts escaped."""
        if isinstance(value, str) and not isinstance(value, Markup):
            return printable(value)
        return value

    def heading_meanings(heading: str) -> str:
        """Return the glossary's meanings of the words of a heading."""
        words = heading.partition(" [")[0].split(", ")
        return "\n".join(filter(None, (explain.meaning(word) for word in words)))

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        finalize=escape_value,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["explained"] = heading_meanings
    style, *scripts = (
        (TEMPLATES / name).read_text(encoding="utf-8")
        for name in ("page.css", "vega.js", "charts.js", "headline.js", "page.js")
    )
    return environment.get_template(template).render(
        content,
        stamp=stamp,
        own=PAGE_META,
        digest=NO_DIGEST,
        style=Markup(style),
        scripts=list(map(Markup, scripts)),
        policy=_security_policy([style], scripts),
    )


def _security_policy(styles: list[str], scripts: list[str]) -> str:
    """Return a content security policy that allows these styles, scripts and embedded pictures."""

    def digests(texts: list[str]) -> str:
        hashes = (hashlib.sha256(text.encode()).digest() for text in texts)
        return " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in hashes)

    allowed = (f"style-src {digests(styles)}", f"script-src {digests(scripts)}")
    rest = ("img-src data:", "base-uri 'none'", "form-action 'none'")
    return "; ".join(("default-src 'none'", *allowed, *rest))
