"""Tasks that tests submit to executors, and helpers that start, inspect and await them."""

import json
import os
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import forkserver
from pathlib import Path

import numpy as np
import psutil
import pytest
from distributed.security import Security
from threadpoolctl import threadpool_info

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor
from sweeps.engine.run.process import ONE_THREAD

QUIET = ("--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")
IMPORTS = ":".join(str(folder) for folder in Path(__file__).parents[:3])


def silent(_sentence):
    pass


def draw(seed, size):
    return np.random.default_rng(seed).normal(size=size)


def refuse_odd(number):
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number


def span(seconds):
    """Sleep; return the process and thread of this task, and when it began and ended."""
    begin = time.monotonic()
    time.sleep(seconds)
    return os.getpid(), threading.get_ident(), begin, time.monotonic()


def blas_threads():
    return [library["num_threads"] for library in threadpool_info()]


def started_with():
    """Return the environment this process was started with, as a set of NAME=VALUE."""
    lines = Path("/proc/self/environ").read_bytes().split(b"\0")
    return {line.decode() for line in lines}


def gather(run):
    """Wait for all submitted tasks; return result and error of each by its number."""
    outcomes = {}
    while batch := run.wait():
        outcomes |= {number: (result, error) for number, result, error in batch}
    return outcomes


def result_of(run, function, *arguments):
    run.submit(0, function, *arguments)
    ((result, error),) = gather(run).values()
    assert error is None
    return result


def eventually(condition):
    """Wait until a condition holds; fail after a minute."""
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, "it never came about"
        time.sleep(0.02)


def running_server():
    """Return the fork server that forks the workers of this process; None if there is none."""
    for child in psutil.Process().children():
        with suppress(psutil.Error):  # the child may have just ended
            is_server = any(forkserver.__name__ in word for word in child.cmdline())
            if is_server and child.status() != psutil.STATUS_ZOMBIE:
                return child
    return None


def parsed(path):
    """Return the content of a JSON file; None if it is absent or not yet completely written."""
    try:
        return json.loads(path.read_text())
    except (FileNotFoundError, json.JSONDecodeError):
        return None


def written(security, folder):
    """Write certificates into a folder; return the cluster settings that name these files."""
    texts = {"ca": security.tls_ca_file, "key": security.tls_client_key}
    texts["cert"] = security.tls_client_cert
    for name, text in texts.items():
        (folder / f"{name}.pem").write_text(text)
    return {
        "ca_file": f"{folder}/ca.pem",
        "cert": f"{folder}/cert.pem",
        "private_key": f"{folder}/key.pem",
    }


@contextmanager
def cluster_at(folder, **variables):
    """Run a scheduler with two workers of two threads each; yield its choice and the processes.

    The processes get `variables` in addition to the environment of this process.
    """
    folder.mkdir(exist_ok=True)
    files = written(Security.temporary(), folder)
    tls = ("--tls-ca-file", files["ca_file"], "--tls-cert", files["cert"], "--tls-key")
    shared = ("--scheduler-file", folder / "scheduler.json", *QUIET, *tls, files["private_key"])
    commands = [("scheduler", *shared, "--protocol", "tls://", "--port", "0")] + [
        ("worker", *shared, "--nthreads", "2", "--no-nanny")
    ] * 2
    processes = []
    with ExitStack() as stack:
        for name, *arguments in commands:
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{name}", *map(str, arguments)],
                cwd=folder,
                env=os.environ
                | dict.fromkeys(ONE_THREAD, "2")
                | {"PYTHONPATH": IMPORTS}
                | variables,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
            processes.append(process)
        eventually(lambda: parsed(folder / "scheduler.json"))
        address = parsed(folder / "scheduler.json")["address"]
        yield ClusterChoice(kind="address", address=address, **files), processes


@contextmanager
def meanwhile(function):
    """Call a function in a thread during the `with` block; assert that it raises no error."""
    errors = []

    def called():
        try:
            function()
        except BaseException as error:
            errors.append(error)
            raise

    thread = threading.Thread(target=called)
    thread.start()
    yield
    thread.join()
    assert not errors


def fails_with(choice, sentence, **options):
    with (
        pytest.raises(ConfigurationError, match=f"^{sentence}$"),
        open_executor(choice, say=silent, **options),
    ):
        pass
