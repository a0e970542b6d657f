"""Workers on this machine are forked from one server, hear only certificate holders, and end."""

import os
import signal
import socket
import ssl
import sys

import executors
import psutil
import pytest
from distributed.security import Security
from running import python

from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor
from sweeps.engine.run.forking import preloaded_modules, start_fork_server

IMPORTS = ("wave",)  # nothing else imports this module, nor `tabnanny`


def listening(besides=()):
    """Return addresses on which this process and its forked workers listen, except `besides`."""
    children = psutil.Process().children(recursive=True)
    alive = [process for process in children if process.status() != psutil.STATUS_ZOMBIE]
    forked = [process for process in alive if "forkserver" in " ".join(process.cmdline())]
    sockets = [s for p in (psutil.Process(), *forked) for s in p.net_connections("inet")]
    return [s.laddr for s in sockets if s.status == psutil.CONN_LISTEN and s.laddr not in besides]


def heard(port, security):
    """Return the first byte a server sends to a peer that checks nothing; b"" if refused."""
    if security is None:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    else:
        context = security.get_connection_args("client")["ssl_context"]
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with (
            socket.create_connection(("127.0.0.1", port), timeout=5) as connection,
            context.wrap_socket(connection) as encrypted,
        ):
            return encrypted.recv(1)
    except (ssl.SSLError, ConnectionError):
        return b""


def page(port):
    """Return the answer to a plain HTTP request; b"" if the connection fails."""
    with socket.create_connection(("127.0.0.1", port), timeout=5) as connection:
        connection.sendall(b"GET /info/main/workers.html HTTP/1.0\r\n\r\n")
        try:
            return connection.recv(1000)
        except ConnectionError:
            return b""


def state():
    """Return what a cluster must leave as it was: environment, Ctrl-C and blocked signals."""
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    changed = {"PYTEST_CURRENT_TEST", "__DASK_PARENT_PID"}  # by pytest, and by dask for good
    environment = {name: os.environ[name] for name in os.environ.keys() - changed}
    return environment, signal.getsignal(signal.SIGINT), blocked


@pytest.fixture(scope="module")
def cluster(at_a_terminal):
    """Yield an executor of one worker and the addresses that it listens on; check that it ends."""
    before, others, sentences = state(), listening(), []
    modules = ["tabnanny", "no_such_module", *IMPORTS]
    choice = ClusterChoice(workers=2)
    with open_executor(choice, tasks=1, modules=modules, say=sentences.append) as run:
        yield run, listening(others)
    assert sentences == ["starting 1 worker process"]
    assert executors.running_server().children() == []
    assert state() == before


def parent_and_modules():
    """Return the number of threads of a worker's parent process, and the worker's modules."""
    return psutil.Process().parent().num_threads(), set(sys.modules)


def test_workers_preload_stage_modules_and_their_listed_imports(cluster):
    assert preloaded_modules([__name__, "nowhere", __name__]) == [__name__, "wave", "nowhere"]
    run, _ = cluster
    assert run.worker_count == 1  # not more than tasks
    threads, modules = executors.result_of(run, parent_and_modules)
    assert {"tabnanny", "wave"} <= modules
    assert threads == 1  # it is not safe to fork a process with more threads


def test_only_local_certificate_holders_can_connect(cluster):
    run, addresses = cluster
    assert {address.ip for address in addresses} == {"127.0.0.1"}
    ports = [address.port for address in addresses]
    pages = {port: page(port) for port in ports}
    encrypted = [port for port in ports if not pages[port].startswith(b"HTTP")]
    # every port speaks TLS or is an HTTP server without pages
    assert len(encrypted) >= 3  # a scheduler, a nanny and a worker
    assert all(b" 404 " in pages[port] for port in set(ports) - set(encrypted))
    for port in encrypted:
        assert heard(port, run._client.security)
        assert not heard(port, Security.temporary())
        assert not heard(port, None)


def test_fork_server_is_reused():
    assert start_fork_server([]) == "forkserver"
    server = executors.running_server()
    assert start_fork_server(["tabnanny"]) == "forkserver"
    assert executors.running_server() == server


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


def test_workers_run_the_reloaded_version_of_edited_modules(tmp_path):
    (tmp_path / "prompt.py").write_text(EDITED)
    done = python("-B", "prompt.py", cwd=tmp_path, PYTHONPATH=executors.IMPORTS)
    assert done.stdout.split() == ["1", "2"]
