"""The command `ncti-report`: print the tables of a store, or of two compared, and write them."""

from __future__ import annotations

import argparse
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

NAME, DISTRIBUTION = "ncti-report", "ncti-sweep"


def main() -> None:
    """Run the command line.

    Exits with 1 if another file is in the place of one to be written, or the output cannot be, and
    with 2 if the store cannot be read.
    """
    arguments = _parser().parse_args()
    from sweeps.engine.run.process import tolerant_output
    from sweeps.report.screen import complain

    with tolerant_output() as lost:
        status = _reported(arguments)
        if why := lost():
            complain(f"tables cannot be printed: {why}")
            status = status or 1
    if status:
        sys.exit(status)


def _reported(arguments: argparse.Namespace) -> int:
    """Print and write what a command line asks for; return the status."""
    # Imported here, so that `--help` and `--version` are quick.
    from sweeps.engine.declare.errors import ConfigurationError
    from sweeps.report.own import sentence_of
    from sweeps.report.pictures import write_pictures
    from sweeps.report.screen import complain, screen
    from sweeps.report.summary import comparison, report

    console = screen()
    try:
        path = _place(arguments.store)
        if arguments.other is not None:
            kept = comparison(path, _place(arguments.other), console, html=arguments.html)
        else:
            kept = report(path, console, table=arguments.table, html=arguments.html)
        if arguments.pictures:
            kept += write_pictures(path, console)
    except ConfigurationError as error:
        complain(str(error))
        return 2
    except OSError as error:
        complain(f"tables are not written: {error}")
        return 2
    if kept:
        complain(sentence_of(kept))
    return 1 if kept else 0


def _place(given: str) -> Any:
    """Return a store's URL, or its absolute path; refuse other URLs."""
    from sweeps.engine.declare.paths import path_or_url

    place = path_or_url("store", given)
    return place.absolute() if isinstance(place, Path) else place


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=NAME,
        description="Print the tables of a sweep beside the article's, and write them as CSV.",
    )
    parser.add_argument("store", help="store of a sweep, such as sweep.zarr")
    parser.add_argument(
        "other",
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
