"""Executors on a dask cluster: of this machine, of Slurm, or one that is already running.

Tasks are pickled functions, so any client of a worker can run code there. Therefore the scheduler
and workers started here accept only holders of a certificate made for the run, which no other user
can read; processes of this machine listen on loopback only.
"""

from __future__ import annotations

import asyncio
import logging
import os
import time
from asyncio.subprocess import DEVNULL, PIPE
from collections.abc import Awaitable, Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import urlsplit

import dask
from dask.system import CPU_COUNT
from distributed import Client, Future, KilledWorker, LocalCluster, Status, as_completed
from distributed.core import rpc
from distributed.security import Security
from distributed.threadpoolexecutor import ThreadPoolExecutor
from tornado.ioloop import PeriodicCallback

from sweeps.engine.declare.errors import ConfigurationError, SweepIncompleteError
from sweeps.engine.run.cluster import import_jobqueue
from sweeps.engine.run.forking import ENVIRONMENT, block_interrupts
from sweeps.engine.run.interpreter import relax_gc
from sweeps.engine.run.process import environment, one_thread
from sweeps.engine.run.shared import RequirementError, Requirements

DASK_SETTINGS = {
    "distributed.admin.large-graph-warning-threshold": "1GB",
    "distributed.admin.low-level-log-length": 0,  # each message has a whole task
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.tick.cycle": "5s",
    "distributed.admin.tick.interval": "1s",
    "distributed.comm.timeouts.connect": "60s",
    "distributed.scheduler.allowed-failures": 1,
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.profile.enabled": False,
}
# The scheduler's HTTP server is not encrypted, and by default listens on all interfaces.
SCHEDULER = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}

COUNT_INTERVAL = 1.0  # s between counts of a running cluster's workers
ANSWER_SECONDS, ARRIVAL_SECONDS = 10, 60  # s to wait for a scheduler; for its first worker
CHECK_INTERVAL = 1.0  # s between checks of workers
JOB_INTERVAL = 10.0  # s between checks whether a job has ended, for example by its time limit
LOST_SECONDS = 30.0  # s in which a job may restart a lost worker before it counts as ended
MAX_FAILED_CHECKS = 3  # in a row without a worker, after which no more jobs are submitted
SCHEDULER_GONE = "the scheduler of the cluster is gone; the same command resumes the sweep"

SCRATCH_SETTING = "temporary-directory"
# Removing a scratch folder must not fail for a file that a dying worker still writes.
CLEANUP_OPTIONS: dict[str, Any] = {"ignore_cleanup_errors": True}

# Runs all tasks of this process; a daemon thread, unlike threads of `concurrent.futures`.
_thread = ThreadPoolExecutor(1, thread_name_prefix="task")

TaskResult = tuple[int, Any, Exception | None]
Say = Callable[[str], None]


