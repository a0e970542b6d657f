"""Executors of tasks: this process, local processes, or a cluster; and what they must share."""

from __future__ import annotations

import hashlib
import re
import shutil
import signal
import sys
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.forking import start_method, worth_importing
from sweeps.engine.modules import ENGINE, SHADERS, files, place
from sweeps.engine.places import Objects, is_own
from sweeps.engine.process import one_thread

# Settings that each kind of cluster reads; all others must be null.
READ = {
    "inline": (),
    "local": ("workers",),
    "address": ("address", "ca_file", "cert", "private_key"),
    "slurm": ("workers", "queue", "account", "walltime", "memory", "interface"),
}
# Required settings of each kind of cluster, and their meaning.
REQUIRED = {
    "address": {"address": "the address of a dask scheduler"},
    "slurm": {"workers": "the number of jobs", "memory": "the memory of a job, such as 4GiB"},
}
# Pattern that a setting must match, and its description.
FORMS = {
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
    """Choice of the cluster that runs the tasks: values of `Cluster` settings that fit together.

    Raises `ConfigurationError` if they do not. Kinds are `inline` (this process), `local`
    (processes of this machine), `address` (a running dask scheduler) and `slurm` (jobs submitted
    with `sbatch`, each one task at a time on one core).
    """

    kind: str = "local"
    workers: int | None = None  # processes, by default one a core, or jobs
    address: str | None = None
    ca_file: str | None = None  # PEM files for a `tls://` address: the authority, and certificate
    cert: str | None = None  # and private key of this client; the key may be in the certificate's
    private_key: str | None = None
    queue: str | None = None
    account: str | None = None
    walltime: str | None = None
    memory: str | None = None
    interface: str | None = None  # network interface between jobs and this process

    def __post_init__(self) -> None:
        where = f"when cluster.kind is {self.kind}"
        required = REQUIRED.get(self.kind, {})
        for name, value in list(asdict(self).items())[1:]:
            if value is None:
                if name in required:
                    raise _wrong(name, None, f"{required[name]} {where}")
            elif name not in READ[self.kind]:
                raise _wrong(name, value, f"null {where}")
            elif name in FORMS and not re.fullmatch(FORMS[name][0], value):
                raise _wrong(name, value, FORMS[name][1])
        encrypted = str(self.address).startswith("tls://")
        for name in ("ca_file", "cert", "private_key"):
            path = getattr(self, name)
            if path is not None and not encrypted:
                raise _wrong(name, path, "null unless cluster.address begins with tls://")
            if path is None and encrypted and name != "private_key":
                raise _wrong(name, None, "a PEM file if cluster.address begins with tls://")
            if path is not None and not Path(path).is_file():
                raise _wrong(name, path, "an existing PEM file")


def _wrong(name: str, value: Any, allowed: str) -> ConfigurationError:
    given = "null" if value is None else value
    return ConfigurationError(f"cluster.{name} is {given}, but must be {allowed}")


class Executor(Protocol):
    """Runs tasks, each identified by a number.

    Tasks of one process run one at a time, all in the same thread, since a renderer must be
    used by the thread that created it. Numerical libraries use one thread.
    """

    @property
    def workers(self) -> int:
        """Number of tasks that run at once, which may change on a running cluster."""

    def submit(self, number: int, function: Callable[..., Any], *arguments: Any) -> None:
        """Submit a task: call a function with some arguments."""

    def finished(self) -> list[tuple[int, Any, Exception | None]]:
        """Wait for tasks to finish; return number, result and error of each, if any are left."""


class InlineExecutor:
    """Runs tasks in this process, in the order of their submission. See `Executor`."""

    workers = 1

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, Callable[..., Any], tuple[Any, ...]]] = deque()

    def submit(self, number: int, function: Callable[..., Any], *arguments: Any) -> None:
        """Queue a task."""
        self._waiting.append((number, function, arguments))

    def finished(self) -> list[tuple[int, Any, Exception | None]]:
        """Run the oldest task."""
        if not self._waiting:
            return []
        number, function, arguments = self._waiting.popleft()
        try:
            with one_thread():  # some libraries have a limit for each thread that calls them
                return [(number, function(*arguments), None)]
        except Exception as error:
            return [(number, None, error)]


