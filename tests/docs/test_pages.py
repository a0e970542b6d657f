"""Tables stand between lines of the pages that name their commands, or in CSV files."""

import csv
import re

import pytest

from benchmarks.reports import Column, Report, Sample
from docs._tables import __main__ as command
from docs._tables import pages
from docs._tables.pages import to_markdown

MAX_PAGE_ROWS = 12  # rows of a table on a page; longer ones are CSV files
DECLARED = {"settings", "stage_inputs"}  # of declarations: tests/sweeps/test_declarations.py
TABLES = sorted((pages.ROOT / "docs" / "tables").glob("*.csv"))
REPORT = Report(
    "title",
    (Column("a", "A"), Column("b", "B [%]", ".1f")),
    [{"a": "x", "b": Sample(1.0, 0.5, 2.0, 3)}],
    ["A note."],
)


def test_tables_are_written_only_between_their_markers(tmp_path):
    (tmp_path / "docs").mkdir()
    page, readme = tmp_path / "docs" / "page.md", tmp_path / "README.md"
    alone, of_several = pages.begin("budget"), pages.begin("results", "new")
    page.write_text(f"before\n{alone}\nold\n{pages.END}\nbetween\n{of_several}\n{pages.END}\n")
    readme.write_text(f"{alone} is no line of\n{pages.END} another\n".replace("budget", "bound"))
    kept, table = readme.read_text(), to_markdown(REPORT)
    for _ in range(2):  # writing again changes nothing
        pages.write({("budget", ""): REPORT, ("results", "new"): REPORT}, tmp_path)
        assert page.read_text() == (
            f"before\n{alone}\n\n{table}\n{pages.END}\nbetween\n{of_several}\n\n{table}\n{pages.END}\n"
        )
        assert readme.read_text() == kept
    assert table.endswith("| A | B [%] |\n| --- | --: |\n| x | 1.0 (0.5–2.0) |\n\nA note.\n")


def test_existing_csv_file_is_updated_with_the_table(tmp_path):
    (tmp_path / "README.md").touch()
    asked, other = (pages.csv_file("results", name, tmp_path) for name in ("new", "known"))
    asked.parent.mkdir(parents=True)
    asked.touch()
    cells = Report(
        "", (Column("a", "A"), Column("b", "B")), [{"a": "x, y", "b": None}], ["A note."]
    )
    pages.write({("results", "new"): cells, ("results", "known"): REPORT}, tmp_path)
    assert asked.read_text() == 'A,B\n"x, y",\n'
    assert not other.exists()


def test_notes_are_wrapped_between_words_and_never_before_a_percent_sign():
    """A line that begins with the sign is a comment of MyST."""
    for shift in range(8):
        note = "a" * shift + " store=a-b.zarr 95 %" * 20
        report = Report("", (Column("a", "A"),), [{"a": "x"}], [note.strip()])
        lines = to_markdown(report).split("\n\n")[1].splitlines()
        assert " ".join(lines) == note.strip()
        assert max(map(len, lines)) <= 120 and not any(line.startswith("%") for line in lines)


@pytest.mark.parametrize("page", list(pages.pages()), ids=lambda page: page.stem)
def test_every_table_of_a_page_has_its_command(page):
    text = page.read_text(encoding="utf-8")
    named = re.findall(rf"<!-- begin: {pages.PROGRAM} (\w+) --write(?: \(\w+\))? -->", text)
    assert len(named) == text.count("<!-- begin") == text.count(pages.END)
    assert set(named) <= set(command.REPORTS)
    for printed in re.findall(f"<!-- begin.*?{pages.END}", text, re.S):
        assert len(re.findall(r"^\|", printed, re.M)) - 2 <= MAX_PAGE_ROWS, printed[:80]


@pytest.mark.parametrize("path", TABLES, ids=lambda path: path.stem)
def test_every_csv_file_has_a_command_a_link_and_columns_of_different_names(path):
    names = {*command.REPORTS, *DECLARED}
    assert any(path.stem == name or path.stem.startswith(f"{name}_") for name in names)
    linked = f"](tables/{path.name})"
    assert any(linked in page.read_text(encoding="utf-8") for page in pages.pages())
    headings, *rows = csv.reader(path.open(encoding="utf-8"))
    assert len(set(headings)) == len(headings)
    assert rows and all(len(row) == len(headings) for row in rows)


@pytest.mark.parametrize(
    "name", [*command.FITS, "bounds", "budget", "coverage", "design", "mismatch"]
)
def test_every_report_is_in_one_place_of_the_docs(name):
    texts = [page.read_text(encoding="utf-8") for page in pages.pages()]
    printed = sum(text.count(pages.begin(name)) for text in texts)
    assert printed + (pages.csv_file(name) in TABLES) == 1
