"""First import of the fork server, which makes it import faster and end at once."""

import atexit
import os
import sys
from multiprocessing import forkserver

from sweeps.engine.run.interpreter import relax_gc

relax_gc()
if vars(sys.modules["__main__"]).get("main") is forkserver.main:  # else failures would be hidden
    atexit.register(os._exit, 0)  # it keeps the output of the command open
