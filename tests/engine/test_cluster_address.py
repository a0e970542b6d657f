"""Cluster addresses without a usable scheduler are refused: no answer, bad files, no workers."""

import socket
from contextlib import contextmanager

import distributed
import pytest
from distributed.security import Security
from executors import fails_with, written

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.run import dask_cluster
from sweeps.engine.run.cluster import ClusterChoice

pytestmark = pytest.mark.usefixtures("at_a_terminal")


@contextmanager
def nobody(listens):
    """Yield a port on which no process listens, or one that listens but never answers."""
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        if listens:
            mute.listen()
        yield mute.getsockname()[1]


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(("protocol", "listens"), [("tcp", False), ("tls", True)])
def test_unreachable_address_is_refused(protocol, listens, tmp_path):
    with nobody(listens) as port:
        address = f"{protocol}://127.0.0.1:{port}"
        files = written(Security.temporary(), tmp_path) if protocol == "tls" else {}
        choice = ClusterChoice(kind="address", address=address, **files)
        fails_with(choice, rf"cluster.address is {address}, but no scheduler answers there \(.+\)")


def test_invalid_certificate_files_are_refused(tmp_path):
    path = tmp_path / "ca.pem"
    path.write_text("nothing")
    files = {"ca_file": str(path), "cert": str(path)}
    choice = ClusterChoice(kind="address", address="tls://127.0.0.1:1", **files)
    sentence = "cluster.ca_file, cluster.cert and cluster.private_key are .*, but must be PEM .*"
    fails_with(choice, sentence)


def test_a_scheduler_without_workers_is_refused(monkeypatch):
    monkeypatch.setattr(dask_cluster, "ARRIVAL_SECONDS", 0.5)
    options = {"processes": False, "protocol": "tcp://", "dashboard_address": None}
    options |= {"n_workers": 0, "scheduler_kwargs": dask_cluster.SCHEDULER}
    with distributed.LocalCluster(**options) as cluster:
        address = cluster.scheduler_address
        choice = ClusterChoice(kind="address", address=address)
        fails_with(choice, f"cluster.address is {address}, but its scheduler has no workers")


# settings that do not fit together ----------------------------------------------------------------


TLS = {"kind": "address", "address": "tls://10.0.0.1:8786"}
OPEN = {"kind": "address", "address": "tcp://10.0.0.1:1"}
JOB = {"kind": "slurm", "workers": 1, "memory": "1GB"}


@pytest.mark.parametrize(
    ("key", "settings"),
    [
        ("workers", {"kind": "inline", "workers": 2}),
        ("address", {"address": "tcp://127.0.0.1:1"}),
        ("address", {"kind": "address"}),
        ("address", {"kind": "address", "address": "10.0.0.1:8786"}),
        ("ca_file", TLS),
        ("ca_file", TLS | {"ca_file": "absent.pem"}),
        ("cert", OPEN | {"cert": "x.pem"}),
        ("memory", JOB | {"memory": None}),
        ("memory", JOB | {"memory": "much"}),
        ("walltime", JOB | {"walltime": "a day"}),
        ("queue", JOB | {"queue": "x\n#SBATCH -A y"}),
    ],
)
def test_inconsistent_cluster_settings_are_refused(key, settings):
    with pytest.raises(ConfigurationError) as refused:
        ClusterChoice(**settings)
    text = "null" if settings.get(key) is None else settings[key]
    assert str(refused.value).startswith(f"cluster.{key} is {text}, but must be")
