"""Script that runs a sweep and suspends one of its workers for a minute while it computes.

Its argument is a folder. Each computation creates a file there, named by its cell and process.
"""

import json
import os
import sys
import time
from pathlib import Path

from executors import eventually, meanwhile, running_server
from toys import Few, run_few

from sweeps.engine.declare.stage import Group, Output, stage

MINUTE = 60.0
MARKS = "SWEEP_TEST_MARKS"  # environment variable that holds the path of the folder


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def slow(size):
    """Create the file of this computation, wait two seconds and return a number."""
    mark = Path(os.environ[MARKS]) / f"{size} {os.getpid()} {time.monotonic_ns()}"
    mark.touch()
    time.sleep(2)
    return size**0.5


def main(folder):
    """Sweep six cells with two workers; print failures, the suspended worker and the duration."""
    os.environ[MARKS] = str(folder)
    victims = []

    def cut_off():
        eventually(lambda: list(folder.glob("* * *")))
        first = int(next(folder.glob("* * *")).name.split()[1])
        (victim,) = (process for process in running_server().children() if process.pid == first)
        victims.append(victim.pid)
        victim.suspend()
        time.sleep(MINUTE)
        victim.resume()

    begin = time.monotonic()
    with meanwhile(cut_off):
        options = {"sizes": range(1, 7), "kind": "local", "workers": 2}
        finished = run_few([slow], folder / "s.zarr", **options)
    took = time.monotonic() - begin
    print(json.dumps({"failures": finished.failures, "victim": victims[0], "took": took}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
