"""Workers of this machine are forked from a process that has imported what they need, once."""

import os
import signal
import sys
from multiprocessing import forkserver

import psutil
import pytest

from sweeps.engine.cluster import ClusterChoice, executor
from sweeps.engine.forking import fork_server, fork_server_ahead, worth_importing

IMPORTS = ("wave",)  # which nothing else imports, nor `tabnanny`


def answers(run, function, *arguments):
    run.submit(0, function, *arguments)
    ((_, result, error),) = run.finished()
    assert error is None, error
    return result


def parent_and_modules():
    """Threads of the process that a worker was forked from, and modules that the worker has."""
    return psutil.Process().parent().num_threads(), set(sys.modules)


def server_is_gone():
    return forkserver._forkserver._forkserver_pid is None


def test_workers_have_the_modules_of_stages_and_what_these_list():
    assert worth_importing([__name__, "nowhere", __name__]) == [__name__, "wave", "nowhere"]
    asked = ["tabnanny", "no_such_module", *IMPORTS]
    with executor(ClusterChoice(workers=1), modules=asked, say=lambda sentence: None) as run:
        threads, modules = answers(run, parent_and_modules)
    assert {"tabnanny", "wave"} <= modules
    assert threads == 1  # or it would not be safe to fork
    assert server_is_gone()


def test_a_later_cluster_does_not_have_the_modules_of_an_earlier_one():
    for asked, other in (("tabnanny", "wave"), ("wave", "tabnanny")):
        with executor(ClusterChoice(workers=1), modules=[asked], say=lambda sentence: None) as run:
            _, modules = answers(run, parent_and_modules)
        assert asked in modules
        assert other not in modules


def test_workers_are_spawned_where_a_fork_server_runs_already():
    with fork_server([]) as first, fork_server([]) as second:
        assert (first, second) == ("forkserver", "spawn")
        assert not server_is_gone()
    assert server_is_gone()


def test_the_server_ends_after_an_error():
    with pytest.raises(KeyError), fork_server([]):
        raise KeyError
    assert server_is_gone()


def test_workers_are_forked_from_a_server_that_was_started_ahead(monkeypatch):
    name = "SWEEP_TEST_SET_LATER"
    with fork_server_ahead(["wave"]):
        monkeypatch.setenv(name, "here")
        given = {"modules": ["tabnanny"], "say": lambda sentence: None}
        with executor(ClusterChoice(workers=1), **given) as run:
            _, modules = answers(run, parent_and_modules)
            assert answers(run, os.environ.get, name) == "here"  # as it is when they start
        assert not server_is_gone()
    assert {"wave"} <= modules and "tabnanny" not in modules
    assert server_is_gone()


def test_a_server_that_was_started_for_nothing_is_not_waited_for(tmp_path, monkeypatch):
    tmp_path.joinpath("takes_for_ever.py").write_text("import time\ntime.sleep(86400)\n")
    monkeypatch.syspath_prepend(tmp_path)
    with fork_server_ahead(["takes_for_ever"]):
        pass
    assert server_is_gone()


def test_without_a_socket_workers_are_spawned(monkeypatch):
    def too_long():
        raise OSError("AF_UNIX path too long")

    monkeypatch.setattr(forkserver._forkserver, "ensure_running", too_long)
    with fork_server([]) as method:
        assert method == "spawn"
    with fork_server_ahead([]), fork_server([]) as method:
        assert method == "spawn"


def test_a_server_that_is_killed_is_no_error():
    with fork_server_ahead([]):
        os.kill(forkserver._forkserver._forkserver_pid, signal.SIGKILL)
        with fork_server([]):
            forkserver.ensure_running()
    assert forkserver._forkserver._forkserver_pid is None
