"""Tables of the pages: between two marker lines that name their command, or CSV files.

The CSV files are in docs/tables, named after command and table: `results_new.csv`. An empty file of
such a name is filled by the command's next `--write`.
"""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from benchmarks.reports import Report, cells

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = "python -m docs._tables"
END = "<!-- end -->"
WIDTH = 120
"""Columns of a line of prose in a page."""


def begin(command: str, table: str = "") -> str:
    """Return the line after which a report is written, or one table of several."""
    return f"<!-- begin: {PROGRAM} {command} --write{f' ({table})' * bool(table)} -->"


def csv_file(command: str, table: str = "", root: Path = ROOT) -> Path:
    """Return the CSV file of a report, or of one table of several."""
    return root / "docs" / "tables" / f"{'_'.join(filter(None, (command, table)))}.csv"


def pages(root: Path = ROOT) -> Iterator[Path]:
    """Yield the pages that may have tables."""
    yield root / "README.md"
    yield from sorted(root.glob("docs/*.md"))


def write(reports: Mapping[tuple[str, str], Report], root: Path = ROOT) -> None:
    """Write reports into the pages with their marker lines, and into CSV files that exist.

    Parameters
    ----------
    reports : mapping of (str, str) to Report
        Tables by command and, where it has several, the table's name.
    root : Path
        Folder of the repository.
    """
    for page in pages(root):
        text = page.read_text(encoding="utf-8")
        for name, report in reports.items():
            line = begin(*name)
            if line in text:
                before, rest = text.split(line)
                _, after = rest.split(END, 1)
                text = f"{before}{line}\n\n{to_markdown(report)}\n{END}{after}"
        page.write_text(text, encoding="utf-8")
    for name, report in reports.items():
        path = csv_file(*name, root=root)
        if path.is_file():
            path.write_text(to_csv(report), encoding="utf-8")


def to_markdown(report: Report) -> str:
    """Return a report as a table of Markdown, its notes below."""

    def line(cells: Iterable[str]) -> str:
        return "| " + " | ".join(cells) + " |\n"

    heads, *rows = map(line, cells(report))
    rules = line("---" if column.spec == "s" else "--:" for column in report.columns)
    notes = (f"\n{_wrap_note(note)}\n" for note in report.notes)
    return heads + rules + "".join(rows) + "".join(notes)


def to_csv(report: Report) -> str:
    """Return the table of a report as CSV, with the same text in its cells and without notes."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(cells(report))
    return text.getvalue()


def _wrap_note(note: str) -> str:
    """Return a note wrapped so that no line begins with %, which marks a comment in MyST."""
    glued = note.replace(" %", "\N{NO-BREAK SPACE}%")
    lines = textwrap.fill(glued, WIDTH, break_long_words=False, break_on_hyphens=False)
    return lines.replace("\N{NO-BREAK SPACE}", " ")
