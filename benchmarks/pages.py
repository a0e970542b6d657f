"""Tables of the pages, each between two marker lines that name its command."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from benchmarks.reports import Report, to_markdown

ROOT = Path(__file__).resolve().parent.parent
END = "<!-- end -->"


def begin(command: str, table: str = "") -> str:
    """Return the line after which a report is written, or one table of several."""
    return f"<!-- begin: python -m benchmarks {command} --write{f' ({table})' * bool(table)} -->"


def pages(root: Path = ROOT) -> Iterator[Path]:
    """Yield the pages that may have tables."""
    yield root / "README.md"
    yield from sorted(root.glob("docs/*.md"))


def write(reports: Mapping[str, Report], root: Path = ROOT) -> None:
    """Write reports, by the lines after which they stand, into the pages that have such lines."""
    for page in pages(root):
        text = page.read_text(encoding="utf-8")
        for line, report in reports.items():
            if line in text:
                before, rest = text.split(line)
                _, after = rest.split(END, 1)
                text = f"{before}{line}\n\n{to_markdown(report)}\n{END}{after}"
        page.write_text(text, encoding="utf-8")
