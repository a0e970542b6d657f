"""Workers on this machine are forked from one server that has imported the modules they need."""

import subprocess
import sys

import psutil
from executors import IMPORTS as SEARCH
from executors import result_of, running_server, silent

from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor
from sweeps.engine.run.forking import preloaded_modules, start_fork_server

IMPORTS = ("wave",)  # nothing else imports this module, nor `tabnanny`


def parent_and_modules():
    """Return the number of threads of a worker's parent process, and the worker's modules."""
    return psutil.Process().parent().num_threads(), set(sys.modules)


def test_workers_have_the_modules_of_stages_and_what_these_list():
    assert preloaded_modules([__name__, "nowhere", __name__]) == [__name__, "wave", "nowhere"]
    names = ["tabnanny", "no_such_module", *IMPORTS]
    with open_executor(ClusterChoice(workers=1), modules=names, say=silent) as run:
        threads, modules = result_of(run, parent_and_modules)
    assert {"tabnanny", "wave"} <= modules
    assert threads == 1  # it is not safe to fork a process with more threads


def test_the_next_workers_are_forked_from_the_same_process():
    assert start_fork_server([]) == "forkserver"
    server = running_server()
    assert start_fork_server(["tabnanny"]) == "forkserver"
    assert running_server() == server


EDITED = """
import importlib, pathlib, sys
sys.ps1 = ">>> "  # as at a prompt
sys.path.insert(0, ".")
sys.dont_write_bytecode = True
from executors import result_of, silent
from sweeps.engine.run.executors import open_executor
from sweeps.engine.run.cluster import ClusterChoice
if __name__ == "__main__":
    for number in (1, 2):
        pathlib.Path("edited.py").write_text(f"def given(): return {number}")
        edited = importlib.import_module("edited")
        importlib.reload(edited)
        with open_executor(ClusterChoice(workers=1), modules=["edited"], say=silent) as run:
            print(result_of(run, edited.given))
"""


def test_a_module_that_is_edited_at_a_prompt_is_run_as_it_is_now(tmp_path):
    (tmp_path / "prompt.py").write_text(EDITED)
    command = [sys.executable, "-B", "prompt.py"]
    done = subprocess.run(
        command, cwd=tmp_path, env={"PYTHONPATH": SEARCH}, capture_output=True, text=True
    )
    assert done.stdout.split() == ["1", "2"], done.stderr


def test_the_process_ends_with_the_one_that_started_it():
    source = (
        "from executors import eventually, running_server\n"
        "from sweeps.engine.run.forking import start_fork_server\n"
        "start_fork_server([]); eventually(running_server); print(running_server().pid)"
    )
    done = subprocess.run(
        [sys.executable, "-c", source], env={"PYTHONPATH": SEARCH}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    psutil.wait_procs(
        [process for process in psutil.process_iter() if process.pid == int(done.stdout)],
        timeout=30,
    )
    assert not psutil.pid_exists(int(done.stdout))


def test_the_server_s_module_hides_no_failure_elsewhere():
    """The module makes only the fork server exit with status 0, not other processes."""
    code = "import sweeps.engine.run.server, sys; sys.exit(3)"
    done = subprocess.run([sys.executable, "-c", code], env={"PYTHONPATH": SEARCH})
    assert done.returncode == 3
