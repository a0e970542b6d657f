"""The page at the end of a sweep: short, in words first, and of figures that the files have."""

import io
import re
import shlex

import xarray as xr
from rich.cells import cell_len
from rich.console import Console
from stores import reported, rows_of

from sweeps.report.places import page_file
from sweeps.report.summary import summarize, tables_of

AXES = {"grid.ship": 2, "grid.aspect": 7, "grid.pulse_width": 3}


def page(path, width=80):
    """What is printed at the end of a sweep."""
    console = Console(file=io.StringIO(), width=width)
    summarize(path, tables_of(path), AXES, console)
    return console.file.getvalue()


def unwrapped(text):
    return " ".join(text.split())


def test_it_is_one_page_that_begins_with_a_score(smoke_store, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    lines = page(smoke_store).splitlines()
    assert len(lines) <= 55 and max(map(cell_len, lines)) <= 80
    assert re.search(r"identifies \d+ % \[\d+–\d+\]", " ".join(lines[:4]))
    assert "chance 50 %" in " ".join(lines[:6])
    assert "store   sweep.zarr" in lines


def test_its_figures_are_those_of_the_files(smoke_store):
    found = [row for row in rows_of(smoke_store, "scores") if row["classifier"] == "correlation"]
    at = {"pulse_width_ns": "30.0", "frame_count": "16", "kind": "test", "left_out": "False"}
    here = [row for row in found if at.items() <= row.items()]
    text = page(smoke_store)
    assert len(here) == 4
    for row in here:
        whole, low, high = (
            f"{float(row[name]):.0f}" for name in ("percent_correct", "ci_low", "ci_high")
        )
        # Files have tenths, and the page is rounded once: halves may differ.
        ends = re.findall(r"(\d+) \[(\d+)–(\d+)\]", text)
        wanted = [int(one) for one in (whole, low, high)]
        assert any(
            all(abs(int(a) - b) <= 1 for a, b in zip(end, wanted, strict=True)) for end in ends
        )


def test_the_error_of_profiles_is_said_once_on_screen_and_page(smoke_store):
    """As a percentage of two digits, rounded up, that 95 % of the bounds are within."""
    errors = xr.open_zarr(smoke_store, group="range_profile").profile_error
    html = page_file(smoke_store).read_text()
    for text in (page(smoke_store), html):
        [said] = re.findall(r"Profiles are within (\S+) % of the exact ones", unwrapped(text))
        assert "(95 % of views)" in unwrapped(text)
        assert (errors <= float(said) / 100).mean() >= 0.95
        assert (errors <= float(said) / 110).mean() < 0.95


def test_the_next_commands_would_run(smoke_store, monkeypatch):
    monkeypatch.chdir(smoke_store.parent)
    text = page(smoke_store)
    commands = text[text.index("next    ") :].removeprefix("next    ")
    for command, *words in (shlex.split(line) for line in commands.splitlines()):
        assert command == "ncti-report" and reported(monkeypatch, *words) == 0


def test_one_table_is_printed_by_the_name_of_its_file(smoke_store, monkeypatch, capsys):
    assert reported(monkeypatch, "--table", "categories", smoke_store) == 0
    text = capsys.readouterr().out
    assert "Categories formed" in text and "Ships identified" not in text
    assert reported(monkeypatch, "--table", "speed", smoke_store) == 2
    assert "must be one of scores, categories" in capsys.readouterr().err
