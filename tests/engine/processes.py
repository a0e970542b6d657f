"""The command of the springs, for `forked`: importing this imports what it imports on its way."""

import contextlib
import io

import xarray  # noqa: F401  which tables need
from toys import SPRINGS

from sweeps.engine.command.line import Command


def report(store, choices, finished):
    """Print what not every terminal can show."""
    print(f"report of {store} [/bold]ä")


def main(arguments):
    """Exit status of the command."""
    return Command(SPRINGS, report).main(["cache=cache", "cluster=inline", *arguments])


# No place may be read before forking.
with contextlib.redirect_stdout(io.StringIO()):
    assert Command(SPRINGS).main(["--settings"]) == 0
