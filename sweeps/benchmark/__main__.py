"""The command `python -m sweeps.benchmark`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from rich.console import Console

import ncti.ships
from sweeps.benchmark import (
    accuracy,
    classification,
    classifiers,
    convergence,
    flights,
    images,
    invariance,
    paper,
    views,
)
from sweeps.benchmark.reports import Report, machine, show, write_json

REPORTS: dict[str, Callable[[argparse.Namespace], Report]] = {
    "views": lambda asked: views.measure(asked.ship, repeats=asked.repeats),
    "accuracy": lambda asked: accuracy.measure(asked.ship, repeats=asked.repeats),
    "invariance": lambda asked: invariance.measure(repeats=asked.repeats),
    "images": lambda asked: images.measure(asked.ship, repeats=asked.repeats),
    "infrared": lambda asked: images.measure_part(repeats=asked.repeats),
    "classifier_times": lambda asked: classifiers.measure(repeats=asked.repeats),
    "vigilances": lambda asked: classifiers.measure_vigilances(repeats=asked.repeats),
    "convergence": lambda asked: convergence.measure(repeats=asked.repeats),
    "course": lambda asked: convergence.measure_course(),
    "classification": lambda asked: classification.measure(repeats=asked.repeats),
    "flights": lambda asked: flights.measure(repeats=asked.repeats),
    "paper": lambda asked: paper.measure(repeats=asked.repeats),
}
SETS = {
    "classifiers": ("classifier_times", "vigilances", "convergence", "course", "classification"),
    "all": tuple(REPORTS),
}
"""Reports that one name asks for."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exits with 2 when something asked for is not there."""
    parser = argparse.ArgumentParser(
        prog="python -m sweeps.benchmark",
        description="Time a view by engine (views), the error of a range extent against its time "
        "(accuracy), what of a silhouette's map outlives shift, scale and rotation (invariance), "
        "infrared images a second (images), the infrared part of the experiment (infrared), "
        "classifiers beside scikit-learn's (classifier_times), vigilances that share cosines "
        "(vigilances), training with and without gain annealing (convergence, course), the "
        "classification part of the experiment (classification), the last five together "
        "(classifiers), a flight of the airborne sensor step by step (flights), and time and "
        "memory of the whole experiment (paper).",
    )
    parser.add_argument("report", nargs="?", choices=[*REPORTS, *SETS], default="all")
    parser.add_argument(
        "--repeats", type=int, default=3, metavar="N", help="how often to measure everything (3)"
    )
    parser.add_argument(
        "--ship", default="duncan", metavar="NAME", help="ship of views and accuracy (duncan)"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    asked = parser.parse_args(arguments)
    if asked.repeats < 1:
        parser.error(f"--repeats is {asked.repeats}, but must be at least 1")
    try:
        ncti.ships.load(asked.ship)  # built here, so that no report measures the building
    except ncti.ships.ShipError as error:
        parser.error(f"--ship: {error}")

    console = Console()
    here = machine()
    console.print(", ".join(f"{key} {value}" for key, value in here.items()), highlight=False)
    reports: dict[str, Report] = {}
    for name, run in REPORTS.items():
        if name in SETS.get(asked.report, (asked.report,)):
            try:
                reports[name] = run(asked)
            except RuntimeError as error:
                print(f"benchmark: {name} failed: {error}", file=sys.stderr)
                sys.exit(1)
            show(reports[name], console)
    if asked.json:
        write_json(asked.json, here, reports)


if __name__ == "__main__":
    main()
