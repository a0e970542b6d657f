"""What tests have executors do, and what they ask of the outcomes."""

import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from sweeps.engine.cluster import executor
from sweeps.engine.errors import ConfigurationError

IMPORTS = f"{Path(__file__).parent}:{Path(__file__).parents[2]}"


def silent(_sentence):
    pass


def draw(seed, size):
    return np.random.default_rng(seed).normal(size=size)


def refuse_odd(number):
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number


def span(seconds):
    """Process and thread of a task, and when it ran."""
    begin = time.monotonic()
    time.sleep(seconds)
    return os.getpid(), threading.get_ident(), begin, time.monotonic()


def blas_threads():
    return [library["num_threads"] for library in threadpool_info()]


def started_with():
    """What the process itself was started with, whatever was set in it since."""
    lines = Path("/proc/self/environ").read_bytes().split(b"\0")
    return {line.decode() for line in lines}


def gather(run):
    """Outcomes of all submitted tasks, by number."""
    outcomes = {}
    while batch := run.finished():
        outcomes |= {number: (result, error) for number, result, error in batch}
    return outcomes


def result_of(run, function, *arguments):
    run.submit(0, function, *arguments)
    ((result, error),) = gather(run).values()
    assert error is None
    return result


def eventually(condition):
    """Wait until a condition holds."""
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline, "it never came about"
        time.sleep(0.02)


def written(security, folder):
    """Choice of certificates that are written into a folder."""
    texts = {"ca": security.tls_ca_file, "key": security.tls_client_key}
    texts["cert"] = security.tls_client_cert
    for name, text in texts.items():
        (folder / f"{name}.pem").write_text(text)
    return {
        "ca_file": f"{folder}/ca.pem",
        "cert": f"{folder}/cert.pem",
        "private_key": f"{folder}/key.pem",
    }


def fails_with(choice, sentence):
    with (
        pytest.raises(ConfigurationError, match=f"^{sentence}$"),
        executor(choice, say=silent),
    ):
        pass
