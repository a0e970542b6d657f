"""First import of the fork server: speeds up its other imports and its exit."""

import atexit
import os
import sys
from multiprocessing import forkserver

from sweeps.engine.run.interpreter import relax_gc

relax_gc()
if vars(sys.modules["__main__"]).get("main") is forkserver.main:  # else failures would be hidden
    atexit.register(os._exit, 0)  # it keeps the output of the command open
