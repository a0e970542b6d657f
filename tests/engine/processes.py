"""The command of the springs, for `forked`: this import also loads the modules it needs."""

import contextlib
import io

import xarray  # noqa: F401  tables need it
from toys import SPRINGS

from sweeps.engine.command.line import Command


def report(store, choices, finished):
    """Print the store with markup and a letter that not every terminal can show."""
    print(f"report of {store} [/bold]ä")


def main(arguments):
    """Run the command; return its exit status."""
    return Command(SPRINGS, report).main(["cache=cache", "cluster=inline", *arguments])


# `--settings` reads no store or cache: none may be read before forking.
with contextlib.redirect_stdout(io.StringIO()):
    assert Command(SPRINGS).main(["--settings"]) == 0
