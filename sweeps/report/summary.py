"""The text at the end of a sweep: what it found, its main table, paths, and next commands."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console

from sweeps.report.files import write_tables
from sweeps.report.frames import Frame, read_frames
from sweeps.report.headline import headline, main_axis
from sweeps.report.own import is_free
from sweeps.report.pivot import at_main, laid_out, place_of
from sweeps.report.places import located, page_file, tables_folder
from sweeps.report.screen import line, note, page
from sweeps.report.stores import attributes, failed_cells, opened
from sweeps.report.terminal import print_table
from sweeps.report.work import read_work

MOST_LINES = 14  # of the main table


def tables_of(path: Path) -> dict[str, Frame]:
    """Return all tables of a store, the work of its last sweep included."""
    frames, work = read_frames(path), read_work(path)
    return frames | ({work.name: work} if work is not None else {})


def summarize(
    path: Path, frames: Mapping[str, Frame], axes: Mapping[str, int], console: Console
) -> list[Path]:
    """Write the tables of a finished store beside it, and print a summary.

    `axes` are the numbers of values of what was swept, by key. Returns the paths at which other
    files are in the way of tables. Raises OSError if tables cannot be written; the summary is
    printed anyway.
    """
    try:
        return write_tables(path, frames.values())
    finally:
        with page(console) as aside:
            print_main(path, frames, aside)
            print_places(path, frames, aside)
            note(swept(axes), aside)
            store = shlex.quote(located(path))
            line(f"next    ncti-report {store}", aside)
            line(f"        ncti-report {store} --table {next(iter(frames))}", aside)


def print_main(path: Path, frames: Mapping[str, Frame], console: Console) -> None:
    """Print what a store says first: its headline, and its main table along the swept axis."""
    about = attributes(opened(path))
    console.print()
    for sentence in headline(frames, about):
        note(sentence, console, style="bold")
    main, axes = next(iter(frames.values())), about.get("swept", ())
    keep = [*main.down, main_axis(main, axes)]
    at = at_main(main, keep)
    shown = at.of_axes([*keep, main.across])
    print_table(laid_out(shown, axes, joined=True), console, most=MOST_LINES)
    where = place_of(main, at, but=("kind",))
    note(f"At {where}." if where else "", console)


def swept(axes: Mapping[str, int]) -> str:
    """Return a sentence on what was swept: keys of the axes with their numbers of values."""
    listed = ", ".join(f"{key} ({count})" for key, count in axes.items())
    return f"swept   {listed or 'nothing; every setting has one value'}"


def print_places(path: Path, frames: Mapping[str, Frame], console: Console) -> None:
    """Print where a store, its tables and its page are, and how many of its cells failed."""
    line("", console)
    if failed := failed_cells(opened(path)):
        count = f"{len(failed):,} cell" + "s" * (len(failed) > 1)
        line(f"failed  {count}: the tables cover the others", console)
    line(f"store   {located(path)}", console)
    count = f"{len(frames)} CSV file" + "s" * (len(frames) > 1)
    line(f"tables  {located(tables_folder(path))} ({count})", console)
    if page_file(path).is_file() and is_free(page_file(path)):  # else it is not of a report
        line(f"report  {located(page_file(path))}", console)
