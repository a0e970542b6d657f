"""The command `ncti-report`: print the tables of a store, or of two compared, and write them."""

from __future__ import annotations

import argparse
import sys
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

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
    from sweeps.report.terminal import complain, screen

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
    if the stores have no answers in common.
    """
    from sweeps.report.compare import compare, compared_name, sentences, write_comparison
    from sweeps.report.pivot import laid_out
    from sweeps.report.places import page_file, tables_folder
    from sweeps.report.stores import attributes, check_whole, opened
    from sweeps.report.summary import located
    from sweeps.report.terminal import line, note, page, print_table

    for path in (first, second):
        check_whole(path, groups=None)
    frame, name = compare(first, second), compared_name(first, second)
    with page(console) as aside:
        for sentence in sentences(frame):
            note(sentence, aside, style="bold")
        print_table(laid_out(frame, attributes(opened(second)).get("swept", ())), aside)
        line(f"\ntables  {located(tables_folder(name))}", aside)
        if html:
            line(f"report  {located(page_file(name))}", aside)
    kept = write_comparison(first, second, frame)
    if html:
        from sweeps.report.page.write import write_page

        kept += write_page(second, name, first=frame)
    return kept


def write_report(path: Path) -> list[Path]:
    """Write the report page of a store beside it; return the path if another file is there.

    Raises OSError if it cannot be written, and what zarr raises for a damaged store.
    """
    # Imported here, since the import takes longer than printing tables.
    from sweeps.report.page.write import write_page

    return write_page(path)


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
    from sweeps.engine.errors import ConfigurationError
    from sweeps.report.files import write_tables
    from sweeps.report.frames import chosen
    from sweeps.report.pivot import at_main, laid_out, place_of
    from sweeps.report.stores import attributes, check_whole, opened
    from sweeps.report.summary import print_main, print_places, tables_of
    from sweeps.report.terminal import MOST, note, page, print_table

    check_whole(path, **({"groups": None} if html else {}))
    frames, kept = tables_of(path), list[Path]()
    shown = [one for one in frames.values() if one.name != "stages"]
    if table is not None:
        shown = [chosen(frames, table)]
    if html:
        try:
            kept += write_report(path)
        # zarr and xarray raise various errors for damaged groups without a table.
        except Exception as error:
            why = f"{type(error).__name__}: {error}".partition("\n")[0]
            if isinstance(error, OSError):
                why = error.strerror or str(error)
            raise ConfigurationError(f"the report page is not written: {why}") from error
    others, failure = write_tables(path, frames.values())
    swept = attributes(opened(path)).get("swept", ())
    with page(console) as aside:
        if table is None:
            print_main(path, frames, aside)
        for one in shown:
            laid = laid_out(one, swept)
            if table is None and len(laid.lines) > MOST:
                keep = [name for name in one.several() if one.columns[name].axis in (*KEPT, *swept)]
                part = at_main(one, [*one.down, *keep])
                laid, at = laid_out(part, swept), place_of(one, part)
                print_table(laid, aside)
                note(f"At {at}; --table {one.name} prints all." if at else "", aside)
                continue
            print_table(laid, aside, most=None)
            same = ", ".join(f"{words} {text}" for words, text in laid.same.items())
            note(f"In all rows: {same}." if same and table else "", aside)
        print_places(path, frames, aside)
    if failure:
        raise failure
    return kept + others
