"""Garbage-collector threshold, and process exit without finalization."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn


def relax_gc() -> None:
    """Raise the threshold of the garbage collector to 50,000 allocations, in this process.

    At its default, 700, it takes a quarter of the time of imports, and a tenth of a sweep's.
    """
    gc.set_threshold(50_000)


def end_with(main: Callable[[], None]) -> NoReturn:
    """Run a command, and exit with its status without finalization, which takes a second.

    Its output is flushed; no object is destroyed, and no function of `atexit` is called.
    """
    status: str | int | None = None
    try:
        main()
    except SystemExit as ended:
        status = ended.code
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # the command has reported these
            stream.flush()
    os._exit(status if isinstance(status, int) else status is not None)
