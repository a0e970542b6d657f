"""Refuse pages that load anything from a network, so that the site opens from a disk."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

# Attributes whose address a browser loads by itself.
LOADED = {
    "script": ("src",),
    "link": ("href",),
    "img": ("src", "srcset"),
    "source": ("src", "srcset"),
    "video": ("src", "poster"),
    "audio": ("src",),
    "iframe": ("src",),
    "embed": ("src",),
    "object": ("data",),
    "image": ("href", "xlink:href"),
    "use": ("href", "xlink:href"),
}
ELSEWHERE = re.compile(r"\s*(https?:)?//", re.I)
IN_STYLE = re.compile(r"""(?:url\(|@import)\s*["']?\s*((?:https?:)?//[^"')\s]+)""", re.I)


class _ExternalLoads(HTMLParser):
    """Parser that collects the external addresses that a page loads."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._in_style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._in_style = tag == "style"
        values = {name: value or "" for name, value in attrs}
        if tag == "link" and values.get("rel") in ("canonical", "alternate"):
            return
        for name in LOADED.get(tag, ()):
            if ELSEWHERE.match(values.get(name, "")):
                self.found.append(values[name])
        self.found += IN_STYLE.findall(values.get("style", ""))

    def handle_endtag(self, tag: str) -> None:
        self._in_style = False

    def handle_data(self, data: str) -> None:
        if self._in_style:
            self.found += IN_STYLE.findall(data)


def loads_of_page(html: str) -> list[str]:
    """Return the addresses of scripts, style sheets, pictures and fonts elsewhere."""
    page = _ExternalLoads()
    page.feed(html)
    return page.found


def loads_of_site(folder: Path) -> list[str]:
    """Return a line for each such address in the pages and style sheets of a folder."""
    loads = []
    for path in sorted(folder.rglob("*")):
        if path.suffix == ".html":
            addresses = loads_of_page(path.read_text(encoding="utf-8"))
        elif path.suffix == ".css":
            addresses = IN_STYLE.findall(path.read_text(encoding="utf-8"))
        else:
            continue
        loads += [f"{path.relative_to(folder)} loads {address}" for address in addresses]
    return loads


def check(app: Any, error: Exception | None) -> None:
    """Fail a build whose pages need a network."""
    # Imported here, so that tests of the functions above run without Sphinx.
    from sphinx.errors import ExtensionError

    if error is not None or app.builder.format != "html":
        return
    if loads := loads_of_site(Path(app.outdir)):
        raise ExtensionError("pages need a network: " + "; ".join(loads))


def setup(app: Any) -> dict[str, Any]:
    """Check the site when it is built."""
    app.connect("build-finished", check)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
