"""The command `ncti-sweep`, and the report after a sweep: tables, page and pictures.

Imports are inside functions, so that the first message precedes the imports, which take
a second, and an interrupt during them is reported as an interrupt.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from sweeps.engine.run.interpreter import end_with, relax_gc
from sweeps.engine.run.interrupts import Stopped, defer_signals, raise_if_stopped

if TYPE_CHECKING:
    from sweeps.engine.command.line import Command
    from sweeps.engine.declare.paths import PathOrUrl
    from sweeps.engine.declare.settings import Choices
    from sweeps.engine.sweeping import SweepOutcome

NAME, EXPLAIN = "ncti-sweep", "--explain"
_deferred_signals: list[ExitStack] = []
REPORT_MODULES = ("sweeps.report.summary", "sweeps.report.page.write", "matplotlib.figure")
MULTIRUN = ("-m", "--multirun")  # options with which the command still runs a sweep


def main(arguments: Sequence[str] | None = None, *modules: Any) -> None:
    """Run `ncti-sweep`; exits with 0 done, 1 some cells failed, 2 wrong configuration.

    Parameters
    ----------
    arguments : sequence of str, optional
        The command line; the process's own when not given.
    *modules : module
        Sensors and classifiers besides the project's; see `sweeps.experiment`.
    """
    relax_gc()
    words = list(sys.argv[1:] if arguments is None else arguments)
    if "--version" in words:
        print(f"{NAME} {version(NAME)}")
        sys.exit(0)
    if EXPLAIN in words:
        from sweeps.report.explain import print_meaning

        sys.exit(print_meaning(NAME, " ".join(word for word in words if word != EXPLAIN)))
    from sweeps.engine.declare.errors import DeclarationError

    with ExitStack() as signals:
        signals.enter_context(defer_signals())
        try:
            if all(word in MULTIRUN for word in words if word.startswith("-")):
                _say("reading the configuration")
            status = make_command(*modules).main(words)
        except Stopped as stopped:
            _say(stopped.message)
            status = stopped.status
        except DeclarationError as error:
            _say(str(error))
            status = 2
        if arguments is None:  # the process exits: only record late signals
            _deferred_signals.append(signals.pop_all())
    sys.exit(status)


def _say(sentence: str) -> None:
    """Print a sentence to stderr, ignoring errors."""
    with suppress(OSError, ValueError, AttributeError):
        print(f"{NAME}: {sentence}", file=sys.stderr, flush=True)


def make_command(*modules: Any) -> Command:
    """Return the command of the experiment, with further modules if any."""
    raise_if_stopped()
    from sweeps.engine.command.line import Command
    from sweeps.experiment import EXPERIMENT, MODULES, assemble, remarks
    from sweeps.report.outputs import report_paths

    raise_if_stopped()
    packages = tuple(module.__name__ for module in modules)
    experiment = assemble(*MODULES, *modules, code=packages) if modules else EXPERIMENT
    about_modules = partial(remarks, (*MODULES, *modules))
    return Command(experiment, report, report_paths, about_modules, REPORT_MODULES)


def report(store: PathOrUrl, choices: Choices, finished: SweepOutcome) -> None:
    """Print the answer of a finished store, then write its page and tables, and draw pictures.

    Raise SweepIncompleteError if a foreign file blocks an output; the other outputs are written.
    """
    from sweeps.engine.declare.errors import SweepIncompleteError
    from sweeps.report.outputs import blocked_sentence
    from sweeps.report.page.write import is_current, write_store_page
    from sweeps.report.screen import stdout_console
    from sweeps.report.summary import finish, print_answer, tables_of
    from sweeps.report.timings import write_timings
    from sweeps.stages.irar import Irar
    from sweeps.stages.meshes import mesh_source, read_mesh
    from sweeps.stages.views import Grid, uses_sensor

    kept_files: list[Path] = []
    if finished.written:
        with suppress(OSError):  # `finish` reports it for all tables
            kept_files += write_timings(store, finished.progress)
    frames = tables_of(store)
    print_answer(store, frames, stdout_console())
    if finished.written or not is_current(store):
        with _reporting_errors():  # the tables are complete without it
            kept_files += write_store_page(store, frames)
    kept_files += finish(store, frames, stdout_console())
    if uses_sensor("irar")(choices) and choices.value(Irar.pictures):
        from sweeps.report.pictures import write_pictures

        ships = {str(ship): ship for ship in choices[Grid.ship]}
        with _reporting_errors():
            kept_files += write_pictures(
                store, stdout_console(), ship=lambda label: read_mesh(mesh_source(ships[label]))
            )
    if kept_files:
        raise SweepIncompleteError(blocked_sentence(list(dict.fromkeys(kept_files))))


@contextmanager
def _reporting_errors() -> Iterator[None]:
    """Print the error of an output that cannot be written, and continue."""
    from sweeps.engine.declare.errors import ConfigurationError

    try:
        yield
    except ConfigurationError as error:
        _say(str(error))


def script() -> NoReturn:
    """Run `ncti-sweep` in a process of its own."""
    end_with(main)


if __name__ == "__main__":
    script()
