"""The command `python -m docs._tables`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping

from rich.console import Console

import ncti.ships
from benchmarks.reports import Report, show
from docs._tables import (
    bounds,
    budget,
    coverage,
    dataset,
    design,
    fits,
    lines,
    mismatch,
    operate,
    pages,
    reproduced,
    reproduction,
    results,
    scale,
    splits,
    tolerances,
)
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.stages.meshes import cache_folder

Reports = Report | Mapping[str, Report]

REPORTS: dict[str, tuple[str, Callable[[argparse.Namespace], Reports]]] = {
    "results": (
        "README.md and results.md: percent correct, as means over --seeds",
        lambda options: results.measure(results.Sizes(options.seeds, parts=tuple(options.part))),
    ),
    "coverage": (
        "results.md: coverage of these intervals, by repeats of the procedure",
        lambda options: coverage.measure(),
    ),
    "bounds": (
        "bounds.md: percent correct of the likelihood, by known parameters",
        lambda options: bounds.measure(),
    ),
    "budget": (
        "error_budget.md: effect of each approximation on profiles and identification",
        lambda options: budget.measure(),
    ),
    "mismatch": (
        "error_budget.md: percent correct by each difference between tests and templates",
        lambda options: mismatch.measure(),
    ),
    "tolerances": (
        "accuracy.md: bounds and costs of tolerances, against the reference",
        lambda options: tolerances.measure(),
    ),
    "pixels": (
        "accuracy.md: bounds that images of pixels state, against the reference",
        lambda options: tolerances.measure_pixels(),
    ),
    "lines": (
        "lines.md: time of a view against error, by pixels, lines and a tolerance",
        lambda options: lines.measure(),
    ),
    "line_rays": (
        "lines.md: time of a view by lines and by embree's rays, end-on to abeam",
        lambda options: lines.measure_rays(),
    ),
    "dataset": ("datasets.md: rows of a data set a second", lambda options: dataset.measure()),
    "scale": (
        "scale.md: time, memory, files and bytes of a sweep by number of views, up to --most",
        lambda options: scale.measure(max_views=options.most),
    ),
    "design": (
        "article_figures.md: the article's statements on the design of its sensors",
        lambda options: design.measure(),
    ),
    "reproduced": (
        "reproduction.md: the article's tables over unstated parameters",
        lambda options: reproduced.measure(),
    ),
    "fit_tolerance": (
        "reproduction.md: tolerance of the MNN, fitted to Table 2's training row",
        lambda options: fits.tolerance(),
    ),
    "fit_target_free": (
        "reproduction.md: target-free IFOVs, fitted to 32 frames near the bow",
        lambda options: fits.target_free(),
    ),
    "fit_learning_rate": (
        "reproduction.md: learning rate of the ACN, fitted to Table 3 at 30 ns",
        lambda options: fits.learning_rate(),
    ),
    "fit_inner_radius": (
        "reproduction.md: inner radius of log-polar maps, fitted to Table 5 at 25 km",
        lambda options: fits.inner_radius(),
    ),
    "spread": (
        "reproduction.md: silhouettes with and without a spread of temperatures",
        lambda options: reproduction.spread(),
    ),
    "protocol": (
        "reproduction.md: training aspects beside aspects absent from training",
        lambda options: reproduction.protocol(),
    ),
    "near_stern": (
        "article_figures.md: Figure 16, effects of the models and of the flight",
        lambda options: reproduction.near_stern(),
    ),
    "figures": (
        "article_figures.md: the article's statements on its figures, measured on ours",
        lambda options: reproduction.figures(),
    ),
    "operate": (
        "operate.md: what sensor suffices, what its shortcuts cost, and Sobol indices",
        lambda options: operate.measure(),
    ),
    "benchmark": (
        "README.md and benchmark.md: classifiers on splits, as means over ten seeds",
        lambda options: splits.measure(),
    ),
}
"""Page of each report with its content, and the function that makes it."""

FITS = (
    *("fit_tolerance", "fit_target_free", "fit_learning_rate", "fit_inner_radius"),
    *("spread", "protocol", "near_stern", "figures"),
)
"""Reports that `fits` makes together."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line."""
    parser = _parser()
    options = parser.parse_args(arguments)
    for option, minimum in (("seeds", results.MIN_SEEDS), ("most", scale.MIN_VIEWS)):
        if (value := getattr(options, option)) < minimum:
            parser.error(f"--{option} is {value}, but must be at least {minimum}")
    for ship in ncti.ships.names():
        # built here, so that no report includes the build
        ncti.ships.load(ship, cache=cache_folder() / "meshes")
    console = Console()
    reports: dict[tuple[str, str], Report] = {}
    for name in FITS if options.report == "fits" else (options.report,):
        _, measure = REPORTS[name]
        try:
            result = measure(options)
        except (RuntimeError, ConfigurationError) as error:
            print(f"{name} failed: {error}", file=sys.stderr)
            sys.exit(1)
        tables = {"": result} if isinstance(result, Report) else result
        for table, report in tables.items():
            show(report, console)
            reports[name, table] = report
    if options.write:
        pages.write(reports)


def _parser() -> argparse.ArgumentParser:
    meanings = {name: meaning for name, (meaning, _) in REPORTS.items()}
    meanings["fits"] = "all of reproduction.md but reproduced, and article_figures.md"
    parser = argparse.ArgumentParser(
        prog=pages.PROGRAM,
        description="Print tables of the pages again.",
        epilog="\n".join(f"{name:<17} {meaning}" for name, meaning in meanings.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("report", metavar="NAME", choices=list(meanings))
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
        default=scale.MAX_VIEWS,
        metavar="N",
        help=f"scale: largest number of views ({scale.MAX_VIEWS})",
    )
    parser.add_argument(
        "--write",
        action="store_true",
        help="write them into the pages and CSV files in docs that have them, too",
    )
    return parser


if __name__ == "__main__":
    main()
