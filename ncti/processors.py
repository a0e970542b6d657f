"""Number of processors that this process may use."""

import os


def processor_count() -> int:
    """Return the number of processors that the system grants to this process."""
    affinity = getattr(os, "sched_getaffinity", None)  # Linux has it
    return len(affinity(0)) if affinity else os.cpu_count() or 1
