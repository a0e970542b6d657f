"""Printed tables fit the width of the screen, break no word and lose no figure."""

import io
import math

import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from made import scores
from rich.cells import cell_len
from rich.console import Console

from sweeps.engine.declare.display import Display, Figure
from sweeps.report.frames import tidy_frame
from sweeps.report.pivot import lay_out
from sweeps.report.summary import tables_of
from sweeps.report.terminal import entry_text, print_table
from sweeps.stages.scores import score_displays

DISPLAY, *_ = score_displays(
    {"classifier": "acn", "channel": "range"}, scored="ship", source="", chance=(25.0, 25.0)
)


def printed(frame, width, swept=(), max_rows=None):
    console = Console(file=io.StringIO(), width=width)
    print_table(lay_out(frame, swept), console, max_rows=max_rows)
    return console.file.getvalue()


@pytest.fixture(scope="module")
def frames(smoke_store, sisters):
    """Return all tables of two stores, and one table along many axes."""
    axes = {"vigilance": [0.9, 0.95], "cnr": [20.0, 30.0], "frame_count": [4, 16]}
    more = {"pulse_width": [30.0, 50.0], "gain_sigma": [0.0, 1.0], "left_out": [False, True]}
    many = tidy_frame(scores(**axes, **more), DISPLAY, "tables/acn")
    return [*tables_of(smoke_store).values(), *tables_of(sisters).values(), many]


@pytest.mark.parametrize("width", [60, 80, 200])
def test_tables_fit_the_width_without_breaking_words(width, frames):
    for frame in frames:
        laid, text = lay_out(frame), printed(frame, width)
        assert max(map(cell_len, text.splitlines())) <= width, frame.name
        words = set(text.split())
        assert {word for head in laid.heads for word in head.split()} <= words, frame.name
        for line in laid.lines:
            assert {cell.text for cell in line.cells if cell.text} <= words


@given(
    words=st.lists(
        st.text("abc é漢", min_size=1, max_size=30), min_size=1, max_size=4, unique=True
    ),
    width=st.integers(40, 120),
)
def test_arbitrary_labels_fit_the_width(words, width):
    table = scores(word=[f"{k} {word}" for k, word in enumerate(words)], size=[1.0, 2.0])
    text = printed(tidy_frame(table, DISPLAY, "tables/acn"), width)
    assert max(map(cell_len, text.splitlines())) <= width


def test_the_swept_axis_comes_first():
    frame = tidy_frame(scores(cnr=[20.0, 30.0], frame_count=[4, 16]), DISPLAY, "tables/acn")
    for swept, first, second in (("cnr", "CNR", "count"), ("frame_count", "count", "CNR")):
        heading = printed(frame, 120, [swept]).partition("─")[0].splitlines()[-1]
        assert heading.index(first) < heading.index(second)


def test_excess_axes_become_sections_and_repeated_labels_are_blank():
    axes = {"vigilance": [0.9, 0.95], "cnr": [20.0, 30.0], "frame_count": [4, 16]}
    lines = printed(tidy_frame(scores(**axes), DISPLAY, "tables/acn"), 60).splitlines()
    sections = [lines.index(f"vigilance {value}") for value in (0.9, 0.95)]
    for start in sections:
        labels = [line[:17].split() for line in lines[start + 1 : start + 5]]
        assert labels == [["20", "4"], ["16"], ["30", "4"], ["16"]]


def test_rows_that_are_left_out_are_counted():
    frame = tidy_frame(scores(cnr=[20.0, 30.0], frame_count=[4, 8, 16]), DISPLAY, "tables/acn")
    assert len(lay_out(frame).lines) == 6
    assert "4 more rows are in scores.csv" in printed(frame, 120, max_rows=2)


def test_notes_explain_chance_and_wide_intervals():
    table = scores(size=[1.0, 2.0])
    for n in (29, 30):
        table.n[:] = n
        text = printed(tidy_frame(table, DISPLAY, "tables/acn"), 200)
        assert "By chance: 25 %." in text and "variation between aspect bins" in text
        assert (f"few (minimum n = {n})" in text) == (n < 30)


def test_infinity_is_printed_with_the_label_of_its_variable():
    needed = {"frames": [4.0, math.inf, math.inf], "frames_low": [2.0, 90.0, math.inf]}
    needed |= {"frames_high": [9.0, math.inf, math.inf]}
    table = xr.Dataset(
        {name: ("range", values) for name, values in needed.items()}, {"range": [25.0, 50.0, 100.0]}
    )
    table.frames.attrs["infinite"] = "more than 128"
    frame = tidy_frame(
        table, Display("operate", "Frames", (Figure("frames", format=".0f"),)), "tables/x"
    )
    texts = [entry_text(line.cells[0]) for line in lay_out(frame).lines]
    assert texts == ["4 [2–9]", "more than 128 [90–more than 128]", "more than 128"]
