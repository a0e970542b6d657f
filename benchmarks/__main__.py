"""The command `python -m benchmarks`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from rich.console import Console

import ncti.ships
from benchmarks import engine, history, paper, skips, steps, views, waiting, workers
from benchmarks.reports import Report, describe_machine, show, write_json
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.stages.meshes import cache_folder

REPORTS: dict[str, tuple[str, Callable[[argparse.Namespace], Report]]] = {
    "views": (
        "time and error of a view by engine, and by other libraries",
        lambda options: views.measure(options.ship, repeats=options.repeats),
    ),
    "skips": (
        "time saved by skipped work",
        lambda options: skips.measure(options.ship, repeats=options.repeats),
    ),
    "steps": (
        "time of each step, from a ship's mesh to a classifier's answer",
        lambda options: steps.measure(options.ship, repeats=options.repeats),
    ),
    "paper": (
        "time and memory of +experiment=paper: cold, again, and with one more value",
        lambda options: paper.measure(repeats=options.repeats),
    ),
    "waiting": (
        "what a user waits for, step by step, beside another checkout if --against",
        lambda options: waiting.measure(repeats=options.repeats, against=options.against),
    ),
    "cells": (
        "time and memory of sweeps of up to ten million cells on two processes",
        lambda options: engine.measure(),
    ),
    "workers": (
        "tasks a second, time and memory of the command with up to 1,000 dask workers",
        lambda options: workers.measure(),
    ),
    "history": (
        "error and time of fixed views, appended to benchmarks/history.csv and drawn",
        lambda options: history.record(repeats=options.repeats),
    ),
}
"""Description of each report, and the function that makes it."""

ALL = tuple(name for name in REPORTS if name != "history")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exits with 2 when something requested is missing."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        parser.error(f"--repeats is {options.repeats}, but must be at least 1")
    try:
        for ship in (options.ship, *ncti.ships.names()):
            # built here, so that no report includes the build
            ncti.ships.load(ship, cache=cache_folder() / "meshes")
    except ncti.ships.ShipError as error:
        parser.error(f"--ship: {error}")

    console, description, reports = Console(), describe_machine(), {}
    console.print(
        ", ".join(f"{key} {value}" for key, value in description.items()), highlight=False
    )
    for name in ALL if options.report == "all" else (options.report,):
        _, measure = REPORTS[name]
        try:
            reports[name] = measure(options)
        except (RuntimeError, ConfigurationError) as error:
            print(f"benchmark: {name} failed: {error}", file=sys.stderr)
            sys.exit(1)
        show(reports[name], console)
    if options.json:
        write_json(options.json, description, reports)


def _parser() -> argparse.ArgumentParser:
    meanings = {name: meaning for name, (meaning, _) in REPORTS.items()}
    meanings["all"] = "everything but history"
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure time, memory and error.",
        epilog="\n".join(f"{name:<9} {meaning}" for name, meaning in meanings.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("report", nargs="?", choices=list(meanings), default="all")
    parser.add_argument(
        "--repeats", type=int, default=3, metavar="N", help="how often to measure everything (3)"
    )
    parser.add_argument(
        "--ship", default="duncan", metavar="NAME", help="ship of views, skips and steps (duncan)"
    )
    parser.add_argument(
        "--against", type=Path, metavar="PATH", help="waiting: another checkout, in turn"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    return parser


if __name__ == "__main__":
    main()
