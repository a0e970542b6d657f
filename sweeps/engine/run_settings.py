"""Settings of the engine itself: what fixes the noise, and where and how a sweep runs."""

from __future__ import annotations

from sweeps.engine.kinds import Groups
from sweeps.engine.settings import Setting, Settings, count, number, switch, text, word

WHERE = "it says where or how to run"

CLUSTERS = ("inline", "local", "address", "slurm")


class Run(Settings):
    """The run."""

    seed = count(0, 0, 2**63, label="seed of all noise")
    store = text(
        None,
        label="folder of the store; null: sweep.zarr in Hydra's output folder",
        fixed=WHERE,
        identity=False,
    )
    cache = text(
        None,
        label="folder of finished results; null: the user's cache folder",
        fixed=WHERE,
        identity=False,
    )
    cache_limit = number(
        20,
        0,
        1e6,
        unit="GB",
        label="what the cache may hold; the results not used for longest go first",
        fixed=WHERE,
        identity=False,
    )
    dry_run = switch(
        False, label="whether only to say what would be done", fixed=WHERE, identity=False
    )


class Together(Settings, key="grid"):
    """Axes that run together."""

    zip = Setting(
        Groups(),
        None,
        label="settings that run together instead of crossed: [[a, b], [c, d]]",
        fixed=WHERE,
        identity=False,
    )


class Cluster(Settings, key="cluster"):
    """Who does the work; see `sweeps.engine.cluster.ClusterChoice`."""

    kind = word("local", CLUSTERS, label="kind of cluster", fixed=WHERE, identity=False)
    workers = count(
        None,
        1,
        4096,
        label="worker processes, or jobs of Slurm; null: one a core",
        fixed=WHERE,
        identity=False,
    )
    address = text(None, label="address of a dask scheduler", fixed=WHERE, identity=False)
    ca_file = text(None, label="TLS: file of the authority", fixed=WHERE, identity=False)
    cert = text(None, label="TLS: file of the certificate", fixed=WHERE, identity=False)
    private_key = text(None, label="TLS: file of its private key", fixed=WHERE, identity=False)
    queue = text(None, label="Slurm: partition", fixed=WHERE, identity=False)
    account = text(None, label="Slurm: account", fixed=WHERE, identity=False)
    walltime = text(None, label="Slurm: longest time of a job", fixed=WHERE, identity=False)
    memory = text(None, label="Slurm: memory of a job", fixed=WHERE, identity=False)
    interface = text(None, label="Slurm: network interface", fixed=WHERE, identity=False)


ENGINE_SETTINGS: tuple[type[Settings], ...] = (Run, Together, Cluster)
