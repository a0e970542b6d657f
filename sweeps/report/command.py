"""The command `ncti-report`: print the tables of a store and write them as CSV."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from sweeps.engine.version import OPTION, version_of

if TYPE_CHECKING:
    from rich.console import Console

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
    parser.add_argument(OPTION, action="version", version=version_of(NAME, DISTRIBUTION))
    return parser


def write_report(path: Path) -> list[Path]:
    """Write the report page of a store beside it; return the path if another file is there.

    Raises OSError if it cannot be written, and what zarr raises for a damaged store.
    """
    # Imported here, since the import takes longer than printing tables.
    from sweeps.report.figures import draw
    from sweeps.report.page.write import write_page

    return write_page(path, draw)


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
    from sweeps.report.parts import check_whole, chosen, parts_of, print_places, write_parts
    from sweeps.report.screen import explain, note, page, unforeseen

    check_whole(path, **({"groups": None} if html else {}))
    parts, kept = parts_of(path), []
    shown = [part for part in parts if part.listed] if table is None else [chosen(parts, table)]
    if html:
        try:
            kept += write_report(path)
        # zarr and xarray raise various errors for damaged groups without a table.
        except Exception as error:
            why = str(error).partition("\n")[0]
            why = why if isinstance(error, OSError) else f"{type(error).__name__}: {why}"
            raise ConfigurationError(f"the report page is not written: {why}") from error
    others, failure = write_parts(path, parts)
    with page(console) as aside:
        for part in shown:
            (part.write if table is None else part.whole or part.write)(aside)
        if table is None:
            explain(unforeseen([row for part in shown for row in part.rows]), aside)
            unlisted = [part.name for part in parts if not part.listed]
            if unlisted:
                note(f"Not printed: {', '.join(unlisted)} (--table NAME).", aside)
        print_places(path, parts, aside)
    if failure:
        raise failure
    return kept + others
