"""Parser of report pages, for their elements and the data of their scripts."""

import json
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

import zarr
from stores import signed

from sweeps.report.outputs import page_file
from sweeps.report.page.write import write_store_page
from sweeps.report.summary import tables_of

VOID = {"meta", "link", "img", "br", "input"}


@dataclass
class Element:
    """An element of the page, with the text inside it."""

    tag: str
    attrs: dict[str, str]
    text: str = ""
    children: list["Element"] = field(default_factory=list)

    def all(self, tag: str, **attrs: str) -> list["Element"]:
        """Return descendants of a tag with given attributes, in document order."""
        attributes = {key.replace("_", "-"): value for key, value in attrs.items()}
        matching = [
            child
            for child in self.children
            if child.tag == tag and attributes.items() <= child.attrs.items()
        ]
        elements = []
        for child in self.children:
            elements += [child] * (child in matching) + child.all(tag, **attrs)
        return elements

    def only(self, tag: str, **attrs: str) -> "Element":
        """Return the only such descendant."""
        (element,) = self.all(tag, **attrs)
        return element


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open = [Element("", {})]

    def handle_starttag(self, tag, attrs):
        element = Element(tag, {key: value or "" for key, value in attrs})
        self.open[-1].children.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open[-1].tag == tag, (tag, self.open[-1].tag)
            self.open.pop()

    def handle_data(self, data):
        for element in self.open:
            element.text += data


def _refused(name: str) -> None:
    raise ValueError(f"{name} is not JSON, and no browser reads it")


@dataclass
class Page:
    """A page: its text as written, its root, and the frames of its script."""

    written: str
    root: Element

    @property
    def data(self) -> dict:
        """Return the data of the script."""
        text = self.root.only("script", type="application/json").text
        return json.loads(text, parse_constant=_refused)


def parsed(written: str) -> Page:
    """Return a page from its text; fails where its elements do not nest."""
    reader = _Reader()
    reader.feed(written)
    assert len(reader.open) == 1
    return Page(written, reader.open[0])


def read_page(path: Path) -> Page:
    """Return the page of a file."""
    return parsed(path.read_text(encoding="utf-8"))


def stored(path, attributes=None, **groups):
    """Write datasets as groups of a store; `__` in a group's name stands for a slash."""
    for name, dataset in groups.items():
        dataset.to_zarr(path, group=name.replace("__", "/"), mode="a", consolidated=False)
    zarr.open_group(path, mode="a").attrs.update(attributes or {})
    return signed(path)


def page_of(path):
    """Return the HTML text of a store's report page."""
    assert write_store_page(path, tables_of(path)) == []
    return page_file(path).read_text(encoding="utf-8")
