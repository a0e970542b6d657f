"""The command `ncti-sweep`, and what follows a sweep: its tables and its pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console

from sweeps.engine.command import Command
from sweeps.engine.printing import say
from sweeps.engine.settings import Choices
from sweeps.experiment import EXPERIMENT, MODULES, assemble
from sweeps.stages.irar import Irar
from sweeps.stages.views import Grid, hull, looks, read_mesh


def command(*modules: Any) -> Command:
    """The command line of the experiment, with further modules if any are given."""
    experiment = assemble(*MODULES, *modules, code=_packages(modules)) if modules else EXPERIMENT
    return Command(experiment, report)


def _packages(modules: tuple[Any, ...]) -> tuple[str, ...]:
    return tuple(one.__name__ for one in modules)


def report(store: Path, choices: Choices) -> None:
    """Print and write the tables of a finished store, and draw its pictures if they are wanted."""
    from sweeps.report.command import report as report_tables

    report_tables(store, Console())
    if looks("irar")(choices) and choices.one(Irar.pictures):
        _draw(store, choices)


def _draw(store: Path, choices: Choices) -> None:
    """Pictures of a finished sweep of flights, which is as good without them."""
    from sweeps.report.command import MISSING, write_pictures

    ships = {str(ship): ship for ship in choices[Grid.ship]}
    try:
        write_pictures(store, Console(), ship=lambda label: read_mesh(hull.function(ships[label])))
    except ImportError:
        say("ncti-sweep", f"pictures are not drawn: {MISSING}")
    except (OSError, ValueError) as error:
        say("ncti-sweep", f"pictures are not drawn: {error}")
