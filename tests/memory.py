"""Helper that measures the memory that a call holds."""

import tracemalloc


def peak_memory(call):
    """Return the most memory [B] that a call held."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
