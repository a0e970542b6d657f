"""The command `ncti-sweep`, and what follows a sweep: its tables and its pictures.

What they call is imported when they are called, so that an interrupt meanwhile is told as one.
"""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweeps.engine.command import Command
    from sweeps.engine.run import Finished
    from sweeps.engine.settings import Choices

NAME = "ncti-sweep"


def main(arguments: Sequence[str] | None = None, *modules: Any) -> None:
    """Run `ncti-sweep`; exits with 0 done, 1 some cells failed, 2 wrong configuration.

    Parameters
    ----------
    arguments : sequence of str, optional
        The command line; the process's own when not given.
    *modules : module
        Sensors and classifiers besides the project's; see `sweeps.experiment`.
    """
    # What is left at the end goes with the process: to look for circles in it takes 0.2 s.
    atexit.register(gc.freeze)
    try:
        with _workers_ahead(sys.argv[1:] if arguments is None else arguments):
            status = command(*modules).main(arguments)
    except KeyboardInterrupt:
        print(f"{NAME}: interrupted", file=sys.stderr)
        status = 130
    sys.exit(status)


def command(*modules: Any) -> Command:
    """The command line of the experiment, with further modules if any are given."""
    from sweeps.engine.command import Command
    from sweeps.experiment import EXPERIMENT, MODULES, assemble

    packages = tuple(one.__name__ for one in modules)
    experiment = assemble(*MODULES, *modules, code=packages) if modules else EXPERIMENT
    return Command(experiment, report)


@contextmanager
def _workers_ahead(arguments: Sequence[str]) -> Iterator[None]:
    """Let what workers need be imported from now on, if a whole sweep is clearly asked for.

    That takes longer than to read the configuration. Where some results are kept there may be
    nothing to do, and the process that imports would only take time.
    """
    from platformdirs import user_cache_path

    from sweeps.engine.results import INDEX

    given = dict(one.partition("=")[::2] for one in arguments)
    asked = not any(key.lstrip("+").startswith(("-", "dry_run", "cluster")) for key in given)
    cache, store = Path(given.get("cache") or user_cache_path(NAME)), given.get("store")
    if not asked or (cache / INDEX).exists() or (store and Path(store).exists()):
        yield
        return
    from sweeps.engine.forking import fork_server_ahead

    with fork_server_ahead(["sweeps.ahead"]):
        yield


def report(store: Path, choices: Choices, finished: Finished) -> None:
    """Print and write the tables of a finished store, then its page, and pictures if asked for."""
    from rich.console import Console

    from sweeps.engine.process import say
    from sweeps.report.command import report as report_tables
    from sweeps.stages.irar import Irar
    from sweeps.stages.views import Grid, hull, looks, read_mesh

    report_tables(store, Console())
    report_page(store, finished)
    if not looks("irar")(choices) or not choices.one(Irar.pictures):
        return
    from sweeps.report.command import write_pictures

    ships = {str(ship): ship for ship in choices[Grid.ship]}
    try:
        write_pictures(store, Console(), ship=lambda label: read_mesh(hull.function(ships[label])))
    except (OSError, ValueError) as error:
        say(NAME, f"pictures are not drawn: {error}")


def report_page(store: Path, finished: Finished) -> None:
    """Write the page of a finished store, unless the one beside it is of the same store."""
    from sweeps.engine.process import say
    from sweeps.report.command import write_report
    from sweeps.report.page.work import write_work
    from sweeps.report.page.write import is_current

    if not finished.written and is_current(store):
        return
    gc.disable()  # figures are many small objects: to look for circles in them takes 0.4 s
    try:
        if finished.written:
            write_work(store, finished.progress)
        say(NAME, f"report page {write_report(store)}")
    except (OSError, ValueError) as error:
        say(NAME, f"the report page is not written: {error}")
    finally:
        gc.enable()


if __name__ == "__main__":
    main()
