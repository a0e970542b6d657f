"""Cluster addresses without a usable scheduler are refused: no answer, bad files, no workers."""

import socket
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer

import distributed
import pytest
from distributed.security import Security
from executors import fails_with, written

from sweeps.engine.run import dask_cluster
from sweeps.engine.run.cluster import ClusterChoice

pytestmark = pytest.mark.usefixtures("at_a_terminal")


def unanswered(address):
    return rf"cluster.address is {address}, but no scheduler answers there \(.+\)"


@contextmanager
def nobody(listens=False):
    """Yield a port on which no process listens, or one that listens but never answers."""
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        if listens:
            mute.listen()
        yield mute.getsockname()[1]


def somebody_mute():
    return nobody(listens=True)


@contextmanager
def web_server():
    with HTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}).start()
        yield server.server_port
        server.shutdown()


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("protocol", ["tcp", "tls"])
@pytest.mark.parametrize("peer", [nobody, somebody_mute, web_server])
def test_nobody_answers_at_an_address(protocol, peer, tmp_path):
    with peer() as port:
        address = f"{protocol}://127.0.0.1:{port}"
        files = written(Security.temporary(), tmp_path) if protocol == "tls" else {}
        choice = ClusterChoice(kind="address", address=address, **files)
        fails_with(choice, unanswered(address))


def test_files_that_are_no_certificates_are_refused(tmp_path):
    path = tmp_path / "ca.pem"
    path.write_text("nothing")
    choice = ClusterChoice(
        kind="address", address="tls://127.0.0.1:1", ca_file=str(path), cert=str(path)
    )
    fails_with(
        choice, "cluster.ca_file, cluster.cert and cluster.private_key are .*, but must be PEM .*"
    )


def test_a_scheduler_without_workers_is_refused(monkeypatch):
    monkeypatch.setattr(dask_cluster, "ARRIVAL_SECONDS", 0.5)
    options = {"processes": False, "protocol": "tcp://", "dashboard_address": None}
    options |= {"n_workers": 0, "scheduler_kwargs": dask_cluster.SCHEDULER}
    with distributed.LocalCluster(**options) as cluster:
        address = cluster.scheduler_address
        choice = ClusterChoice(kind="address", address=address)
        fails_with(choice, f"cluster.address is {address}, but its scheduler has no workers")
