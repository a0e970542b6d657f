"""Commands of the springs in processes of their own, forked from one that has imported it all.

Run as a script with a list of cases on stdin, as JSON: the folder, the arguments, what its output
goes to ('full' and 'pipe': /dev/full and a closed pipe, or the other way round; 'closed', 'ascii'
or 'file') and, optionally, the signal that it gets after its first results. Prints the list of exit
statuses, as JSON; output is in the files `out` and `err` of the folders.
"""

import contextlib
import io
import json
import os
import signal
import sys
import time
from pathlib import Path

import xarray  # noqa: F401  which tables need
from toys import SPRINGS

from sweeps.engine.command.line import Command


def report(store, choices, finished):
    """Print what not every terminal can show."""
    print(f"report of {store} [/bold]ä")


def redirected(output):
    """Send stdout and stderr where they cannot go, or into files."""
    targets = [os.open(name, os.O_WRONLY | os.O_CREAT) for name in ("out", "err")]
    if output in ("full", "pipe"):
        reading, writing = os.pipe()
        os.close(reading)
        targets = [os.open("/dev/full", os.O_WRONLY), writing]
    if output == "pipe":
        targets.reverse()
    for target, number in zip(targets, (1, 2), strict=True):
        os.dup2(target, number)
    if output == "closed":
        os.close(1)
        os.close(2)
        sys.stdout = sys.stderr = None
        return
    encoding = "ascii" if output == "ascii" else "utf-8"
    sys.stdout, sys.stderr = (
        io.TextIOWrapper(io.FileIO(number, "w", closefd=False), encoding, write_through=number == 2)
        for number in (1, 2)
    )


def started(case):
    """A process of a command."""
    child = os.fork()
    if child == 0:
        os.chdir(case["folder"])
        redirected(case["output"])
        main = Command(SPRINGS, report).main
        sys.exit(main(["cache=cache", "cluster=inline", *case["arguments"]]))
    return child


def ended(case, child):
    """Exit status of a process, which gets its signal when it has written a pack."""
    if number := case.get("signal"):
        while not list(Path(case["folder"], "cache").rglob("*.pack")):
            if os.waitpid(child, os.WNOHANG)[0]:
                return None
            time.sleep(0.01)
        os.kill(child, number)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def imported():
    """Have the modules that a command imports on its way; no place may be read before forking."""
    with contextlib.redirect_stdout(io.StringIO()):
        assert Command(SPRINGS).main(["--settings"]) == 0


if __name__ == "__main__":
    # Commands in the background of a shell ignore the one, and those of nohup the other.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    imported()
    json.dump([ended(case, started(case)) for case in json.load(sys.stdin)], sys.stdout)
