"""Who runs the tasks: worker processes of a dask cluster, or this process itself."""

from __future__ import annotations

import logging
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from typing import Any, Protocol

from sweeps.schema import ClusterConfig

MOST_TOGETHER, ROUNDS = 8, 12  # tasks handed over at once, and how often a worker gets some

KEPT = 2**28
"""Bytes of freed memory that a worker keeps. Of dask's own 64 KiB every array would be asked of the
system, and given back, again and again: a quarter of the time of flights."""

MAPPED = 2**25
"""Bytes from which an array is mapped by itself: the most that every allocator takes."""

Outcome = tuple[tuple[Any, ...], Any, Exception | None]


class Executor(Protocol):
    """Runs a function over argument tuples."""

    def run(
        self, function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]
    ) -> Iterator[Outcome]:
        """Yield (arguments, result, exception) of every task, in the order they finish."""


class InlineExecutor:
    """Tasks one after the other in this process."""

    def run(
        self, function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]
    ) -> Iterator[Outcome]:
        """See `Executor.run`."""
        for task in tasks:
            try:
                yield task, function(*task), None
            except Exception as error:
                yield task, None, error


class DaskExecutor:
    """Tasks on the workers of a dask cluster."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def run(
        self, function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]
    ) -> Iterator[Outcome]:
        """See `Executor.run`."""
        from distributed import as_completed

        waiting = list(tasks)
        # To hand over a task takes milliseconds, so a few go together; not so many that a worker
        # idles at the end.
        workers = len(self.client.scheduler_info(n_workers=-1)["workers"])
        size = min(MOST_TOGETHER, max(1, len(waiting) // (ROUNDS * max(1, workers))))
        futures = {
            self.client.submit(_run_each, function, batch, pure=False): batch
            for batch in (waiting[i : i + size] for i in range(0, len(waiting), size))
        }
        for future in as_completed(list(futures)):
            batch = futures.pop(future)
            error = future.exception()
            outcomes = [(None, error)] * len(batch) if error else future.result()
            for task, (result, failure) in zip(batch, outcomes, strict=True):
                yield task, result, failure
            future.release()


def _run_each(
    function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]
) -> list[tuple[Any, Exception | None]]:
    """Results of some tasks, each with its own error."""
    return [(result, error) for _, result, error in InlineExecutor().run(function, tasks)]


@contextmanager
def executor(config: ClusterConfig, *, tasks: int) -> Iterator[Executor]:
    """Start the workers that a configuration asks for, and end them afterwards.

    Parameters
    ----------
    config : ClusterConfig
        Kind of cluster and number of workers; by default one a core.
    tasks : int
        How many tasks there will be: no more workers than that are started.

    Yields
    ------
    Executor
        Workers have one thread each, since a renderer belongs to its thread, and listen on
        the loopback interface only.
    """
    if config.kind == "inline":
        yield InlineExecutor()
        return
    import dask
    from distributed import Client, LocalCluster

    # Failures come back with their tasks; the rest of dask's talk is of no use here.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)

    workers = max(1, min(config.workers or len(os.sched_getaffinity(0)), tasks))
    # Numerical libraries get one thread a worker: the workers are the parallelism, and results
    # must not depend on how a product is split.
    one_thread = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS", "NUMEXPR")}
    settings = {
        "distributed.comm.timeouts.connect": "60s",
        "distributed.admin.large-graph-warning-threshold": "1GB",
        # The allocator reads these when a process starts.
        "distributed.nanny.pre-spawn-environ": one_thread
        | {"MALLOC_TRIM_THRESHOLD_": str(KEPT), "MALLOC_MMAP_THRESHOLD_": str(MAPPED)},
    }
    with dask.config.set(settings), ExitStack() as stack:
        with _interrupts_held():
            cluster = stack.enter_context(
                LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    dashboard_address=None,
                    # dask serves its health pages on a fixed port otherwise
                    scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                    silence_logs=logging.CRITICAL,
                    env=one_thread,
                )
            )
        yield DaskExecutor(stack.enter_context(Client(cluster)))


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Keep Ctrl-C, which a terminal sends to all processes, from those that are started meanwhile.

    The command itself hears it and ends its workers in order; they would add their tracebacks. An
    interrupt that arrives meanwhile is delivered at the end.
    """
    # Processes inherit the signals that the thread which starts them blocks, and threads those of
    # their starter: blocked here, an interrupt reaches neither the cluster's thread nor any worker,
    # one that is started anew later among them. Python 3.11 unblocks it where it first starts its
    # resource tracker, so that must be there already.
    resource_tracker.ensure_running()
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    in_main_thread = threading.current_thread() is threading.main_thread()
    arrived = []
    # Other threads of this process may take the signal; what it does is done in the main one.
    if in_main_thread:
        before = signal.signal(signal.SIGINT, lambda *_: arrived.append(True))
    try:
        yield
    finally:
        if in_main_thread:
            signal.signal(signal.SIGINT, before)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        if arrived:
            signal.raise_signal(signal.SIGINT)
