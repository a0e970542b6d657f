"""Workers of this machine are forked from a process that has imported what they need, once."""

import os
import signal
import sys
from multiprocessing import forkserver

import psutil
import pytest
from executors import eventually, result_of, silent

from sweeps.engine.cluster import ClusterChoice, executor
from sweeps.engine.forking import fork_server, running_server, worth_importing

IMPORTS = ("wave",)  # which nothing else imports, nor `tabnanny`


def parent_and_modules():
    """Threads of the process that a worker was forked from, and modules that the worker has."""
    return psutil.Process().parent().num_threads(), set(sys.modules)


def server_is_gone():
    return running_server() is None


def test_workers_have_the_modules_of_stages_and_what_these_list():
    assert worth_importing([__name__, "nowhere", __name__]) == [__name__, "wave", "nowhere"]
    asked = ["tabnanny", "no_such_module", *IMPORTS]
    with executor(ClusterChoice(workers=1), modules=asked, say=silent) as run:
        threads, modules = result_of(run, parent_and_modules)
    assert {"tabnanny", "wave"} <= modules
    assert threads == 1  # or it would not be safe to fork
    assert server_is_gone()


def test_the_server_ends_after_an_error():
    with pytest.raises(KeyError), fork_server([]):
        raise KeyError
    assert server_is_gone()


def test_a_server_that_is_killed_is_no_error():
    with fork_server([]):
        os.kill(running_server().pid, signal.SIGKILL)
        eventually(server_is_gone)
        forkserver.ensure_running()  # as the start of a worker does
        eventually(running_server)
    assert server_is_gone()
