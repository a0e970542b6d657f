"""The command `python -m benchmarks`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from rich.console import Console

import ncti.ships
from benchmarks import (
    accuracy,
    bounds,
    budget,
    calibration,
    classification,
    classifiers,
    convergence,
    coverage,
    dataset,
    design,
    engine,
    fits,
    flights,
    grid,
    growth,
    history,
    images,
    invariance,
    lines,
    memory,
    mismatch,
    operate,
    pages,
    paper,
    reproduced,
    reproduction,
    results,
    scale,
    skips,
    splits,
    synthesis,
    tolerances,
    views,
    waiting,
    workers,
)
from benchmarks.reports import Report, machine, show, write_json
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.stages.views import cache_folder

REPORTS: dict[str, Callable[[argparse.Namespace], Report | Mapping[str, Report]]] = {
    "views": lambda asked: views.measure(asked.ship, repeats=asked.repeats),
    "accuracy": lambda asked: accuracy.measure(asked.ship, repeats=asked.repeats),
    "lines": lambda asked: lines.measure(repeats=asked.repeats),
    "line_rays": lambda asked: lines.measure_rays(repeats=asked.repeats),
    "line_names": lambda asked: lines.measure_names(),
    "tolerances": lambda asked: tolerances.measure(),
    "pixels": lambda asked: tolerances.measure_pixels(),
    "calibration": lambda asked: calibration.measure(),
    "bounds": lambda asked: bounds.measure(),
    "budget": lambda asked: budget.measure(),
    "mismatch": lambda asked: mismatch.measure(),
    "skips": lambda asked: skips.measure(asked.ship, repeats=asked.repeats),
    "invariance": lambda asked: invariance.measure(repeats=asked.repeats),
    "synthesis": lambda asked: synthesis.measure(
        asked.ship, repeats=asked.repeats, long_runs=asked.million
    ),
    "images": lambda asked: images.measure(asked.ship, repeats=asked.repeats),
    "infrared": lambda asked: images.measure_part(repeats=asked.repeats),
    "classifier_times": lambda asked: classifiers.measure(repeats=asked.repeats),
    "vigilances": lambda asked: classifiers.measure_vigilances(repeats=asked.repeats),
    "convergence": lambda asked: convergence.measure(repeats=asked.repeats),
    "course": lambda asked: convergence.measure_course(),
    "classification": lambda asked: classification.measure(repeats=asked.repeats),
    "flights": lambda asked: flights.measure(repeats=asked.repeats),
    "dataset": lambda asked: dataset.measure(),
    "engine_time": lambda asked: engine.measure(repeats=asked.repeats),
    "engine_memory": lambda asked: engine.measure_memory(repeats=asked.repeats),
    "cells": lambda asked: engine.measure_cells(),
    "memory": lambda asked: memory.measure(repeats=asked.repeats),
    "paper": lambda asked: paper.measure(repeats=asked.repeats),
    "waiting": lambda asked: waiting.measure(repeats=asked.repeats, against=asked.against),
    "growth": lambda asked: growth.measure(repeats=asked.repeats),
    "scale": lambda asked: scale.measure(most=asked.most),
    "workers": lambda asked: workers.measure(),
    "grid22320": lambda asked: grid.measure(repeats=asked.repeats),
    "reproduced": lambda asked: reproduced.measure(),
    "fit_tolerance": lambda asked: fits.tolerance(),
    "fit_target_free": lambda asked: fits.target_free(),
    "fit_learning_rate": lambda asked: fits.learning_rate(),
    "fit_inner_radius": lambda asked: fits.inner_radius(),
    "spread": lambda asked: reproduction.spread(),
    "protocol": lambda asked: reproduction.protocol(),
    "near_stern": lambda asked: reproduction.near_stern(),
    "figures": lambda asked: reproduction.figures(),
    "design": lambda asked: design.measure(),
    "operate": lambda asked: operate.measure(),
    "results": lambda asked: results.measure(results.Sizes(asked.seeds, parts=tuple(asked.part))),
    "coverage": lambda asked: coverage.measure(),
    "benchmark": lambda asked: splits.measure(),
    "history": lambda asked: history.record(repeats=asked.repeats),
}
SETS = {
    "classifiers": ("classifier_times", "vigilances", "convergence", "course", "classification"),
    "engine": ("engine_time", "engine_memory"),
    "fits": fits.REPORTS,
    "all": tuple(name for name in REPORTS if name != "history"),
}
"""Groups of reports by name."""

MEANINGS = {
    "views": "time of a view by engine",
    "accuracy": "error of a range extent against its time",
    "lines": "time of a view against error, by pixels, lines and a tolerance",
    "line_rays": "time of a view by lines and by embree's rays, end-on to abeam",
    "line_names": "ships identified by the same",
    "tolerances": "bounds and costs of tolerances by kind of view, against the reference",
    "pixels": "bounds that images of pixels state on 200 random views, against the reference",
    "calibration": "constants of the bound on errors of lines, fitted to true errors",
    "bounds": "percent correct of the likelihood classifier, by what it takes as known",
    "budget": "what each approximation does to profiles and identification",
    "mismatch": "percent correct by each difference between tests and templates",
    "skips": "time saved by skipped work",
    "invariance": "change of a silhouette's map by shift, scale and rotation",
    "synthesis": "frames and images over their normals, covariances of frames",
    "images": "infrared images a second",
    "infrared": "the infrared part of the experiment",
    "classifier_times": "classifiers beside scikit-learn's",
    "vigilances": "vigilances that share cosines",
    "convergence": "training with and without gain annealing",
    "course": "the same, epoch by epoch",
    "classification": "the classification part of the experiment",
    "classifiers": "the last five together",
    "flights": "a flight of the airborne sensor step by step",
    "dataset": "rows of a data set a second",
    "engine_time": "overhead of the sweep engine per cell",
    "engine_memory": "its memory by number of cells",
    "cells": "time and memory of sweeps of up to ten million cells on two processes",
    "engine": "the last two together",
    "memory": "memory of a sweep, driver and workers, by number of aspects",
    "paper": "the whole experiment: cold, again, and with one more value on an axis",
    "waiting": "what a user waits for, step by step, beside another checkout if --against",
    "growth": "time of a sweep by number of cells, and its slope",
    "scale": "time, memory, files and bytes of a sweep by number of views, up to --most",
    "workers": "tasks a second, time and memory of the command with up to 1,000 dask workers",
    "grid22320": "the grid at three ranges as one job, as -m, and by Hydra's basic launcher",
    "reproduced": "the article's tables over what it leaves open, fitted and judged",
    "fit_tolerance": "tolerance of the multilayered network, fitted to Table 2's training row",
    "fit_target_free": "target-free IFOVs, fitted to 32 frames near the bow",
    "fit_learning_rate": "learning rate of the ACN, fitted to Table 3 at 30 ns",
    "fit_inner_radius": "inner radius of log-polar maps, fitted to Table 5 at 25 km",
    "spread": "silhouettes with and without a spread of temperatures",
    "protocol": "training aspects beside aspects absent from training",
    "near_stern": "Figure 16: effects of the models, and of the flight",
    "figures": "the article's statements on its figures, measured on ours",
    "design": "the article's statements on the design of its sensors",
    "fits": "the eight of docs/reproduction.md and docs/article_figures.md together",
    "operate": "what sensor suffices: shortcuts, what is left open, and Sobol indices",
    "results": "every table of README.md and docs/results.md, as means over --seeds",
    "coverage": "coverage of the intervals of these means, by repeats of the procedure",
    "benchmark": "classifiers on splits, as means over ten seeds, and the ranking by three others",
    "history": "error and time of fixed views, appended to benchmarks/history.csv and drawn",
    "all": "everything but history, which takes long",
}


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exits with 2 when something requested is missing."""
    parser = _parser()
    asked = parser.parse_args(arguments)
    if asked.repeats < 1:
        parser.error(f"--repeats is {asked.repeats}, but must be at least 1")
    if asked.seeds < results.LEAST_SEEDS:
        parser.error(f"--seeds is {asked.seeds}, but must be at least {results.LEAST_SEEDS}")
    if asked.most < scale.LEAST_VIEWS:
        parser.error(f"--most is {asked.most}, but must be at least {scale.LEAST_VIEWS}")
    try:
        for ship in (asked.ship, *ncti.ships.names()):
            # built here, so that no report includes the build
            ncti.ships.load(ship, cache=cache_folder() / "meshes")
    except ncti.ships.ShipError as error:
        parser.error(f"--ship: {error}")

    console = Console()
    here = machine()
    console.print(", ".join(f"{key} {value}" for key, value in here.items()), highlight=False)
    reports: dict[tuple[str, str], Report] = {}
    for name, run in REPORTS.items():
        if name not in SETS.get(asked.report, (asked.report,)):
            continue
        try:
            made = run(asked)
        except (RuntimeError, ConfigurationError) as error:
            print(f"benchmark: {name} failed: {error}", file=sys.stderr)
            sys.exit(1)
        tables = {"": made} if isinstance(made, Report) else made
        for table, report in tables.items():
            show(report, console)
            reports[name, table] = report
    if asked.write:
        pages.write(reports)
    if asked.json:
        named = {pages.csv_file(*name).stem: report for name, report in reports.items()}
        write_json(asked.json, here, named)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure time, memory and error.",
        epilog="\n".join(f"{name:<17} {meaning}" for name, meaning in MEANINGS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("report", nargs="?", choices=list(MEANINGS), default="all")
    parser.add_argument(
        "--repeats", type=int, default=3, metavar="N", help="how often to measure everything (3)"
    )
    parser.add_argument(
        "--ship", default="duncan", metavar="NAME", help="ship of accuracy and images (duncan)"
    )
    parser.add_argument(
        "--million", action="store_true", help="synthesis: an average of 1,000,000 frames, too"
    )
    parser.add_argument(
        "--seeds",
        type=int,
        default=results.SEEDS,
        metavar="N",
        help=f"results: number of seeds ({results.SEEDS})",
    )
    parser.add_argument(
        "--part",
        action="append",
        default=[],
        choices=results.PARTS,
        help="results: a part of them, several if repeated; all by default",
    )
    parser.add_argument(
        "--most",
        type=int,
        default=scale.MOST,
        metavar="N",
        help=f"scale: largest number of views ({scale.MOST})",
    )
    parser.add_argument(
        "--against", type=Path, metavar="PATH", help="waiting: another checkout, in turn"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    parser.add_argument(
        "--write",
        action="store_true",
        help="write tables into the pages and CSV files in docs that have them, too",
    )
    return parser


if __name__ == "__main__":
    main()
