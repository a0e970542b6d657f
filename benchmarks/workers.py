"""Scheduler overhead with 1,000 dask workers running sleep tasks.

As a script, with the address of a scheduler and a number, it runs that many workers.
"""

from __future__ import annotations

import asyncio
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import dask
import psutil  # type: ignore[import-untyped]
from distributed import Client, Worker

from benchmarks import toy
from benchmarks.processes import peak_memory, watch
from benchmarks.reports import Column, Report
from sweeps.engine.run import dask_cluster as engine

COUNTS = (10, 100, 1000)
HOSTS = 4  # processes that the workers share
AT_ONCE = 25  # workers of a process that connect at the same time
CALLS = 60  # of each worker
# For many workers in one process: their self-monitoring, and the search for abandoned folders,
# would take all of its time.
LIGHT = engine.DASK_SETTINGS | {
    "distributed.admin.system-monitor.interval": "60s",
    "distributed.admin.tick.cycle": "60s",
    "distributed.admin.tick.interval": "60s",
    "distributed.comm.timeouts.connect": "600s",
    "distributed.worker.use-file-locking": False,
}
QUIET = ("--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")
COMMAND = "from benchmarks import toy; toy.main(toy.NAPS)"

COLUMNS = (
    Column("workers", "workers", ",d"),
    Column("cells", "cells", ",d"),
    Column("tasks", "tasks", ",d"),
    Column("seconds", "time [s]", ".1f"),
    Column("rate", "tasks a second", ".0f"),
    Column("busy", "workers busy [%]", ".0f"),
    Column("command_ms", "command [ms a task]", ".2f"),
    Column("scheduler_ms", "scheduler [ms a task]", ".2f"),
    Column("command_mib", "command [MiB]", ".0f"),
    Column("scheduler_mib", "scheduler [MiB]", ".0f"),
)


def measure(*, counts: tuple[int, ...] = COUNTS, calls: int = CALLS) -> Report:
    """Measure sweeps of sleeping cells at numbers of workers.

    Parameters
    ----------
    counts : tuple of int
        Numbers of workers.
    calls : int
        Cells for each of them.

    Returns
    -------
    Report
        One row per number, each measured once.
    """
    return Report(
        f"Workers of one scheduler whose cells sleep {toy.NAP:g} s",
        COLUMNS,
        [_row(count, count * calls) for count in counts],
        [
            "Real workers of dask, each with its connections and its thread, in "
            f"{HOSTS} processes of this machine, and a real scheduler in one of its own. "
            "Processor time is that of the command, less that of the same command with nothing "
            "left to compute, and that of the scheduler; that of the workers is theirs."
        ],
    )


def _row(count: int, cells: int) -> dict[str, object]:
    """Return the figures of one sweep."""
    with tempfile.TemporaryDirectory() as folder, _cluster(count, Path(folder)) as cluster:
        address, scheduler = cluster
        options = [f"grid.aspect={{start: 1, stop: {cells}, step: 1}}", "cluster=address"]
        options += [f"cluster.address={address}", f"store={folder}/s.zarr", f"cache={folder}/cache"]
        command = [sys.executable, "-c", COMMAND, *options]
        before = scheduler.cpu_times()
        run = watch(command, cores=psutil.cpu_count() or 1)
        after = scheduler.cpu_times()
        tasks = len(list(Path(folder, "cache").rglob("*.pack")))
        reused = watch(command, cores=psutil.cpu_count() or 1)
        (took,) = re.findall(r"failed in ([\d.]+) s", run.output)
        seconds = float(took)
        spent = after.user + after.system - before.user - before.system
        return {
            "workers": count,
            "cells": cells,
            "tasks": tasks,
            "seconds": seconds,
            "rate": tasks / seconds,
            "busy": 100 * cells * toy.NAP / count / seconds,
            "command_ms": 1e3 * (run.cpu - reused.cpu) / tasks,
            "scheduler_ms": 1e3 * spent / tasks,
            "command_mib": run.driver,
            "scheduler_mib": peak_memory(scheduler.pid),
        }


@contextmanager
def _cluster(count: int, folder: Path) -> Iterator[tuple[str, psutil.Process]]:
    """Run a scheduler and workers; yield its address and process when all are connected."""
    file = folder / "scheduler.json"
    scheduler = ["-m", "distributed.cli.dask_scheduler", "--scheduler-file", str(file)]
    with ExitStack() as stack:

        def start(*arguments: str) -> int:
            process = subprocess.Popen(
                [sys.executable, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process.pid

        pid = start(*scheduler, *QUIET, "--port", "0")
        while not file.exists():
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        for number in range(HOSTS):
            share = len(range(number, count, HOSTS))
            start("-m", "benchmarks.workers", address, str(share))
        with Client(address) as client:
            client.wait_for_workers(count)
        yield address, psutil.Process(pid)


class _ThreadExecutor:
    """Executor that runs a worker's tasks in its own thread, not in one thread per process."""

    def __init__(self, result: Any = None) -> None:
        self._result = result

    def submit(self, call: Callable[[], Any]) -> _ThreadExecutor:
        return _ThreadExecutor(call())

    def result(self) -> Any:
        return self._result


async def _work(address: str, count: int) -> None:
    """Run some workers until this process ends."""
    for start in range(0, count, AT_ONCE):
        indices = range(start, min(start + AT_ONCE, count))
        await asyncio.gather(
            *(Worker(address, nthreads=1, dashboard_address=None, memory_limit=0) for _ in indices)
        )
    await asyncio.Event().wait()


if __name__ == "__main__":
    engine._thread = _ThreadExecutor()  # type: ignore[assignment]
    with dask.config.set(LIGHT):
        asyncio.run(_work(sys.argv[1], int(sys.argv[2])))
