"""Workers of this machine: who may run code on them, what they start with and survive."""

import os
import signal
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
from contextlib import ExitStack, contextmanager
from pathlib import Path

import distributed
import psutil
import pytest
from distributed.security import Security
from executors import (
    die,
    eventually,
    fails_with,
    gather,
    interrupt_oneself,
    refuse_odd,
    result_of,
    silent,
    span,
    started_with,
)

from sweeps.engine import workers
from sweeps.engine.cluster import ClusterChoice, executor
from sweeps.engine.process import ONE_THREAD

pytestmark = pytest.mark.usefixtures("at_a_terminal")


# -- who may run code on a local cluster


def listening():
    """Addresses on which this process and the workers that were forked for it listen."""
    children = psutil.Process().children(recursive=True)
    forked = [process for process in children if "forkserver" in " ".join(process.cmdline())]
    sockets = [s for p in (psutil.Process(), *forked) for s in p.net_connections("inet")]
    return [s.laddr for s in sockets if s.status == psutil.CONN_LISTEN]


def test_a_local_cluster_listens_on_the_loopback_interface_only(local):
    addresses = listening()
    assert len(addresses) >= 5  # of a scheduler, two nannies and two workers
    assert {address.ip for address in addresses} == {"127.0.0.1"}


def heard(port, security):
    """First byte that a server sends to a peer that trusts anybody, if it accepts the peer."""
    if security is None:
        own = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    else:
        own = security.get_connection_args("client")["ssl_context"]
    own.check_hostname, own.verify_mode = False, ssl.CERT_NONE
    try:
        with (
            socket.create_connection(("127.0.0.1", port), timeout=5) as plain,
            own.wrap_socket(plain) as encrypted,
        ):
            return encrypted.recv(1)
    except (ssl.SSLError, ConnectionError):
        return b""


def page(port):
    """Answer to a plain HTTP request."""
    with socket.create_connection(("127.0.0.1", port), timeout=5) as plain:
        plain.sendall(b"GET /info/main/workers.html HTTP/1.0\r\n\r\n")
        try:
            return plain.recv(1000)
        except ConnectionError:
            return b""


def test_only_holders_of_the_certificate_are_heard_by_a_local_cluster(local):
    ports = [address.port for address in listening()]
    pages = {port: page(port) for port in ports}
    encrypted = [port for port in ports if not pages[port].startswith(b"HTTP")]
    # every port speaks TLS or is an HTTP server without pages
    assert len(encrypted) >= 5
    assert all(b" 404 " in pages[port] for port in set(ports) - set(encrypted))
    for port in encrypted:
        assert heard(port, local._client.security)
        assert not heard(port, Security.temporary())
        assert not heard(port, None)


@pytest.mark.parametrize("security", [None, Security.temporary()], ids=["plain", "other TLS"])
def test_another_client_cannot_reach_a_local_scheduler(local, security):
    address = local._client.scheduler.address.removeprefix("tls://")
    protocol = "tls" if security else "tcp"
    with pytest.raises(OSError):  # noqa: PT011
        distributed.Client(f"{protocol}://{address}", security=security, timeout=0.5)


# -- what a worker starts with, and what it survives


def test_a_worker_starts_with_one_thread_and_an_allocator_that_keeps(local):
    there = result_of(local, started_with)
    assert {f"{name}={value}" for name, value in workers.ENVIRONMENT.items()} <= there
    assert set(ONE_THREAD) <= set(workers.ENVIRONMENT)


def test_no_more_workers_than_tasks_and_nothing_left_behind():
    environment, sentences = dict(os.environ), []
    handler, blocked = signal.getsignal(signal.SIGINT), signal.pthread_sigmask(signal.SIG_BLOCK, [])
    before = set(psutil.Process().children(recursive=True))
    with executor(ClusterChoice(workers=2), tasks=1, say=sentences.append) as run:
        assert run.workers == 1
        assert result_of(run, refuse_odd, 2) == 2
    assert sentences == ["starting 1 worker process"]
    assert set(psutil.Process().children(recursive=True)) <= before
    assert dict(os.environ) == environment
    assert signal.getsignal(signal.SIGINT) is handler
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == blocked


