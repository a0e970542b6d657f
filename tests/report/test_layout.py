"""Tables fit any console: no line is wider, no figure is lost, and no word is broken that fits."""

import io
import re

from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console

from sweeps.report.layout import sheet, show

WORDS = st.text("abcdefgh[]/°é", min_size=1, max_size=12)
TEXTS = st.lists(WORDS, min_size=1, max_size=5).map(" ".join)


@st.composite
def filled(draw):
    """Headings, number of keys and rows of a table."""
    keys, figures = draw(st.integers(0, 4)), draw(st.integers(1, 8))
    headings = draw(st.lists(TEXTS, min_size=keys + figures, max_size=keys + figures))
    row = st.tuples(*[TEXTS] * keys, *[WORDS] * figures)
    return headings, keys, draw(st.lists(row, min_size=1, max_size=4))


def printed(headings, keys, rows, width, title="A title of some words"):
    table = sheet(title, *headings[keys:], left=headings[:keys])
    for row in rows:
        table.add_row(*row)
    console = Console(file=io.StringIO(), width=width)
    show(table, console)
    return console.file.getvalue()


@given(filled(), st.integers(30, 120))
def test_no_line_is_wider_and_no_word_is_lost(made, width):
    headings, keys, rows = made
    text = printed(headings, keys, rows, width)
    assert max(map(cell_len, text.splitlines())) <= width
    words = re.split(r"[\s,]+", text)
    for texts in (headings[keys:], *rows):
        for word in " ".join(texts).split():
            assert word in words


@given(filled())
def test_a_wide_console_has_a_line_a_row(made):
    headings, keys, rows = made
    lines = printed(headings, keys, rows, 1000).splitlines()
    found = [re.split(r" {2,}", line.strip()) for line in lines[-len(rows) :]]
    assert found == [list(row) for row in rows]


def test_what_looks_like_markup_or_controls_a_terminal_is_text():
    hostile = ["[red]x[/red]", "\x1b[31mz", "[/]", "a\tb", "\x9b2J"]
    text = printed(["[bold]", "n"], 1, [(word, "1") for word in hostile], 80, title="[link=x]y")
    assert "[link=x]y" in text and "[bold]" in text
    for shown in ("[red]x[/red]", "\\x1b[31mz", "[/]", "a\\tb", "\\x9b2J"):
        assert shown in text
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", text)


def test_columns_without_a_place_stand_below_beside_the_same_labels():
    headings = ["ship", *(f"heading{k}" for k in range(6))]
    text = printed(headings, 1, [("duncan", *map(str, range(100, 106)))], 40)
    assert text.count("duncan") == 2 and text.count("further columns") == 1
    order = [text.index(str(figure)) for figure in range(100, 106)]
    assert order == sorted(order)


def test_labels_of_too_many_columns_become_one():
    headings = [*(f"label{k}" for k in range(8)), "figure"]
    text = printed(headings, 8, [(*(f"value{k}" for k in range(8)), "17")], 30)
    flat = " ".join(text.split())
    assert all(re.search(rf"label{k} (17 )?value{k}", flat) for k in range(8))
