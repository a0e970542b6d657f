"""The commands of this project: what they call is imported when they are called."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

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
    try:
        from sweeps.run import command

        status = command(*modules).main(arguments)
    except KeyboardInterrupt:
        print(f"{NAME}: interrupted", file=sys.stderr)
        status = 130
    sys.exit(status)


if __name__ == "__main__":
    main()
