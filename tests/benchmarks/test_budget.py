import re

import pytest

from benchmarks import budget
from benchmarks.reports import Column, Report, Sample, to_markdown

SMALL = budget.Views(
    ships=("duncan", "texas"),
    aspects=(0.0, 30.0, 60.0),
    between=(1.5, 31.5, 61.5),
    references=(30.0,),
    replicates=2,
)


@pytest.fixture(scope="module")
def rows():
    return {row["source"]: row for row in budget.measure(SMALL).rows}


def test_errors_stand_in_the_order_that_theory_gives_them(rows):
    """Rounding is below sampling, that below the step between templates, and that below noise."""
    error = {source: row["error"].median for source, row in rows.items()}
    assert error["float"] < 1e-3 < error["line"] < error["pixel"]
    assert error["far field"] < error["far field, plane waves"]
    assert error["pixel"] < error["template spacing"] < error["draws"]


def test_the_far_field_errs_within_its_bound(rows):
    share = float(re.search(r"at most (\S+) of its bound", rows["far field"]["how"])[1])
    assert 0.3 < share < 1


def test_bins_err_by_less_than_half_of_one(rows):
    """A bin puts area half a metre off at most, after a pulse of sigma = N_z / 4 = 1.59 m: by
    half the integral of its slope's magnitude, 1 / (sigma sqrt(2 pi)) = 25 %, if all of it were."""
    assert 0 < rows["bin"]["error"].high < 25


def test_the_table_goes_between_the_marks_and_nowhere_else(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{budget.BEGIN}\nold\n{budget.END}\nafter\n")
    report = Report(
        "title",
        (Column("a", "A"), Column("b", "B [%]", ".1f")),
        [{"a": "x", "b": Sample(1.0, 0.5, 2.0, 3)}],
        ["A note."],
    )
    for _ in range(2):  # again, the same
        budget.write(report, page)
        assert page.read_text() == (
            f"before\n{budget.BEGIN}\n\n{to_markdown(report)}\n{budget.END}\nafter\n"
        )
    assert "| A | B [%] |\n| --- | --: |\n| x | 1.0 (0.5–2.0) |\n\nA note.\n" in page.read_text()


def test_the_page_has_a_place_for_the_table():
    text = budget.PAGE.read_text(encoding="utf-8")
    assert text.count(budget.BEGIN) == text.count(budget.END) == 1
