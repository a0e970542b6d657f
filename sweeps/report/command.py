"""The command `ncti-report`: print the tables of a store, or of several compared; write them."""

from __future__ import annotations

import argparse
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn

NAME, DISTRIBUTION = "ncti-report", "ncti-sweep"


def main() -> None:
    """Run the command line.

    Exits with 1 if another file blocks one to be written or the output cannot be written, and with
    2 if the store cannot be read.
    """
    from sweeps.engine.run.interpreter import relax_gc

    relax_gc()
    arguments = _parser().parse_intermixed_args()  # allows `a.zarr --html b.zarr`
    from sweeps.engine.run.process import flush_output, say

    status = _run(arguments)
    if fault := flush_output():
        say(NAME, f"tables cannot be printed: {fault}")
        status = status or 1
    if status:
        sys.exit(status)


def script() -> NoReturn:
    """Run `ncti-report` in a process of its own."""
    from sweeps.engine.run.interpreter import end_with

    end_with(main)


def _run(arguments: argparse.Namespace) -> int:
    """Print and write the requested tables; return the exit status."""
    from sweeps.engine.declare.errors import ConfigurationError
    from sweeps.engine.run.process import say
    from sweeps.report.outputs import blocked_sentence
    from sweeps.report.pictures import write_pictures
    from sweeps.report.screen import stdout_console
    from sweeps.report.summary import report, report_comparison

    console = stdout_console()
    try:
        path, *others = map(_parse_store, arguments.stores)
        if others:
            if arguments.pictures:
                raise ConfigurationError("--pictures draws one store, but several are given")
            options = {"table": arguments.table, "html": arguments.html}
            blocked = report_comparison(path, *others, console=console, **options)
        else:
            blocked = report(path, console, table=arguments.table, html=arguments.html)
        if arguments.pictures:
            blocked += write_pictures(path, console)
    except ConfigurationError as error:
        say(NAME, str(error))
        return 2
    except OSError as error:
        say(NAME, f"tables are not written: {error}")
        return 2
    if blocked:
        say(NAME, blocked_sentence(blocked))
    return 1 if blocked else 0


def answer(store: Any) -> list[str]:
    """Return the headline of a store, which a sweep of any experiment prints at its end."""
    from sweeps.report.frames import read_frames
    from sweeps.report.headline import headline
    from sweeps.report.stores import attributes, open_store

    return headline(read_frames(store), attributes(open_store(store)))


def _parse_store(argument: str) -> Any:
    """Return a store's URL, or its absolute path; refuse other URLs."""
    from sweeps.engine.declare.paths import path_or_url

    store = path_or_url("store", argument)
    return store.absolute() if isinstance(store, Path) else store


class _Explain(argparse.Action):
    """Prints the meaning of a word instead of tables, and exits."""

    def __call__(self, parser: argparse.ArgumentParser, _: Any, words: Any, *__: Any) -> None:
        from sweeps.report.explain import print_meaning

        parser.exit(print_meaning(NAME, " ".join(words)))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=NAME,
        description="Print the answer of a sweep, and write its tables as CSV.",
    )
    parser.add_argument(
        "stores",
        metavar="store",
        nargs="+",
        help="store of a sweep, such as sweep.zarr; of several, print what changed most from the "
        "first to the others",
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
    parser.add_argument(
        "--explain",
        metavar="WORD",
        nargs="*",
        action=_Explain,
        help="print what a word of the tables means, such as ACN; without one, all words",
    )
    parser.add_argument("--version", action="version", version=f"{NAME} {version(DISTRIBUTION)}")
    return parser
