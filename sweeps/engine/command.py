"""The command line of an experiment: Hydra's, and what it exits with."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import FrameType
from typing import Any

import hydra
from hydra._internal.utils import get_args_parser
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from platformdirs import user_cache_path

from sweeps.engine.cells import open_index
from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.errors import ConfigurationError, SweepIncomplete
from sweeps.engine.experiment import Experiment
from sweeps.engine.front import (
    composing,
    explain,
    primary,
    read_configuration,
    refuse_list_of_choices,
    register,
    replaceable,
)
from sweeps.engine.launcher import register_launcher
from sweeps.engine.multirun import Job, crossed, fused, split
from sweeps.engine.plan import Plan
from sweeps.engine.printing import forgiving, say, show
from sweeps.engine.run import Finished, Place, existing, preview, sweep
from sweeps.engine.run_settings import Cluster, Run
from sweeps.engine.settings import Choices
from sweeps.engine.settings_table import settings_table
from sweeps.engine.target import check_folder, check_target
from sweeps.engine.tasks import reason
from sweeps.engine.watching import NAMED_FAILURES, foreseen, summary, watching

ALL_DONE, SOME_FAILED, WRONG = 0, 1, 2

Report = Callable[[Path, Choices], None]


@dataclass(frozen=True)
class Command:
    """The command line of an experiment.

    Attributes
    ----------
    experiment : Experiment
        What is declared.
    report : callable
        Called with the path of a finished store and its choices.
    raised : list of Exception
        What ended the jobs of Hydra's launchers.
    """

    experiment: Experiment
    report: Report = lambda path, choices: None
    raised: list[Exception] = field(default_factory=list, init=False, compare=False)

    @property
    def name(self) -> str:
        """Name of the command."""
        return self.experiment.name

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Run a command line; returns 0 all done, 1 some cells failed, 2 wrong configuration."""
        given = list(sys.argv[1:] if arguments is None else arguments)
        with forgiving():
            return self._status(given)

    def _status(self, given: list[str]) -> int:
        """Exit status of a command line, of which every end is said in one sentence."""
        try:
            with _signals():
                return self._main(given)
        except SystemExit as ended:  # Hydra's, after its help or a wrong option
            return ended.code if isinstance(ended.code, int) else ALL_DONE
        except _Stopped as stopped:
            say(self.name, f"stopped by {stopped.name}; the same command goes on from here")
            return 128 + stopped.number
        except KeyboardInterrupt:
            say(self.name, "interrupted; the same command goes on from here")
            return 130
        except (ConfigurationError, HydraException, OmegaConfBaseException) as error:
            say(self.name, explain(self.experiment, error))
            return WRONG
        except SweepIncomplete as error:
            say(self.name, str(error))
            return SOME_FAILED
        except OSError as error:
            where = f" {error.filename!r}" if error.filename else ""
            say(self.name, f"cannot write{where}: {error.strerror or error}")
            return SOME_FAILED if error.errno in _DISK else WRONG

    def _main(self, given: list[str]) -> int:
        experiment = self.experiment
        if "--settings" in given:
            show(settings_table(experiment))
            return ALL_DONE
        if "--version" in given:
            show(f"{self.name} {own_version()}")
            return ALL_DONE
        if "--cache" in given:
            return self._cache([one for one in given if one != "--cache"])
        register(experiment)
        register_launcher(self.run_jobs, partial(read_configuration, experiment))
        # Hydra then raises what went wrong, instead of printing it and ending the process.
        os.environ["HYDRA_FULL_ERROR"] = "1"
        options = get_args_parser().parse_intermixed_args(given)
        plain = replaceable(experiment, _overrides(experiment, options))
        asks = (options.help, options.hydra_help, options.cfg, options.info)
        elsewhere = (options.config_path, options.config_name, options.config_dir)
        if not (any(asks) or any(elsewhere) or options.shell_completion):
            sweeps = self.prepare(plain, several=options.multirun)
            if sweeps and all(choices.one(Run.dry_run) for choices, _ in sweeps):
                for choices, store in sweeps:
                    self._preview(choices, store)
                return ALL_DONE
        kept = [one for one in given if one not in options.overrides]
        with _arguments([sys.argv[0], *kept, *plain]):
            conf = None if experiment.conf is None else str(experiment.conf)
            start = hydra.main(
                version_base="1.3", config_path=conf, config_name=primary(experiment)
            )
            start(self._job)()
        if self.raised:
            raise self.raised[0]
        return ALL_DONE

    # what is asked for ----------------------------------------------------------------------

    def prepare(self, overrides: list[str], *, several: bool) -> list[tuple[Choices, str | None]]:
        """Choices and stores of the sweeps of a command line, so that a wrong one stops them all.

        Empty where Hydra expands the jobs by a sweeper of its own; each is checked when it starts.
        """
        jobs = split(overrides) if several else [overrides]
        if jobs is None:
            return []
        found: list[Job] = []
        with composing(self.experiment):
            for job in jobs:
                kept = [one for one in job if not re.match(r"[+~]*hydra[./@=]", one)]
                for one in kept:
                    if re.match(r"[+~]*=", one):
                        raise ConfigurationError(f"{one} has no key, but must be KEY=VALUE")
                    refuse_list_of_choices(self.experiment, one)
                try:
                    composed = hydra.compose(primary(self.experiment), overrides=kept)
                except (TypeError, ValueError) as error:  # Hydra's answer to a malformed override
                    raise ConfigurationError(f"{' '.join(job)}: {error}") from error
                store = OmegaConf.to_container(composed, resolve=False)["store"]  # type: ignore[call-overload, index]
                if store is not None and "${hydra:" in str(store):
                    composed.store = f"{store}".replace("${hydra:job.num}", str(len(found)))
                    composed.store = None if "${hydra:" in composed.store else composed.store
                choices = read_configuration(self.experiment, composed)
                if (path := choices.one(Run.store)) is not None:
                    check_target(path)  # as it was written: made absolute, a URL would be a folder
                found.append(Job(_swept(job), choices, path))
        sweeps = fused(self.experiment, found)
        for choices, store in sweeps:
            self.check(choices, store)
        return sweeps

    def check(self, choices: Choices, store: str | None) -> None:
        """Refuse a sweep that could not be run, or whose store holds something else."""
        _cluster(choices)
        check_folder("cache", choices.one(Run.cache) or _default_cache(self.name))
        if store is not None:
            check_target(store)
            existing(self.experiment, Path(store), Plan(self.experiment, choices))

    def _preview(self, choices: Choices, store: str | None) -> None:
        cache = Path(choices.one(Run.cache) or _default_cache(self.name))
        found = preview(self.experiment, choices, cache, Path(store) if store else None)
        show(foreseen(found.stages))
        show(found.sentence)

    def place(self, choices: Choices, store: Path) -> Place:
        """Where a sweep runs."""
        return Place(
            store,
            Path(choices.one(Run.cache) or _default_cache(self.name)),
            _cluster(choices),
            int(choices.one(Run.cache_limit) * 1e9),
        )

    # running --------------------------------------------------------------------------------

    def _job(self, composed: DictConfig) -> None:
        """One job of Hydra's own launchers: one sweep with its own store."""
        try:
            choices = read_configuration(self.experiment, composed)
            overrides = list(HydraConfig.get().overrides.task)
            folder = Path(HydraConfig.get().runtime.output_dir)
            self.run_jobs([Job(_swept(overrides), choices, choices.one(Run.store))], folder)
        except Exception as error:  # else Hydra would add words of its own
            self.raised.append(error)

    def run_jobs(self, jobs: Sequence[Job], folder: Path) -> None:
        """Run the sweeps that some jobs come to, all of them, whatever becomes of one.

        Raises
        ------
        SweepIncomplete
            If cells of some failed.
        """
        failures: list[tuple[str, str]] = []
        for choices, store in fused(self.experiment, jobs):
            keys = {key.lstrip("+~") for job in jobs for key in job.overrides}
            unread = Plan(self.experiment, choices).unread(keys)
            remarks = [f"{key} is set, but nothing that is asked for reads it" for key in unread]
            for sentence in (*remarks, *self.experiment.remarks(choices)):
                say(self.name, sentence)
            if choices.one(Run.dry_run):  # where Hydra has expanded the jobs
                self._preview(choices, store)
                continue
            failures += self.run(choices, Path(store) if store else folder / "sweep.zarr").failures
        if failures:
            named = "; ".join(f"{what} ({why})" for what, why in failures[:NAMED_FAILURES])
            more = len(failures) - NAMED_FAILURES
            raise SweepIncomplete(
                f"{len(failures)} cells failed: {named}"
                + (f"; and {more} more" if more > 0 else "")
            )

    def run(self, choices: Choices, store: Path) -> Finished:
        """Run one sweep into a store, and report it."""
        with watching(self.name) as watch:
            finished = sweep(self.experiment, choices, self.place(choices, store), watch)
        try:
            self.report(store, choices)
        except Exception as error:  # what is in the store is as good without
            say(self.name, f"the store is whole, but cannot be reported: {reason(error)}")
        show(summary(finished.progress, finished.seconds), error=True)
        return finished

    def _cache(self, words: list[str]) -> int:
        """Say what is in the cache, or clear it."""
        place = next((one[6:] for one in words if one.startswith("cache=")), None)
        folder = Path(place or _default_cache(self.name))
        check_folder("cache", place or folder)
        if unknown := [one for one in words if one != "clear" and not one.startswith("cache=")]:
            raise ConfigurationError(
                f"--cache has {unknown[0]!r}, but takes cache=FOLDER, and clear to empty it"
            )
        kept = []
        if folder.is_dir():
            with open_index(folder, lambda sentence: say(self.name, sentence)) as index:
                kept = index.summary()
                if "clear" in words:
                    index.clear()
        done = "removed" if "clear" in words else "kept"
        for one in kept:
            show(f"{one.stage:<24} {one.cells:>9} cells {one.bytes / 1e6:>10.1f} MB")
        total = sum(one.bytes for one in kept)
        show(f"{sum(one.cells for one in kept)} cells, {total / 1e6:.1f} MB {done} in {folder}")
        return ALL_DONE


