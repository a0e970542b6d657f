"""Run commands in processes forked from one that has imported all that they need.

Run as a script with the name of a module and its function, which takes the arguments of a command
line, and a list of cases on stdin, as JSON: the folder, the arguments, where stdout and stderr go
('full': /dev/full; 'pipe': one that is closed; 'closed'; or the encoding of the files `out` and
`err` of the folder) and, optionally, environment variables and the signal that the command gets
after its first results. Prints the list of exit statuses, as JSON.
"""

import io
import json
import os
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def statuses(module, function, cases):
    """Run a command for each case, and return the exit statuses."""
    search = [str(ROOT), *map(str, Path(__file__).parent.glob("*/"))]
    done = subprocess.run(
        [sys.executable, __file__, module, function],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(search)},
        input=json.dumps(cases),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        timeout=120,
    )
    return json.loads(done.stdout)


def stream(number, kind):
    """Redirect a standard stream into a file, or to a place that cannot be written."""
    if kind == "closed":
        os.close(number)
        return None
    if kind == "pipe":
        reading, target = os.pipe()
        os.close(reading)
    else:
        path = "/dev/full" if kind == "full" else ("out", "err")[number - 1]
        target = os.open(path, os.O_WRONLY | os.O_CREAT)
    os.dup2(target, number)
    encoding = "utf-8" if kind in ("full", "pipe") else kind
    raw = io.FileIO(number, "w", closefd=False)
    return io.TextIOWrapper(raw, encoding, write_through=number == 2)


def started(main, case):
    """Fork a process that runs a command, and return its id."""
    child = os.fork()
    if child == 0:
        os.chdir(case["folder"])
        os.environ.update(case.get("environment", {}))
        sys.stdout, sys.stderr = map(stream, (1, 2), case["output"])
        sys.exit(main(case["arguments"]))
    return child


def ended(case, child):
    """Return the exit status of a process, which gets its signal once it has written a pack."""
    if number := case.get("signal"):
        while not list(Path(case["folder"], "cache").rglob("*.pack")):
            if os.waitpid(child, os.WNOHANG)[0]:
                return None
            time.sleep(0.01)
        os.kill(child, number)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


if __name__ == "__main__":
    # Commands in the background of a shell ignore SIGINT, and commands of nohup SIGHUP.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    module, function = sys.argv[1:]
    main = getattr(import_module(module), function)
    json.dump([ended(case, started(main, case)) for case in json.load(sys.stdin)], sys.stdout)
