"""`ClusterChoice` refuses settings that do not fit together and names the wrong one."""

import pytest

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.run.cluster import ClusterChoice

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
        ("queue", OPEN | {"queue": "short"}),
        ("workers", JOB | {"workers": None}),
        ("memory", JOB | {"memory": None}),
        ("memory", JOB | {"memory": "much"}),
        ("walltime", JOB | {"walltime": "a day"}),
        ("queue", JOB | {"queue": "x\n#SBATCH -A y"}),
    ],
)
def test_settings_that_do_not_fit_are_refused(key, settings):
    with pytest.raises(ConfigurationError) as refused:
        ClusterChoice(**settings)
    text = "null" if settings.get(key) is None else settings[key]
    assert str(refused.value).startswith(f"cluster.{key} is {text}, but must be")