def test_a_worker_does_not_hear_an_interrupt_nor_does_its_successor(local):
    first, blocked = result_of(local, interrupt_oneself)
    assert blocked and first != os.getpid()
    os.kill(first, signal.SIGKILL)
    for number in range(4):
        local.submit(number, interrupt_oneself)
    for (process, blocked), error in gather(local).values():
        assert error is None and blocked and process != first


def test_a_task_whose_worker_is_killed_is_run_again(local, tmp_path):
    assert result_of(local, die, tmp_path / "marker") == "survived"


def test_a_task_that_kills_its_workers_fails_alone(local):
    for number in range(20):
        local.submit(number, *((die,) if number == 3 else (span, 0.01)))
    outcomes = {}
    while batch := local.finished():
        for number, result, error in batch:
            outcomes[number] = result, error
            if error:  # what is submitted before others may run again is kept
                local.submit(100, refuse_odd, number + 1)
    assert sorted(outcomes) == [*range(20), 100]
    assert [number for number, (_, error) in outcomes.items() if error] == [3]
    assert "worker process died" in str(outcomes[3][1])
    assert outcomes[100] == (4, None)


def test_waiting_is_interrupted(local):
    local.submit(0, span, 0.5)
    threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        local.finished()
    assert list(gather(local)) == [0]


@contextmanager
def another_thread():
    """A thread of this process that takes signals, as a progress bar has."""
    done = threading.Event()
    threading.Thread(target=done.wait, daemon=True).start()
    yield
    done.set()


@pytest.mark.parametrize(("times", "thread"), [(1, False), (2, True)])
def test_an_interrupt_while_workers_start_is_delivered_afterwards(times, thread, monkeypatch):
    clusters = []
    start = distributed.LocalCluster

    def interrupted(**options):
        for _ in range(times):
            interrupt_oneself()
        clusters.append(start(**options))
        return clusters[0]

    monkeypatch.setattr(workers, "LocalCluster", interrupted)
    entered = False
    with ExitStack() as stack:
        if thread:
            stack.enter_context(another_thread())
        with (
            pytest.raises(KeyboardInterrupt),
            executor(ClusterChoice(workers=1), say=silent),
        ):
            entered = True
    # It was started all the same, nothing ran on it, and it was ended in order.
    assert not entered
    assert clusters[0].status == distributed.Status.closed


def ended(process):
    """Whether a process runs no more, even if nobody has asked for its exit status."""
    try:
        return process.status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def test_workers_end_with_a_driver_that_is_killed():
    code = """
import os, sys, time
from sweeps.engine.cluster import ClusterChoice, executor

if __name__ == "__main__":
    with executor(ClusterChoice(workers=1), say=print) as run:
        run.submit(0, os.getpid)
        print(run.finished()[0][1], flush=True)
        run.submit(1, time.sleep, 1000)
        run.finished()
"""
    driver = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    with driver:
        assert driver.stdout.readline() == "starting 1 worker process\n"
        worker = psutil.Process(int(driver.stdout.readline()))
        children = psutil.Process(driver.pid).children(recursive=True)
        assert worker in children
        driver.kill()
    eventually(lambda: all(ended(process) for process in children))


def scratch(dask_worker):
    """Scratch folder of a worker."""
    return dask_worker.local_directory


def test_scratch_files_are_in_a_folder_of_the_run_alone(local):
    # The lock of dask's common folder may be held by anyone, for as long as they like.
    common = Path(tempfile.gettempdir()) / "dask-scratch-space"
    for folder in map(Path, local._client.run(scratch).values()):
        own = next(one for one in folder.parents if one.parent == Path(tempfile.gettempdir()))
        assert own != common and own.stat().st_mode & 0o777 == 0o700


def test_workers_that_cannot_be_started_are_one_sentence(monkeypatch):
    def none(**given):
        try:
            raise OSError(30, "Read-only file system", "/dev/shm")
        except OSError as error:
            raise RuntimeError("Nanny failed to start.") from error

    monkeypatch.setattr(workers, "LocalCluster", none)
    fails_with(
        ClusterChoice(workers=1),
        r"cluster.kind is local, but no worker process can be started here \(.*Read-only file "
        r"system: '/dev/shm'\); it may be inline",
    )