@contextmanager
def executor(
    choice: ClusterChoice,
    *,
    tasks: int = sys.maxsize,
    packages: Sequence[str] = (),
    modules: Sequence[str] = (),
    packs: Objects | None = None,
    say: Callable[[str], None],
) -> Iterator[Executor]:
    """Start the chosen workers, or connect to them; stop or release them afterwards.

    Parameters
    ----------
    choice : ClusterChoice
        Kind of cluster and its settings.
    tasks : int
        Upper bound of the number of tasks: no more workers than that are started.
    packages : sequence of str
        Packages, besides the engine, whose code must be the same on remote workers.
    modules : sequence of str
        Modules of the functions that tasks call: imported once for all local workers of this
        process, which do not see them change.
    packs : Objects, optional
        Where results are kept, which remote workers must see, too.
    say : callable
        Called with a sentence about what is awaited, or what the user should know.

    Yields
    ------
    Executor
        Use it only in the thread that entered this context.

    Raises
    ------
    ConfigurationError
        If the cluster cannot be reached or started, or the code or folder of a worker differs.
    """
    if choice.kind == "inline":
        yield InlineExecutor()
        return
    settings: dict[str, Any] = {name: getattr(choice, name) for name in READ[choice.kind]}
    with ExitStack() as stack:
        if choice.kind == "local":  # it imports while this process imports dask
            settings["method"] = start_method(worth_importing(modules))
        from sweeps.engine import workers  # which imports dask

        shared = Shared()
        if choice.kind != "local":
            code = {name: package_digest(name) for name in (*ENGINE, *packages)}
            shared = Shared(code, packs, f"{uuid.uuid4().hex}.mark")
            if packs:
                packs.put(shared.mark, b"")
                stack.callback(packs.delete, [shared.mark])
        start = getattr(workers, choice.kind)
        yield stack.enter_context(start(**settings, tasks=tasks, shared=shared, say=say))


def import_jobqueue() -> Any:
    """Return dask's class of clusters of Slurm jobs, which only the main thread can import first.

    Raises ConfigurationError if it is not installed, or this machine cannot submit jobs.
    """
    before = signal.getsignal(signal.SIGINT)
    try:
        from dask_jobqueue import SLURMCluster
    except (ImportError, ValueError) as error:
        raise ConfigurationError(
            "cluster.kind is slurm, but dask-jobqueue (pip install dask-jobqueue) cannot be "
            f"imported: {error}"
        ) from error
    if signal.getsignal(signal.SIGINT) is not before:  # its import would let Ctrl-C exit at once
        signal.signal(signal.SIGINT, before)
    if shutil.which("sbatch") is None:
        raise ConfigurationError("cluster.kind is slurm, but this machine has no sbatch command")
    return SLURMCluster


# what workers elsewhere share with this command ---------------------------------------------------


class OtherCode(RuntimeError):
    """The code of a process differs from that of the calling process."""


@cache
def package_digest(name: str) -> str:
    """Return the hash of all sources and shaders of a package or module; empty if it is missing."""
    found, spec = files(name, SHADERS | {".py"}), place(name)
    if spec and spec.has_location and spec.origin and not found:
        found = [(name, hashlib.sha256(Path(spec.origin).read_bytes()).hexdigest())]
    return hashlib.sha256(repr(found).encode()).hexdigest() if found else ""


def check_code(digests: Mapping[str, str]) -> None:
    """Raise `OtherCode` if the digest of a package differs in this process."""
    if other := [name for name, digest in digests.items() if package_digest(name) != digest]:
        raise OtherCode(f"has other code of {', '.join(other)}; it must have that of this process")


class Apart(RuntimeError):
    """A worker does not see the results of the command."""


class Shared(NamedTuple):
    """Digests of packages by name, where results are, and the name of a mark there."""

    code: Mapping[str, str] = {}
    packs: Objects | None = None
    mark: str = ""

    def check(self) -> None:
        """Raise `OtherCode` or `Apart` if this process has other code or sees no such mark."""
        check_code(self.code)
        if self.packs is not None:
            _check_mark(self.packs, self.mark)


UNSHARED = (OtherCode, Apart)
"""Errors of `Shared.check`."""


@cache
def _check_mark(packs: Objects, mark: str) -> None:
    """Raise `Apart` if a mark is not seen by this process, or its folder is another user's."""
    found = None
    with suppress(OSError):
        found = packs.get(mark)
    if found is None:
        what, remedy = "does not see the cache", "it must be where all of them see it"
    elif isinstance(packs.place, Path) and not is_own(packs.place):
        what, remedy = "sees files of another user in", "it must run as the same user"
    else:
        return
    raise Apart(f"{what} {str(packs.place)!r} of this command; {remedy}")
