"""A command and all the processes it starts: how long it takes, how much memory they hold."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import psutil  # type: ignore[import-untyped]  # comes with distributed

INTERVAL = 0.05  # between looks at the memory [s]


@dataclass(frozen=True)
class Run:
    """What a command took.

    Attributes
    ----------
    seconds : float
        Time that passed.
    cpu : float
        Time that all its processes computed [s].
    together : float
        Most memory that all its processes held at one time, shared pages counted once [MiB].
    largest : float
        Most memory that one of them held, shared pages included [MiB].
    """

    seconds: float
    cpu: float
    together: float
    largest: float


def watch(command: Sequence[str], *, cores: int) -> Run:
    """Run a command on some cores, and watch its memory.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    cores : int
        How many cores it may use, at most, where the system lets one choose.

    Returns
    -------
    Run
        What it took.

    Raises
    ------
    RuntimeError
        When it fails, with the last line that it printed.
    """
    highest = together = 0.0
    largest: defaultdict[int, float] = defaultdict(float)
    with tempfile.TemporaryFile(mode="w+") as output:
        cpu, start = _children_cpu(), time.perf_counter()
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(process.pid, sorted(os.sched_getaffinity(0))[:cores])
        while True:
            resident = _resident(process.pid)
            for member, size in resident.items():
                largest[member.pid] = max(largest[member.pid], size)
            # Counting what is shared takes milliseconds a process: only at a new high.
            if sum(resident.values()) > highest:
                highest = sum(resident.values())
                together = max(together, sum(map(_own_share, resident)))
            try:
                process.wait(INTERVAL)
                break
            except subprocess.TimeoutExpired:
                continue
        seconds, cpu = time.perf_counter() - start, _children_cpu() - cpu
        if process.returncode != 0:
            output.seek(0)
            last = (output.read().strip().splitlines() or ["nothing"])[-1]
            raise RuntimeError(
                f"`{' '.join(command)}` exited with {process.returncode}, its last line: {last}"
            )
    return Run(seconds, cpu, together, max(largest.values(), default=0.0))


def _resident(pid: int) -> dict[psutil.Process, float]:
    """A process and its descendants, with the memory that each has resident [MiB]."""
    held = {}
    try:
        root = psutil.Process(pid)
        for member in (root, *root.children(recursive=True)):
            with suppress(psutil.Error):
                held[member] = member.memory_info().rss / 2**20
    except psutil.NoSuchProcess:
        pass
    return held


def _own_share(process: psutil.Process) -> float:
    """Memory of a process [MiB], a page that n processes share counting 1/n in each.

    All that it has resident, where the system keeps no such count; 0 when it has ended.
    """
    try:
        memory = process.memory_full_info()
    except psutil.Error:
        return 0.0
    return float(getattr(memory, "pss", memory.rss)) / 2**20


def _children_cpu() -> float:
    """Time that ended children of this process, and theirs, have computed [s]."""
    times = psutil.Process().cpu_times()
    return float(times.children_user + times.children_system)
