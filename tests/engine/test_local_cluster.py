"""Workers on this machine run code only for certificate holders and leave no processes behind."""

import os
import signal
import socket
import ssl
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from distributed.security import Security
from executors import eventually, refuse_odd, result_of
from small_stores import opened
from toys import Few, run_few

from sweeps.engine.declare.stage import Group, Output, stage
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.executors import open_executor

pytestmark = pytest.mark.usefixtures("at_a_terminal")


# -- access to a local cluster


@pytest.fixture(scope="module", autouse=True)
def others():
    """Return the addresses on which this process and its workers listen for other tests."""
    return listening()


def listening(besides=()):
    """Return addresses on which this process and its forked workers listen, except `besides`."""
    children = psutil.Process().children(recursive=True)
    alive = [process for process in children if process.status() != psutil.STATUS_ZOMBIE]
    forked = [process for process in alive if "forkserver" in " ".join(process.cmdline())]
    sockets = [s for p in (psutil.Process(), *forked) for s in p.net_connections("inet")]
    return [s.laddr for s in sockets if s.status == psutil.CONN_LISTEN and s.laddr not in besides]


def test_a_local_cluster_listens_on_the_loopback_interface_only(others, local):
    addresses = listening(others)
    assert len(addresses) >= 5  # a scheduler, two nannies and two workers
    assert {address.ip for address in addresses} == {"127.0.0.1"}


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


def test_only_holders_of_the_certificate_are_heard_by_a_local_cluster(others, local):
    ports = [address.port for address in listening(others)]
    pages = {port: page(port) for port in ports}
    encrypted = [port for port in ports if not pages[port].startswith(b"HTTP")]
    # every port speaks TLS or is an HTTP server without pages
    assert len(encrypted) >= 5
    assert all(b" 404 " in pages[port] for port in set(ports) - set(encrypted))
    for port in encrypted:
        assert heard(port, local._client.security)
        assert not heard(port, Security.temporary())
        assert not heard(port, None)


# -- start and end of workers


def test_no_more_workers_than_tasks_and_nothing_left_behind():
    environment, sentences = dict(os.environ), []
    handler, blocked = signal.getsignal(signal.SIGINT), signal.pthread_sigmask(signal.SIG_BLOCK, [])
    before = set(psutil.Process().children(recursive=True))
    with open_executor(ClusterChoice(workers=2), tasks=1, say=sentences.append) as workers:
        assert workers.worker_count == 1
        assert result_of(workers, refuse_odd, 2) == 2
    assert sentences == ["starting 1 worker process"]
    assert set(psutil.Process().children(recursive=True)) <= before
    assert dict(os.environ) == environment
    assert signal.getsignal(signal.SIGINT) is handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == blocked


SPRINGS_IN_A_TERMINAL = """
import signal, sys
signal.signal(signal.SIGHUP, signal.SIG_DFL)
from sweeps.engine.command.line import Command
from toys import SPRINGS
sys.exit(Command(SPRINGS).main(sys.argv[1:]))
"""


def test_a_terminal_that_closes_ends_a_sweep_in_a_sentence(tmp_path):
    """SIGHUP goes to the whole process group: the command, its workers and the fork server."""
    folder = Path(__file__).parent
    arguments = [
        "cluster=local",
        "cluster.workers=2",
        "cache=c",
        "store=s.zarr",
        "measured.pause=0.3",
    ]
    command = subprocess.Popen(
        [sys.executable, "-c", SPRINGS_IN_A_TERMINAL, *arguments],
        env=os.environ | {"PYTHONPATH": f"{folder}:{folder.parents[1]}"},
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    eventually(lambda: list(tmp_path.glob("c/**/*.pack")))
    os.killpg(command.pid, signal.SIGHUP)
    _, errors = command.communicate(timeout=60)
    assert command.returncode == 128 + signal.SIGHUP
    assert {line.partition(" ")[0] for line in errors.splitlines()} == {"springs:"}, errors
    assert errors.endswith("springs: stopped by SIGHUP; the same command resumes the sweep\n")


@stage(Output("x", label="x", dtype="f8"), uses=(Few,), group=Group("all"))
def deadly(size):
    """Kill the worker for size 3; return other sizes."""
    if size == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return size


def test_a_cell_that_kills_its_workers_fails_alone(tmp_path):
    options = {"sizes": range(1, 7), "kind": "local", "workers": 2}
    finished = run_few([deadly], tmp_path / "s.zarr", **options)
    [(name, why)] = finished.failures
    assert name == "deadly size=3" and "worker process died" in why
    assert opened(tmp_path / "s.zarr", "all").x.isnull().values.tolist() == [0, 0, 1, 0, 0, 0]


def ended(process):
    """Return whether a process has ended; a zombie has."""
    try:
        return process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def test_workers_end_with_a_driver_that_is_killed():
    code = """
import os, sys, time
from sweeps.engine.run.executors import open_executor
from sweeps.engine.run.cluster import ClusterChoice

if __name__ == "__main__":
    with open_executor(ClusterChoice(workers=1), say=print) as run:
        run.submit(0, os.getpid)
        print(run.wait()[0][1], flush=True)
        run.submit(1, time.sleep, 1000)
        run.wait()
"""
    driver = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    with driver:
        assert driver.stdout.readline() == "starting 1 worker process\n"
        worker = psutil.Process(int(driver.stdout.readline()))
        children = psutil.Process(driver.pid).children(recursive=True)
        assert worker in children
        driver.kill()
    eventually(lambda: all(ended(process) for process in children))
