"""Settings of clusters that do not fit together."""

import pytest

from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.errors import ConfigurationError

TLS = {"address": "tls://10.0.0.1:8786"}


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"kind": "k8s"}, "kind is k8s, but must be one of inline, local, address, slurm"),
        ({"workers": 0}, "workers is 0, but must be at least 1"),
        (
            {"kind": "inline", "workers": 2},
            "workers is 2, but must be null when cluster.kind is inline",
        ),
        (
            {"address": "tcp://127.0.0.1:1"},
            "address is tcp://127.0.0.1:1, but must be null when cluster.kind is local",
        ),
        (
            {"kind": "address"},
            "address is null, but must be the address of a dask scheduler "
            "when cluster.kind is address",
        ),
        (
            {"kind": "address", "address": "10.0.0.1:8786"},
            "address is 10.0.0.1:8786, but must be like tls://10.0.0.1:8786",
        ),
        (
            {"kind": "address", **TLS},
            "ca_file is null, but must be a PEM file if cluster.address begins with tls://",
        ),
        (
            {"kind": "address", **TLS, "ca_file": "absent.pem"},
            "ca_file is absent.pem, but must be an existing PEM file",
        ),
        (
            {"kind": "address", "address": "tcp://10.0.0.1:1", "cert": "x.pem"},
            "cert is x.pem, but must be null unless cluster.address begins with tls://",
        ),
        (
            {"kind": "address", "address": "tcp://10.0.0.1:1", "queue": "short"},
            "queue is short, but must be null when cluster.kind is address",
        ),
        (
            {"kind": "slurm", "memory": "1GB"},
            "workers is null, but must be the number of jobs when cluster.kind is slurm",
        ),
        (
            {"kind": "slurm", "workers": 1},
            "memory is null, but must be the memory of a job, such as 4GiB "
            "when cluster.kind is slurm",
        ),
        (
            {"kind": "slurm", "workers": 1, "memory": "much"},
            "memory is much, but must be a number of bytes such as 4GiB",
        ),
        (
            {"kind": "slurm", "workers": 1, "memory": "1GB", "walltime": "a day"},
            "walltime is a day, but must be a time of Slurm such as 12:00:00 or 1-12:00:00",
        ),
        (
            {"kind": "slurm", "workers": 1, "memory": "1GB", "queue": "x\n#SBATCH -A y"},
            "queue is x\n#SBATCH -A y, but must be the name of a Slurm partition",
        ),
    ],
)
def test_settings_that_do_not_fit_are_refused(settings, sentence):
    with pytest.raises(ConfigurationError) as refused:
        ClusterChoice(**settings)
    assert str(refused.value) == f"cluster.{sentence}"
