"""Tables of the pages, written between the marker lines that name their commands."""

import re

import pytest

from benchmarks import __main__ as command
from benchmarks import fits, pages
from benchmarks.reports import Column, Report, Sample, to_markdown

REPORT = Report(
    "title",
    (Column("a", "A"), Column("b", "B [%]", ".1f")),
    [{"a": "x", "b": Sample(1.0, 0.5, 2.0, 3)}],
    ["A note."],
)


def test_tables_go_between_their_lines_and_nowhere_else(tmp_path):
    (tmp_path / "docs").mkdir()
    page, readme = tmp_path / "docs" / "page.md", tmp_path / "README.md"
    alone, of_several = pages.begin("budget"), pages.begin("results", "new")
    page.write_text(f"before\n{alone}\nold\n{pages.END}\nbetween\n{of_several}\n{pages.END}\n")
    readme.write_text(f"{alone} is no line of\n{pages.END} another\n".replace("budget", "bound"))
    kept, table = readme.read_text(), to_markdown(REPORT)
    for _ in range(2):  # again, the same
        pages.write({alone: REPORT, of_several: REPORT}, tmp_path)
        assert page.read_text() == (
            f"before\n{alone}\n\n{table}\n{pages.END}\nbetween\n{of_several}\n\n{table}\n{pages.END}\n"
        )
        assert readme.read_text() == kept
    assert table.endswith("| A | B [%] |\n| --- | --: |\n| x | 1.0 (0.5–2.0) |\n\nA note.\n")


@pytest.mark.parametrize("page", list(pages.pages()), ids=lambda page: page.stem)
def test_every_table_of_a_page_has_its_command(page):
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"<!-- begin: python -m benchmarks (\w+) --write(?: \(\w+\))? -->", text)
    assert len(named) == text.count("<!-- begin") == text.count(pages.END)
    assert set(named) <= set(command.REPORTS)


@pytest.mark.parametrize(
    "name", [*fits.REPORTS, "bounds", "budget", "coverage", "design", "mismatch"]
)
def test_every_report_of_the_pages_has_one_place(name):
    texts = [page.read_text(encoding="utf-8") for page in pages.pages()]
    assert sum(text.count(pages.begin(name)) for text in texts) == 1