def own_version() -> str:
    """Version of the distribution that this package came with."""
    try:
        return version("ncti-sweep")
    except PackageNotFoundError:
        return "unknown"


def _overrides(experiment: Experiment, options: Any) -> list[str]:
    return crossed(experiment, options.overrides) if options.multirun else list(options.overrides)


def _swept(overrides: Sequence[str]) -> dict[str, str]:
    pairs = (one.partition("=") for one in overrides)
    return {key: value for key, _, value in pairs if value != "null" or not key.startswith("++")}


def _cluster(choices: Choices) -> ClusterChoice:
    given = {one.name: choices.one(one) for one in Cluster.declared}
    key = given.pop("private_key")  # Settings has a key of its own
    return ClusterChoice(**given, key=key)


def _default_cache(name: str) -> Path:
    return user_cache_path(name)


_DISK = {28, 122, 5}  # full, over quota, faulty


class _Stopped(BaseException):
    """The process is asked to end."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number
        self.name = signal.Signals(number).name


@contextmanager
def _signals() -> Iterator[None]:
    """Turn requests to end into exceptions, so that workers end in order and something is said."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise _Stopped(number)

    before = {}
    with suppress(ValueError):  # not in the main thread: they are somebody else's
        before = {one: signal.signal(one, stop) for one in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _arguments(arguments: list[str]) -> Iterator[None]:
    """Let Hydra read other arguments than the process was given."""
    before, sys.argv = sys.argv, arguments
    try:
        yield
    finally:
        sys.argv = before
