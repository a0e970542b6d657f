"""Imported by the fork server alone, and first: it imports in less time, and ends at once."""

import atexit
import os

from sweeps.engine.run.interpreter import relax_gc

relax_gc()
atexit.register(os._exit, 0)  # it keeps the output of the command open
