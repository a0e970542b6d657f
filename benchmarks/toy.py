"""Toy experiments over the axes of the article's grid, whose stages take no time."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from sweeps.engine.command.line import Command
from sweeps.engine.declare.settings import Choices, Settings, count, number, read_choices, word
from sweeps.engine.declare.stage import Experiment, Group, Output, stage

NAP = 0.1  # s


class Grid(Settings, key="grid"):
    """The grid."""

    ship = word("duncan", ("duncan", "horne", "spruance", "texas"), label="ship")
    aspect = number(0, label="aspect", unit="degree")
    pulse_width = number(30, label="pulse width", unit="ns")
    frame_count = count(4, label="frames averaged")
    range = number(100, label="slant range", unit="km")
    vigilance = number(0.95, label="vigilance")


@stage(Output("nothing", label="zero"), uses=(Grid,), group=Group("toy"))
def nothing(
    ship: str,
    aspect: float,
    pulse_width: float,
    frame_count: int,
    range: float,
    vigilance: float,
) -> float:
    """Return zero for every cell of the grid."""
    return 0.0


@stage(Output("nap", label="aspect after a while"), uses=(Grid,), group=Group("toy"))
def nap(aspect: float) -> float:
    """Return the aspect after a tenth of a second."""
    time.sleep(NAP)
    return aspect


NOTHING = Experiment("toy", "Nothing", (Grid, nothing), code=("benchmarks",))
NAPS = Experiment("toy", "Naps", (Grid, nap), code=("benchmarks",))


def choices(experiment: Experiment, lengths: Sequence[int]) -> Choices:
    """Return choices with the given number of values on each axis: ship, aspect and so on.

    Parameters
    ----------
    experiment : Experiment
        One of the toys.
    lengths : sequence of int
        For the first axes, in the order of `Grid`; the others keep their one value.
    """
    ships = Grid.ship.kind.values(Grid.ship.key, ["duncan", "horne", "spruance", "texas"])
    values = {
        setting.key: list(ships[:length] if setting is Grid.ship else range(1, length + 1))
        for setting, length in zip(Grid.declared, lengths, strict=False)
    }
    return experiment.check(read_choices(experiment.declared, values))


def main(experiment: Experiment = NOTHING) -> None:
    """Run the command line of a toy, by default `NOTHING`."""
    sys.exit(Command(experiment).main())
