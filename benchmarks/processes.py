"""Time and memory of a command and all the processes it starts."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil  # type: ignore[import-untyped]  # comes with distributed

INTERVAL = 0.05  # between looks at the memory [s]


@dataclass(frozen=True)
class Run:
    """Time and memory of a command.

    Attributes
    ----------
    seconds : float
        Wall time [s].
    cpu : float
        Processor time of all its processes, sampled some twenty times a second [s].
    together : float
        Peak memory of all its processes together, shared pages counted once [MiB].
    driver, worker : float
        Peak memory of the command's process, and of the largest process that it started, shared
        pages included [MiB].
    output : str
        Their output.
    """

    seconds: float
    cpu: float
    together: float
    driver: float
    worker: float
    output: str

    @property
    def largest(self) -> float:
        """Most memory that one of them held, shared pages included [MiB]."""
        return max(self.driver, self.worker)


def watch(command: Sequence[str], *, cores: int) -> Run:
    """Run a command on some cores, and watch its memory.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    cores : int
        Largest number of cores that it may use, where the system allows a choice.

    Returns
    -------
    Run
        Its time and memory.

    Raises
    ------
    RuntimeError
        When it fails, with the last line that it printed.
    """
    highest = together = 0.0
    peaks: defaultdict[int, float] = defaultdict(float)
    # Sample running processes: the time of orphans is never added to that of this process.
    computed: dict[int, float] = {}
    with tempfile.TemporaryFile(mode="w+", encoding="utf-8", errors="replace") as output:
        cpu, start = _children_cpu(), time.perf_counter()
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(process.pid, sorted(os.sched_getaffinity(0))[:cores])
        while True:
            resident = _resident_memory(process.pid)
            for member in resident:
                with suppress(psutil.Error):
                    times = member.cpu_times()
                    computed[member.pid] = times.user + times.system
                peaks[member.pid] = max(peaks[member.pid], peak_memory(member.pid))
            # Counting shared pages takes milliseconds a process: only at a new high.
            if sum(resident.values()) > highest:
                highest = sum(resident.values())
                together = max(together, sum(map(_proportional_memory, resident)))
            try:
                process.wait(INTERVAL)
                break
            except subprocess.TimeoutExpired:
                continue
        seconds, cpu = time.perf_counter() - start, _children_cpu() - cpu
        cpu = max(cpu, sum(computed.values()))
        output.seek(0)
        printed = output.read()
        if process.returncode != 0:
            last = (printed.strip().splitlines() or ["nothing"])[-1]
            raise RuntimeError(
                f"`{' '.join(command)}` exited with {process.returncode}, its last line: {last}"
            )
    driver = peaks.pop(process.pid, 0.0)
    return Run(seconds, cpu, together, driver, max(peaks.values(), default=0.0), printed)


def peak_memory(pid: int | None = None) -> float:
    """Return the peak resident memory of a process, by default this one [MiB].

    Its present memory where the system keeps no peak; 0 when it has ended.
    """
    process = os.getpid() if pid is None else pid
    # Do not use `ru_maxrss`: a child process inherits its parent's value.
    try:
        lines = Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 2**10
    try:
        return float(psutil.Process(process).memory_info().rss) / 2**20
    except psutil.Error:
        return 0.0


def _resident_memory(pid: int) -> dict[psutil.Process, float]:
    """Return the resident memory of a process and of each descendant [MiB]."""
    memory = {}
    try:
        root = psutil.Process(pid)
        for member in (root, *root.children(recursive=True)):
            with suppress(psutil.Error):
                memory[member] = member.memory_info().rss / 2**20
    except psutil.NoSuchProcess:
        pass
    return memory


def _proportional_memory(process: psutil.Process) -> float:
    """Return the proportional set size of a process [MiB]: 1/n of a page that n processes share.

    Return its resident memory where the system keeps no such count, and 0 if it has ended.
    """
    try:
        memory = process.memory_full_info()
    except psutil.Error:
        return 0.0
    return float(getattr(memory, "pss", memory.rss)) / 2**20


def _children_cpu() -> float:
    """Return the processor time of ended descendants of this process [s]."""
    times = psutil.Process().cpu_times()
    return float(times.children_user + times.children_system)
