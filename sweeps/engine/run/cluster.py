"""Choice of a cluster, the interface of executors, and the inline executor."""

from __future__ import annotations

import re
import shutil
import signal
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.run.process import one_thread

# Settings of each kind of cluster; all others must be null.
SETTINGS_OF_KIND = {
    "inline": (),
    "local": ("workers",),
    "address": ("address", "ca_file", "cert", "private_key"),
    "slurm": ("workers", "queue", "account", "walltime", "memory", "interface"),
}
# Required settings of each kind of cluster, and their meaning.
REQUIRED_SETTINGS = {
    "address": {"address": "the address of a dask scheduler"},
    "slurm": {"workers": "the number of jobs", "memory": "the memory of a job, such as 4GiB"},
}
# For each kind of job queue, the class of dask-jobqueue and the command that submits jobs.
JOB_QUEUES = {"slurm": ("SLURMCluster", "sbatch")}
# Pattern that a setting must match, and its description.
PATTERNS = {
    "address": (r"(tcp|tls)://(\[[\d:a-f]+\]|[^\s:/\[\]]+):\d+", "like tls://10.0.0.1:8786"),
    "memory": (r"\d+(\.\d+)? ?[kMGT]i?B", "a number of bytes such as 4GiB"),
    "walltime": (r"(\d+-)?\d+(:\d+){0,2}", "a time of Slurm such as 12:00:00 or 1-12:00:00"),
    # These go into a job script.
    "queue": (r"[\w.,@+-]+", "the name of a Slurm partition"),
    "account": (r"[\w.@+-]+", "the name of a Slurm account"),
    "interface": (r"[\w.@+-]+", "the name of a network interface such as ib0"),
}


@dataclass(frozen=True)
class ClusterChoice:
    """Choice of the cluster that runs the tasks: consistent values of the `Cluster` settings.

    Raises `ConfigurationError` if they are inconsistent. Kinds are `inline` (this process), `local`
    (processes of this machine), `address` (a running dask scheduler) and `slurm` (jobs submitted
    with `sbatch`, each one task at a time on one core).
    """

    kind: str = "local"
    workers: int | None = None  # processes, by default one per core, or jobs
    address: str | None = None
    # PEM files for a `tls://` address: certificate authority, and certificate and private key of
    # this client; the key may be in the certificate's file.
    ca_file: str | None = None
    cert: str | None = None
    private_key: str | None = None
    queue: str | None = None
    account: str | None = None
    walltime: str | None = None
    memory: str | None = None
    interface: str | None = None  # network interface between jobs and this process

    def __post_init__(self) -> None:
        condition = f"when cluster.kind is {self.kind}"
        required = REQUIRED_SETTINGS.get(self.kind, {})
        for name, value in list(asdict(self).items())[1:]:
            if value is None:
                if name in required:
                    raise _setting_error(name, None, f"{required[name]} {condition}")
            elif name not in SETTINGS_OF_KIND[self.kind]:
                raise _setting_error(name, value, f"null {condition}")
            elif name in PATTERNS and not re.fullmatch(PATTERNS[name][0], value):
                raise _setting_error(name, value, PATTERNS[name][1])
        is_encrypted = str(self.address).startswith("tls://")
        for name in ("ca_file", "cert", "private_key"):
            path = getattr(self, name)
            if path is not None and not is_encrypted:
                raise _setting_error(name, path, "null unless cluster.address begins with tls://")
            if path is None and is_encrypted and name != "private_key":
                raise _setting_error(name, None, "a PEM file if cluster.address begins with tls://")
            if path is not None and not Path(path).is_file():
                raise _setting_error(name, path, "an existing PEM file")


def _setting_error(name: str, value: Any, allowed: str) -> ConfigurationError:
    text = "null" if value is None else value
    return ConfigurationError(f"cluster.{name} is {text}, but must be {allowed}")


class Executor(Protocol):
    """Runs tasks, each identified by a number.

    Tasks of one process run one at a time, all in the same thread, since a renderer must be
    used by the thread that created it. Numerical libraries use one thread.
    """

    @property
    def worker_count(self) -> int:
        """Number of tasks that run at once, which may change on a running cluster."""

    def submit(self, number: int, function: Callable[..., Any], *arguments: Any) -> None:
        """Submit a task: call a function with some arguments."""

    def wait(self) -> list[tuple[int, Any, Exception | None]]:
        """Wait for tasks to finish; return number, result and error of each; empty if none runs."""


class InlineExecutor:
    """Runs tasks in this process, in the order of their submission. See `Executor`."""

    worker_count = 1

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, Callable[..., Any], tuple[Any, ...]]] = deque()

    def submit(self, number: int, function: Callable[..., Any], *arguments: Any) -> None:
        """Queue a task."""
        self._waiting.append((number, function, arguments))

    def wait(self) -> list[tuple[int, Any, Exception | None]]:
        """Run the oldest task."""
        if not self._waiting:
            return []
        number, function, arguments = self._waiting.popleft()
        try:
            with one_thread():  # some libraries have a limit for each thread that calls them
                return [(number, function(*arguments), None)]
        except Exception as error:
            return [(number, None, error)]


def import_jobqueue(kind: str) -> Any:
    """Return dask's class of clusters of a job queue; only the main thread can import it first.

    Raises ConfigurationError if it is not installed, or this machine cannot submit jobs.
    """
    before = signal.getsignal(signal.SIGINT)
    try:
        import dask_jobqueue
    except (ImportError, ValueError) as error:
        raise ConfigurationError(
            f"cluster.kind is {kind}, but dask-jobqueue (pip install dask-jobqueue) cannot be "
            f"imported: {error}"
        ) from error
    if signal.getsignal(signal.SIGINT) is not before:  # its import would let Ctrl-C exit at once
        signal.signal(signal.SIGINT, before)
    name, submit = JOB_QUEUES[kind]
    if shutil.which(submit) is None:
        raise ConfigurationError(
            f"cluster.kind is {kind}, but this machine has no {submit} command"
        )
    return getattr(dask_jobqueue, name)
