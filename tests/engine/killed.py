"""Run sweeps of the springs that end at a given file operation, each in a forked process.

Run as a script, it reads a line of JSON from stdin for each sweep: the number of the operation,
the folder, the names of store and cache in it, and the settings. It prints a line when the sweep
has ended. The parent never accesses a store or cache: a fork would lack the threads this starts.
"""

import json
import os
import subprocess
import sys
from functools import cache, wraps
from pathlib import Path

from running import ROOT

METHODS = ("get", "read_range", "put", "_delete", "list_objects")
EVENTS = {"open", "os.rename", "os.mkdir", "os.remove", "os.rmdir", "os.truncate"}


@cache
def _forking():
    path = Path(__file__)
    paths = os.pathsep.join(map(str, (ROOT, path.parents[1], path.parent)))
    return subprocess.Popen(
        [sys.executable, path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": paths},
    )


def killed_at(moment, store, cache, values):
    """Run a sweep in a process that exits, as by SIGKILL, at file operation number `moment`."""
    forking = _forking()
    case = [moment, str(store.parent), store.name, cache.name, values]
    forking.stdin.write(json.dumps(case) + "\n")
    forking.stdin.flush()
    assert forking.stdout.readline() == "ended\n"


def main():
    """Run the sweeps that stdin lists, one a line."""
    import xarray  # noqa: F401  tables need it
    from toys import go

    from sweeps.engine.objects import Objects

    for line in sys.stdin:
        moment, folder, store, cache, values = json.loads(line)
        child = os.fork()
        if child == 0:
            countdown = moment

            def touched():
                nonlocal countdown
                countdown -= 1
                if countdown == 0:
                    os._exit(9)

            def counted(method):
                @wraps(method)
                def call(*arguments):
                    touched()
                    result = method(*arguments)
                    touched()
                    return result

                return call

            def hook(event, arguments, folder=folder):
                if event in EVENTS and folder in str(arguments[0]):
                    touched()

            for name in METHODS:
                setattr(Objects, name, counted(getattr(Objects, name)))
            sys.addaudithook(hook)
            try:
                go(Path(folder, store), Path(folder, cache), **values)
            finally:
                os._exit(0)
        _, status = os.waitpid(child, 0)
        print("ended" if os.waitstatus_to_exitcode(status) in (0, 9) else "failed", flush=True)


if __name__ == "__main__":
    main()
