"""Printed reports: at the end of a sweep, of a store, and of a comparison of stores."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from sweeps.engine.declare.paths import PathOrUrl
from sweeps.report.answer import answer_table
from sweeps.report.changes import change_sentences, change_table, settings_sentence
from sweeps.report.compare import Comparison, compare
from sweeps.report.files import write_tables
from sweeps.report.frames import Frame, read_frames, select_table
from sweeps.report.headline import accuracy_sentences, headline
from sweeps.report.outputs import is_free, page_file, tables_folder
from sweeps.report.page.write import write_comparison_page, write_store_page
from sweeps.report.pivot import constant_values, lay_out
from sweeps.report.ranking import main_frame
from sweeps.report.screen import buffered_console, print_line, print_note
from sweeps.report.stores import (
    PRINTED_GROUPS,
    attributes,
    check_whole,
    failed_cells,
    open_store,
    relative_path,
)
from sweeps.report.terminal import print_table
from sweeps.report.timings import read_timings
from sweeps.report.words import counted


def tables_of(path: PathOrUrl) -> dict[str, Frame]:
    """Return all tables of a store, the run time of its last sweep included."""
    frames, timings = read_frames(path), read_timings(path)
    return frames | ({timings.name: timings} if timings is not None else {})


def print_answer(path: PathOrUrl, frames: Mapping[str, Frame], console: Console) -> None:
    """Print the headline of a finished store, the accuracy, and its main table."""
    store = open_store(path)
    with buffered_console(console) as buffer:
        buffer.print()
        for sentence in headline(frames, attributes(store)):
            print_note(sentence, buffer, style="bold")
        for sentence in accuracy_sentences(store):
            print_note(sentence, buffer)
        print_table(answer_table(main_frame(frames), swept_axes(path), buffer.width), buffer)


def finish(path: PathOrUrl, frames: Mapping[str, Frame], console: Console) -> list[Path]:
    """Write the tables of a finished store beside it, and print the paths of all outputs.

    Returns the paths of tables that other files block. Raises OSError if tables cannot be written;
    the paths of outputs are printed anyway.
    """
    with buffered_console(console) as buffer:
        print_line("", buffer)
        if failed := failed_cells(open_store(path)):
            cells = counted(len(failed), "cell")
            print_line(f"failed  {cells}: the tables cover the others", buffer)
        store, files = relative_path(path), counted(len(frames), "CSV file")
        print_line(f"store   {store}", buffer)
        if page_file(path).is_file() and is_free(page_file(path)):  # else it is not of a report
            print_line(f"page    {relative_path(page_file(path))}", buffer)
        print_line(f"tables  {relative_path(tables_folder(path))} ({files})", buffer)
        print_line(f"next    ncti-report {shlex.quote(store)} --table {next(iter(frames))}", buffer)
    return write_tables(path, frames.values())


def report(
    path: PathOrUrl, console: Console, *, table: str | None = None, html: bool = False
) -> list[Path]:
    """Print the answer of a store, or one table whole, and write its tables beside it.

    With `html`, also write the report page. Returns the paths that other files block. Raises
    ConfigurationError if a file of the store that is read is damaged, if the store has no tables or
    lacks `table`, or if the page cannot be written. Raises OSError if tables cannot be written
    beside the store; the answer or the table is printed anyway.
    """
    check_whole(path, None if html else PRINTED_GROUPS)
    frames = tables_of(path)
    if table is None:
        print_answer(path, frames, console)  # first, since the page takes longer
        blocked = write_store_page(path, frames) if html else []
        return blocked + finish(path, frames, console)
    selected = select_table(frames, table)
    with buffered_console(console) as buffer:
        print_table(lay_out(selected, swept_axes(path)), buffer, max_rows=None)
        shared = ", ".join(f"{words} {text}" for words, text in constant_values(selected).items())
        print_note(f"In all rows: {shared}." if shared else "", buffer)
    blocked = write_store_page(path, frames) if html else []
    return blocked + write_tables(path, frames.values())


def report_comparison(
    first: PathOrUrl,
    *others: PathOrUrl,
    console: Console,
    table: str | None = None,
    html: bool = False,
) -> list[Path]:
    """Print what changed most from one store to others, or one table of differences whole.

    Also write all differences as tables and, with `html`, as a page. If all stores have the same
    results, remove the files of an earlier comparison instead. Returns the paths that other files
    block. Raises ConfigurationError and OSError as `report` does, and ConfigurationError if the
    stores have nothing in common.
    """
    for path in (first, *others):
        check_whole(path)
    compared = compare(first, *others)
    with buffered_console(console) as buffer:
        if table is not None and compared.frames:
            selected = select_table(compared.frames, table)
            print_table(lay_out(selected, swept_axes(first)), buffer, max_rows=None)
        else:
            _print_changes(compared, buffer, html=html)
    if not compared.frames:
        return _remove_files(compared.output_path)
    blocked = write_tables(compared.output_path, compared.frames.values())
    if html:
        blocked += write_comparison_page(compared)
    return blocked


def _remove_files(store: Path) -> list[Path]:
    """Remove the unchanged tables and page of a comparison; return the paths in the way."""
    page_path, folder = page_file(store), tables_folder(store)
    if page_path.is_file() and is_free(page_path):
        page_path.unlink()
    return write_tables(store, []) if folder.is_dir() else []


def swept_axes(path: PathOrUrl) -> Sequence[str]:
    """Return the names of the axes that were swept."""
    axes: Sequence[str] = attributes(open_store(path)).get("swept", ())
    return axes


def _print_changes(compared: Comparison, console: Console, *, html: bool) -> None:
    """Print the largest changes along the swept axis, and the paths of all files."""
    for sentence in change_sentences(compared):
        print_note(sentence, console, style="bold")
    print_note(settings_sentence(compared), console)
    if compared.frames:
        print_table(change_table(compared, swept_axes(compared.paths[0])), console)
    print_line("", console)
    for path, name in zip(compared.paths, compared.names, strict=True):
        if failed := failed_cells(open_store(path)):
            cells = f"{counted(len(failed), 'cell')} of {name}"
            print_line(f"failed  {cells}: the comparison covers the others", console)
    if not compared.frames:
        return
    folder, files = tables_folder(compared.output_path), counted(len(compared.frames), "CSV file")
    print_line(f"tables  {relative_path(folder)} ({files})", console)
    if html:
        print_line(f"page    {relative_path(page_file(compared.output_path))}", console)
    else:
        stores = " ".join(shlex.quote(relative_path(path)) for path in compared.paths)
        print_line(f"next    ncti-report {stores} --html", console)