def run_task(shared: Requirements, function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """Call a function in the task thread of this process, with one thread for numerical libraries.

    Raises `RequirementError` if this process has other code or another cache.
    """
    shared.check()
    relax_gc()

    def call() -> Any:
        with one_thread():
            return function(*arguments)

    return _thread.submit(call).result()


class DaskExecutor:
    """Executor on the workers of a dask cluster with the same code. See `cluster.Executor`."""

    def __init__(self, client: Client, workers: int | None, shared: Requirements) -> None:
        self._client = client
        self._workers, self._last_count, self._recount_at = workers, 1, 0.0
        self._shared = shared
        self._cancel_error: Exception = SweepIncompleteError(SCHEDULER_GONE)
        self._completed = as_completed(loop=client.loop)
        self._running: dict[Future, int] = {}

    @property
    def worker_count(self) -> int:
        """Number of started processes or, on a running cluster, of those present a moment ago."""
        if self._workers is None and time.monotonic() >= self._recount_at:  # called with every task
            with suppress(OSError):  # the scheduler may be gone, as `wait` finds out
                self._last_count = max(1, len(self._client.nthreads()))
            self._recount_at = time.monotonic() + COUNT_INTERVAL
        return self._workers or self._last_count

    def submit(self, number: int, function: Callable[..., Any], *arguments: Any) -> None:
        """Send a task to the scheduler."""
        future = self._client.submit(run_task, self._shared, function, arguments, pure=False)
        self._running[future] = number
        self._completed.add(future)

    def wait(self) -> list[TaskResult]:
        """Wait for a task to finish; raises `SweepIncompleteError` if the scheduler is gone."""
        if not self._running:
            return []
        # wakes up ten times a second, to handle interrupts
        batch = self._completed.next_batch()
        done = [future for future in batch if future.status == "finished"]
        try:  # all in one call, in a quarter of the time
            results = dict(zip(done, self._client.gather(done), strict=True))
        except (Exception, CancelledError):  # some tasks failed: `_outcome` handles each
            results = {}
        return [self._outcome(future, results) for future in batch]

    async def abandon(self, why: str) -> None:
        """Cancel all tasks, for which `wait` then raises ConfigurationError."""
        self._cancel_error = ConfigurationError(why)
        await self._client.cancel([*self._running], asynchronous=True)

    def _outcome(self, future: Future, results: Mapping[Future, Any]) -> TaskResult:
        number = self._running.pop(future)
        if future in results:
            return number, results[future], None
        if future.cancelled():
            raise self._cancel_error
        try:
            return number, future.result(), None
        except KilledWorker:
            reason = "the worker process died whenever it ran this task (out of memory?)"
            return number, None, RuntimeError(reason)
        except RequirementError as error:  # of a worker that joined later
            raise ConfigurationError(f"a worker of the cluster {error}") from None
        except Exception as error:
            return number, None, error


@contextmanager
def local(
    *, workers: int | None, tasks: int, say: Say, shared: Requirements, method: str = "spawn"
) -> Iterator[DaskExecutor]:
    """Start worker processes on this machine, which always end with this process.

    `method` is the start method of `multiprocessing`; see `forking.start_fork_server`.
    """
    count = max(1, min(workers or CPU_COUNT, tasks))
    say(f"starting {count} worker process{'es' if count > 1 else ''}")
    # Workers share the terminal, to which a dying worker would log.
    quiet = {"DASK_LOGGING__DISTRIBUTED": "critical"}
    with ExitStack() as stack:
        # In dask's common scratch folder, all would wait for a lock that any user may hold.
        scratch = stack.enter_context(TemporaryDirectory(prefix="sweep-", **CLEANUP_OPTIONS))
        settings = {SCRATCH_SETTING: scratch, "distributed.worker.multiprocessing-method": method}
        stack.enter_context(_dask_environment(DASK_SETTINGS | settings, ENVIRONMENT | quiet))
        try:
            with block_interrupts():
                cluster = stack.enter_context(
                    LocalCluster(
                        n_workers=count,
                        threads_per_worker=1,
                        env=dict(os.environ),  # they may be forked from an older process
                        host="127.0.0.1",
                        protocol="tls://",
                        security=Security.temporary(),
                        dashboard_address=None,
                        scheduler_kwargs=SCHEDULER,
                        silence_logs=logging.CRITICAL,
                    )
                )
        except (OSError, RuntimeError, EOFError) as error:  # for example without shared memory
            cause = error.__cause__ or error.__context__ or error
            raise ConfigurationError(
                "cluster.kind is local, but no worker process can be started here "
                f"({cause}); it may be inline"
            ) from error
        stack.enter_context(_maintain_workers(cluster, count, every=CHECK_INTERVAL))
        yield DaskExecutor(stack.enter_context(Client(cluster)), count, shared)


@contextmanager
def address(
    *, tasks: int, say: Say, shared: Requirements, address: str, **files: str | None
) -> Iterator[DaskExecutor]:
    """Connect to a running scheduler. Each of its worker processes runs one task at a time."""
    host = urlsplit(address).hostname or ""
    if files["ca_file"] is None and not (host in {"localhost", "::1"} or host.startswith("127.")):
        say(f"the traffic with {address} is neither encrypted nor authenticated")
    with ExitStack() as stack:
        timeout = {"distributed.comm.timeouts.connect": f"{ANSWER_SECONDS}s"}
        stack.enter_context(_dask_environment(timeout, {}))
        security = Security() if files["ca_file"] is None else _make_security(**files)
        try:
            _check_scheduler(address, security)
            client = stack.enter_context(Client(address, security=security, timeout=ANSWER_SECONDS))
        except Exception as error:  # of any kind, since any server may listen there
            raise ConfigurationError(
                f"cluster.address is {address}, but no scheduler answers there "
                f"({str(error) or type(error).__name__})"
            ) from error
        say(f"waiting for a worker of {address}")
        try:
            client.wait_for_workers(1, timeout=ARRIVAL_SECONDS)
        except TimeoutError as error:
            problem = f"cluster.address is {address}, but its scheduler has no workers"
            raise ConfigurationError(problem) from error
        for worker, problem in client.run(shared.check, on_error="return").items():
            if problem is not None:
                is_known = isinstance(problem, RequirementError)
                reason = problem if is_known else f"cannot be asked: {problem}"
                problem = f"its worker {worker} {reason}"
                raise ConfigurationError(f"cluster.address is {address}, but {problem}")
        yield DaskExecutor(client, None, shared)


@contextmanager
def slurm(
    *, workers: int, tasks: int, say: Say, shared: Requirements, **options: Any
) -> Iterator[DaskExecutor]:
    """Submit Slurm jobs with some settings, and cancel them at the end.

    Until then, a private folder in the current directory holds the certificate of the run and the
    output of the jobs. The jobs must be able to read it.
    """
    jobs = max(1, min(workers, tasks))
    say(f"submitting {jobs} job{'s' if jobs > 1 else ''} to Slurm")
    settings = DASK_SETTINGS | {"distributed.deploy.lost-worker-timeout": f"{LOST_SECONDS}s"}
    with ExitStack() as stack:
        private = TemporaryDirectory(prefix=".sweep-", dir=os.getcwd(), **CLEANUP_OPTIONS)
        folder = stack.enter_context(private)
        stack.enter_context(_dask_environment(settings | {SCRATCH_SETTING: folder}, ENVIRONMENT))
        try:
            with block_interrupts():
                cluster = stack.enter_context(_make_slurm_cluster(Path(folder), options))
            _submit_first_jobs(cluster, jobs)
        except RuntimeError as error:  # with Slurm's own message, if it refused
            reason = " ".join(str(error).rpartition("stderr:")[2].split())
            problem = f"cluster.kind is slurm, but no job starts: {reason}"
            raise ConfigurationError(problem) from error
        run = DaskExecutor(stack.enter_context(Client(cluster)), jobs, shared)
        look = _SlurmQueue(cluster, run, Path(folder), say).check
        stack.enter_context(_maintain_workers(cluster, jobs, every=JOB_INTERVAL, look=look))
        yield run


def _check_scheduler(url: str, security: Security) -> None:
    """Raise an exception if no scheduler answers at an address soon.

    A client of dask waits for the first answer without limit.
    """

    async def connect() -> str:
        async with rpc(url, connection_args=security.get_connection_args("client")) as peer:
            return (await asyncio.wait_for(peer.identity(), ANSWER_SECONDS))["type"]

    # In another thread: the main thread of a notebook already runs an event loop.
    kind = _thread.submit(asyncio.run, connect()).result()
    if not kind.endswith("Scheduler"):
        raise ValueError(f"{url} is a {kind}")


def _make_security(ca_file: str | None, cert: str | None, private_key: str | None) -> Security:
    """Return the certificates of client, scheduler and workers."""
    roles = ("client", "scheduler", "worker")
    certificates = {f"tls_{role}_cert": cert for role in roles}
    certificates |= {f"tls_{role}_key": private_key for role in roles}
    security = Security(tls_ca_file=ca_file, require_encryption=True, **certificates)
    try:
        security.get_connection_args("client")
    except OSError as error:
        raise ConfigurationError(
            f"cluster.ca_file, cluster.cert and cluster.private_key are {ca_file}, {cert} and "
            f"{private_key or 'null'}, but must be PEM files, and the key of the certificate"
        ) from error
    return security


def _make_slurm_cluster(folder: Path, options: Mapping[str, Any]) -> Any:
    """Return a cluster without jobs, whose certificate, logs and scratch files are in a folder."""
    tls, certificate, key = Security.temporary(), folder / "certificate.pem", folder / "key.pem"
    certificate.write_text(tls.tls_client_cert, encoding="ascii")
    key.write_text(tls.tls_client_key, encoding="ascii")
    return import_jobqueue("slurm")(
        **options,
        cores=1,
        processes=1,
        local_directory=str(folder),
        protocol="tls://",
        security=_make_security(str(certificate), str(certificate), str(key)),
        log_directory=str(folder),
        scheduler_options=SCHEDULER,
        job_script_prologue=[f"export {name}={value}" for name, value in ENVIRONMENT.items()],
        worker_extra_args=["--no-dashboard", "--dashboard-address", SCHEDULER["dashboard_address"]],
        silence_logs=logging.CRITICAL,
    )


def _submit_first_jobs(cluster: Any, jobs: int) -> None:
    """Submit the first jobs; raise RuntimeError with Slurm's message if it refuses."""
    for _ in range(jobs):
        cluster.worker_spec.update(cluster.new_worker_spec())

    async def submit_jobs() -> None:
        await cluster  # unlike `scale`, which only logs that a job was refused

    try:
        cluster.sync(submit_jobs)
    except RuntimeError:
        for job in cluster.workers.values():
            if job.job_id is None:  # else the cluster does not close
                job.status = Status.failed
        raise


class _SlurmQueue:
    """Slurm's queue: ended jobs, and the reasons why others wait."""

    def __init__(self, cluster: Any, run: DaskExecutor, folder: Path, say: Say) -> None:
        self._cluster, self._run, self._folder, self._say = cluster, run, folder, say
        self._reported: set[str] = set()
        self._failed_checks = 0  # checks that found ended jobs, since there was a worker

    async def check(self) -> None:
        """Mark ended jobs, report why others wait, and give up if jobs end without a worker."""
        jobs = [job for job in self._cluster.workers.values() if job.job_id]
        command = ("squeue", "--me", "--noheader", "--format=%A %t %r")
        process = await asyncio.create_subprocess_exec(*command, stdout=PIPE, stderr=DEVNULL)
        out, _ = await process.communicate()
        if process.returncode:
            return
        lines = [line.split(maxsplit=2) for line in out.decode().splitlines()]
        listed = {number: reason if state == "PD" else "" for number, state, reason in lines}
        ended = [job for job in jobs if job.job_id not in listed]
        for job in ended:
            job.status = Status.closed
        if self._cluster.scheduler.workers:
            self._failed_checks = 0
            return
        self._failed_checks += bool(ended)
        if self._failed_checks == MAX_FAILED_CHECKS:
            logs = sorted(self._folder.glob("*.err"), key=os.path.getmtime)
            last = logs[-1].read_text(errors="replace").split("\n") if logs else []
            message = next((line.strip() for line in reversed(last) if line.strip()), "no message")
            problem = f"its jobs end before a worker starts ({message})"
            await self._run.abandon(f"cluster.kind is slurm, but {problem}")
        reasons = {listed.get(job.job_id, "") for job in jobs} - {"", "None"} - self._reported
        for reason in sorted(reasons):
            self._reported.add(reason)
            self._say(f"no Slurm job has a worker yet ({reason})")


@contextmanager
def _maintain_workers(
    cluster: Any, count: int, *, every: float, look: Callable[[], Awaitable[None]] | None = None
) -> Iterator[None]:
    """Replace dead workers, checking every few seconds.

    Dask restarts a worker process that dies, but gives up on a worker that dies while starting, for
    example by its first task. It does not replace a job that ended.
    """

    async def replace_dead_workers() -> None:
        if look is not None:
            with suppress(OSError):  # squeue cannot be started now
                await look()
        for name, worker in list(cluster.workers.items()):
            if worker.status in {Status.closed, Status.failed}:
                del cluster.workers[name], cluster.worker_spec[name]
        cluster.scale(count)  # starts the missing ones

    callback = PeriodicCallback(replace_dead_workers, 1000 * every)
    cluster.loop.add_callback(callback.start)
    try:
        yield
    finally:
        cluster.loop.add_callback(callback.stop)


@contextmanager
def _dask_environment(settings: Mapping[str, Any], variables: Mapping[str, str]) -> Iterator[None]:
    """Configure dask and its workers' environment within this context; suppress its logs."""
    # Failures come back with their tasks; dask's other messages are not needed.
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [logger.level for logger in loggers]
    # A variable of this process overrides the value configured for workers, so set both. dask
    # also sets these variables, and the hash seed, in this process, so restore them afterwards.
    settings = {**settings, "distributed.nanny.pre-spawn-environ": dict(variables)}
    with environment(variables, "PYTHONHASHSEED"), dask.config.set(settings):
        for logger in loggers:
            logger.setLevel(logging.CRITICAL)
        try:
            yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)
