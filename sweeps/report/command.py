"""The command `ncti-report`: print the tables of a store, or of two compared, and write them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from sweeps.report.frames import Frame

KEPT = ("range", "pulse_width", "frame_count")  # axes that long tables show whole
NAME, DISTRIBUTION = "ncti-report", "ncti-sweep"


def main() -> None:
    """Run the command line.

    Exits with 1 if another file is in the place of one to be written, and with 2 if the store
    cannot be read.
    """
    arguments = _parser().parse_args()
    # Imported here, so that `--help` and `--version` are quick.
    from sweeps.engine.errors import ConfigurationError
    from sweeps.report.own import sentence_of
    from sweeps.report.pictures import write_pictures
    from sweeps.report.screen import complain, screen

    path, console = arguments.store.absolute(), screen()
    try:
        if arguments.other is not None:
            kept = comparison(path, arguments.other.absolute(), console, html=arguments.html)
        else:
            kept = report(path, console, table=arguments.table, html=arguments.html)
    except ConfigurationError as error:
        complain(str(error))
        sys.exit(2)
    except OSError as error:
        complain(f"tables are not written: {error}")
        sys.exit(2)
    if arguments.pictures:
        try:
            kept += write_pictures(path, console)
        except (OSError, ValueError) as error:
            complain(f"pictures are not drawn: {error}")
            sys.exit(2)
    if kept:
        complain(sentence_of(kept))
        sys.exit(1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=NAME,
        description="Print the tables of a sweep beside the article's, and write them as CSV.",
    )
    parser.add_argument("store", type=Path, help="store of a sweep, such as sweep.zarr")
    parser.add_argument(
        "other",
        type=Path,
        nargs="?",
        help="a second store: print how much more often ships are identified there",
    )
    parser.add_argument(
        "--table",
        metavar="NAME",
        help="print one table, whole: NAME is that of its CSV file, such as accuracy",
    )
    parser.add_argument(
        "--pictures",
        action="store_true",
        help="also draw every stage of the corrections of flights, beside the tables",
    )
    parser.add_argument(
        "--html", action="store_true", help="also write the report page beside the store"
    )
    parser.add_argument("--version", action="version", version=f"{NAME} {version(DISTRIBUTION)}")
    return parser


def comparison(first: Path, second: Path, console: Console, *, html: bool = False) -> list[Path]:
    """Print and write how much more often ships are identified in a second store.

    With `html`, write its page, too, with the differences first. Returns the paths at which other
    files are in the way. Raises ConfigurationError and OSError as `report`, and ConfigurationError
    if the stores have nothing in common.
    """
    from sweeps.report.compare import compare, compared_name, sentences
    from sweeps.report.files import write_tables
    from sweeps.report.pivot import laid_out
    from sweeps.report.places import located, page_file, tables_folder
    from sweeps.report.screen import line, note, page
    from sweeps.report.stores import attributes, check_whole, opened
    from sweeps.report.summary import tables_of
    from sweeps.report.terminal import print_table

    for path in (first, second):
        check_whole(path, groups=None)
    frames, name = compare(first, second), compared_name(first, second)
    swept = attributes(opened(second)).get("swept", ())
    with page(console) as aside:
        for sentence in sentences(frames):
            note(sentence, aside, style="bold")
        for frame in frames.values():
            print_table(laid_out(frame, swept, joined=True), aside)
        line(f"\ntables  {located(tables_folder(name))}", aside)
        if html:
            line(f"report  {located(page_file(name))}", aside)
    kept = write_tables(name, frames.values())
    if html:
        frames |= tables_of(second)
        kept += written_page(second, frames, name, headline=sentences(frames))
    return kept


def written_page(path: Path, frames: Mapping[str, Frame], *place: Path, **more: Any) -> list[Path]:
    """Write the report page of a store; see `write_page`.

    Raises ConfigurationError if it cannot be written.
    """
    from sweeps.engine.errors import ConfigurationError
    from sweeps.report.page.write import write_page

    try:
        return write_page(path, frames, *place, **more)
    # zarr and xarray raise various errors for damaged groups without a table.
    except Exception as error:
        why = f"{type(error).__name__}: {error}".partition("\n")[0]
        if isinstance(error, OSError):
            why = error.strerror or str(error)
        raise ConfigurationError(f"the report page is not written: {why}") from error


def report(
    path: Path, console: Console, *, table: str | None = None, html: bool = False
) -> list[Path]:
    """Write the tables of a store beside it, then print them.

    With `table`, print only the table of that name; with `html`, write the report page first.
    Returns the paths at which other files are in the way. Raises ConfigurationError if files of the
    store that are read are not as they were written, if it has no tables or lacks that one, or if
    the page cannot be written, and OSError if tables cannot be written beside it; they are printed
    anyway.
    """
    from sweeps.report.files import write_tables
    from sweeps.report.frames import chosen
    from sweeps.report.screen import page
    from sweeps.report.stores import attributes, check_whole, opened
    from sweeps.report.summary import print_main, print_places, tables_of

    check_whole(path, **({"groups": None} if html else {}))
    frames = tables_of(path)
    shown = [one for one in frames.values() if one.name != "stages"]
    if table is not None:
        shown = [chosen(frames, table)]
    kept = written_page(path, frames) if html else []
    try:
        return kept + write_tables(path, frames.values())
    finally:
        with page(console) as aside:
            if table is None:
                print_main(path, frames, aside)
            for one in shown:
                _print(one, attributes(opened(path)).get("swept", ()), aside, whole=bool(table))
            print_places(path, frames, aside)


def _print(frame: Frame, swept: Sequence[str], console: Console, *, whole: bool) -> None:
    """Print a table; a long one at the preferred values of most axes, unless it is to be whole."""
    from sweeps.report.pivot import at_main, laid_out, place_of
    from sweeps.report.screen import note
    from sweeps.report.terminal import MOST, print_table

    table = laid_out(frame, swept, joined=True)
    if whole or len(table.lines) <= MOST:
        print_table(table, console, most=None)
        same = ", ".join(f"{words} {text}" for words, text in table.same.items())
        note(f"In all rows: {same}." if same and whole else "", console)
        return
    several = frame.several()
    keep = [name for name in several if frame.columns[name].axis in (*KEPT, *swept)]
    at = at_main(frame, [*frame.down, *keep])
    print_table(laid_out(at, swept, joined=True), console)
    where = place_of(frame, at)
    note(f"At {where}; --table {frame.name} prints all." if where else "", console)
