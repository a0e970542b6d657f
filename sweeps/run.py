"""A whole sweep, from a prepared configuration to tables, with its progress shown."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from sweeps import graph, store
from sweeps.cluster import executor
from sweeps.errors import SweepIncomplete
from sweeps.prepare import Prepared
from sweeps.report.command import report
from sweeps.stages import ViewPlan

NAMED_FAILURES = 20  # the status group of the store has them all


def run_sweep(prepared: Prepared, path: Path) -> None:
    """Run a sweep into the store at `path`, and print and write its tables.

    Parameters
    ----------
    prepared : Prepared
        The sweep.
    path : Path
        Where the store goes; one begun by the same sweep is gone on with.

    Raises
    ------
    ConfigurationError
        If `path` holds something else.
    SweepIncomplete
        If some cells failed; everything else is done and in the store.
    """
    config, ships, cache = prepared.config, prepared.ships, prepared.cache
    grid = config.grid.expand()
    views = len(ships) * len(grid.aspect)
    code = store.code_digests(config)
    window = prepared.window
    plan = ViewPlan.of(config, engine=prepared.engine, cache=cache, code=code, window=window)
    failures: list[graph.Failure] = []

    with _progress() as progress, executor(config.cluster, tasks=views) as workers:
        store.create(path, config, ships, prepared.engine, window)
        done = int(store.views_done(path).sum())
        bar = progress.add_task(f"views ({prepared.engine})", total=views, completed=done)
        _follow(progress, bar, graph.run_views(workers, ships, config, plan, path), failures)

        bar = progress.add_task("classification", total=len(graph.cells(config)))
        _follow(progress, bar, graph.run_classification(workers, config, path), failures)

    graph.write_tables(config, path)
    report(path, Console())
    if failures:
        named = "; ".join(f"{f.what} ({f.why})" for f in failures[:NAMED_FAILURES])
        more = len(failures) - NAMED_FAILURES
        raise SweepIncomplete(
            f"{len(failures)} tasks failed: {named}" + (f"; and {more} more" if more > 0 else "")
        )


def _follow(
    progress: Progress,
    bar: object,
    outcomes: Iterable[graph.Failure | None],
    failures: list[graph.Failure],
) -> None:
    for failure in outcomes:
        progress.advance(bar)  # type: ignore[arg-type]
        if failure is not None:
            failures.append(failure)
            progress.console.print(f"failed: {failure.what}: {failure.why}", style="red")


def _progress() -> Progress:
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description:<16}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
