"""A Hydra launcher that runs all jobs of a multirun as one sweep."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from copy import deepcopy
from pathlib import Path
from types import ModuleType
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus, setup_globals
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, open_dict

from sweeps.engine.multirun import Job

PLUGINS, OURS = "hydra_plugins", "sweep_engine"

Run = Callable[[Sequence[Job], Path], None]
Read = Callable[[DictConfig], Any]


class FusedLauncher(Launcher):
    """Launcher that hands all jobs of a batch to the engine at once.

    A sweeper that comes with one batch after another, each chosen by the results of the last, has
    all jobs so far run together: the store grows, and what is there is not done again.
    """

    run: Run
    read: Read

    def __init__(self) -> None:
        self.jobs: list[Job] = []

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """See `hydra.plugins.launcher.Launcher`."""
        self.context = hydra_context
        self.config = config

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run the jobs, and those of earlier batches with them."""
        setup_globals()
        returned: list[JobReturn] = []
        touched: set[str | None] = set()
        for number, overrides in enumerate(job_overrides, start=initial_job_idx):
            composed = self.context.config_loader.load_sweep_config(self.config, list(overrides))
            with open_dict(composed):
                composed.hydra.job.id = composed.hydra.job.num = number
            HydraConfig.instance().set_config(composed)
            task = self._task(composed)
            choices = type(self).read(task)
            pairs = (one.partition("=") for one in overrides)
            store = choices.values["store"][0]
            touched.add(store)
            self.jobs.append(Job({k: v for k, _, v in pairs}, choices, store))
            returned.append(
                JobReturn(overrides=list(overrides), cfg=task, status=JobStatus.COMPLETED)
            )
        folder = Path(self.config.hydra.sweep.dir).absolute()
        type(self).run([job for job in self.jobs if job.store in touched], folder)
        return returned

    @staticmethod
    def _task(composed: DictConfig) -> DictConfig:
        task = deepcopy(composed)
        with open_dict(task):
            del task["hydra"]
        return task


def register_launcher(run: Run, read: Read) -> None:
    """Make the launcher known to Hydra as `hydra/launcher=fused`.

    Parameters
    ----------
    run : callable
        Runs jobs, given the folder of the multirun.
    read : callable
        Makes choices of a composed configuration.
    """
    # Hydra makes its launchers itself, without arguments.
    FusedLauncher.run = staticmethod(run)
    FusedLauncher.read = staticmethod(read)
    # Hydra takes plugins from the package `hydra_plugins` only, and looks them up there.
    try:
        importlib.import_module(PLUGINS)
    except ImportError:
        sys.modules[PLUGINS] = ModuleType(PLUGINS)
        sys.modules[PLUGINS].__path__ = []
    sys.modules[f"{PLUGINS}.{OURS}"] = sys.modules[__name__]
    setattr(sys.modules[PLUGINS], OURS, sys.modules[__name__])
    FusedLauncher.__module__ = f"{PLUGINS}.{OURS}"
    Plugins.instance().register(FusedLauncher)
    target = f"{FusedLauncher.__module__}.{FusedLauncher.__name__}"
    ConfigStore.instance().store(group="hydra/launcher", name="fused", node={"_target_": target})
