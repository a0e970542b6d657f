"""The command line of an experiment, parsed by Hydra, and its exit status."""

from __future__ import annotations

import errno
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import hydra
from hydra._internal.utils import get_args_parser
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from platformdirs import user_cache_path

from sweeps.engine.cluster import ClusterChoice
from sweeps.engine.errors import ConfigurationError, DeclarationError, SweepIncomplete
from sweeps.engine.failures import FailureLog, reason
from sweeps.engine.folders import check_apart, check_folder, check_target, remove_folder
from sweeps.engine.front import (
    FUSED,
    composing,
    explain,
    legible,
    primary,
    read_configuration,
    refuse_list_of_choices,
    register,
    replaceable,
)
from sweeps.engine.interrupts import Stopped, heed, interruptible, stopping
from sweeps.engine.multirun import Job, batches, crossed, fused, jobs_of, read_job, swept
from sweeps.engine.packs import SHORTAGES
from sweeps.engine.plan import Plan
from sweeps.engine.preview import preview
from sweeps.engine.process import environment, forgiving, say, show, uncollected
from sweeps.engine.results import open_index
from sweeps.engine.run import Finished, Place, existing, sweep
from sweeps.engine.settings import Choices, Cluster, Run, settings_table
from sweeps.engine.stage import Experiment, nothing_to_check
from sweeps.engine.usage import usage
from sweeps.engine.version import OPTION, version_of
from sweeps.engine.watching import NAMED_FAILURES, foreseen, summary, watching

ALL_DONE, SOME_FAILED, WRONG = 0, 1, 2
HELP = {"-h", "--help"}

MOST_CELLS = 10_000_000  # whose keys fit into memory
PATIENCE = 0.5  # s of silence while checking; most errors are found sooner

Report = Callable[[Path, Choices, Finished], None]


@dataclass(frozen=True)
class Command:
    """The command line of an experiment; `report` is called with the store, choices and outcome.

    `beside` returns the paths that the report of a store writes to.
    """

    experiment: Experiment
    report: Report = lambda path, choices, finished: None
    beside: Callable[[Path], Iterable[Path]] = lambda store: ()
    # Errors that ended jobs of Hydra's own launchers.
    raised: list[Exception] = field(default_factory=list, init=False, compare=False)

    @property
    def name(self) -> str:
        """Name of the command."""
        return self.experiment.name

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Run a command line; returns 0 all done, 1 some cells failed, 2 wrong configuration.

        Any error is reported in one sentence.
        """
        given = list(sys.argv[1:] if arguments is None else arguments)
        # Hydra then raises what went wrong, instead of printing it and ending the process.
        with forgiving(), environment({"HYDRA_FULL_ERROR": "1"}):
            try:
                with stopping():
                    status = self._main(given)
                    heed()
                    return status
            except SystemExit as ended:  # Hydra's, after its help or a wrong option
                return ended.code if isinstance(ended.code, int) else ALL_DONE
            except Stopped as stopped:
                say(self.name, f"{stopped.words}; the same command resumes the sweep")
                return stopped.status
            except DeclarationError as error:
                say(self.name, str(error))
                return WRONG
            except (ConfigurationError, HydraException, OmegaConfBaseException) as error:
                say(self.name, explain(self.experiment, error))
                return WRONG
            except SweepIncomplete as error:
                say(self.name, str(error))
                return SOME_FAILED
            except OSError as error:
                where = f" {error.filename!r}" if error.filename else ""
                verb = "read" if error.errno in SHORTAGES else "write"
                say(self.name, f"cannot {verb}{where}: {error.strerror or error}")
                disk = {errno.ENOSPC, errno.EDQUOT, errno.EIO} | SHORTAGES
                return SOME_FAILED if error.errno in disk else WRONG

    def _main(self, given: list[str]) -> int:
        experiment = self.experiment
        if "--settings" in given:
            show(settings_table(experiment.declared))
            return ALL_DONE
        if OPTION in given:
            show(version_of(self.name, self.name))
            return ALL_DONE
        if HELP.intersection(given):
            show(usage(experiment))
            return ALL_DONE
        if "--cache" in given:
            return self._cache([one for one in given if one != "--cache"])
        with uncollected():
            register(experiment)
        options = get_args_parser().parse_intermixed_args(given)
        overrides = options.overrides
        plain = replaceable(
            experiment, crossed(experiment, overrides) if options.multirun else overrides
        )
        asks = (options.hydra_help, options.cfg, options.info)
        elsewhere = (options.config_path, options.config_name, options.config_dir)
        if not (any(asks) or any(elsewhere) or options.shell_completion):
            jobs, master = self._jobs(plain, several=options.multirun)
            with interruptible():
                sweeps = self._checked(jobs)
            if sweeps and all(choices.one(Run.dry_run) for choices, _ in sweeps):
                for choices, store in sweeps:
                    with self._variables(choices):
                        self._say_all(experiment.about(choices))
                        self._preview(choices, store)
                return ALL_DONE
            if jobs and master and master.hydra.runtime.choices["hydra/launcher"] == FUSED:
                folder = Path(master.hydra.sweep.dir).absolute()
                folder.mkdir(parents=True, exist_ok=True)
                OmegaConf.save(master, folder / "multirun.yaml")
                for batch in batches(master, jobs):
                    self.run_jobs(batch, folder)
                return ALL_DONE
        kept = [one for one in given if one not in overrides]
        with _arguments([sys.argv[0], *kept, *plain]):
            conf = None if experiment.conf is None else str(experiment.conf)
            start = hydra.main(
                version_base="1.3", config_path=conf, config_name=primary(experiment)
            )
            start(self._job)()
        if self.raised:
            raise self.raised[0]
        return ALL_DONE

    # parsing --------------------------------------------------------------------------------

    def prepare(self, overrides: list[str], *, several: bool) -> list[tuple[Choices, str | None]]:
        """Return choices and stores of the sweeps of a command line; an invalid one stops them all.

        Empty if Hydra expands the jobs by another sweeper; each is checked when it starts.
        """
        return self._checked(self._jobs(overrides, several=several)[0])

    def _jobs(self, overrides: list[str], *, several: bool) -> tuple[list[Job], DictConfig | None]:
        """Return the jobs of a command line, and the configuration of the multirun, if any."""
        experiment = self.experiment
        for one in overrides:
            if re.match(r"[+~]*=", one):
                raise ConfigurationError(f"{one} has no key, but must be KEY=VALUE")
            refuse_list_of_choices(experiment, one)
        # Report invalid single values before the checks, which may take long.
        read = partial(read_configuration, replace(experiment, check=nothing_to_check))
        master = None
        with composing(experiment), uncollected():
            if several:
                front: Any = GlobalHydra.instance().hydra
                with legible(overrides):
                    master = front.compose_config(
                        primary(experiment), overrides, run_mode=RunMode.MULTIRUN, from_shell=False
                    )
                jobs = [
                    read_job(front.config_loader, master, job, number, read)
                    for number, job in enumerate(jobs_of(front.config_loader, master) or [])
                ]
            else:
                own = [one for one in overrides if not re.match(r"[+~]*hydra[./@=]", one)]
                with legible(own):
                    composed = hydra.compose(primary(experiment), overrides=own)
                store = OmegaConf.to_container(composed, resolve=False)["store"]  # type: ignore[call-overload, index]
                if "${hydra:" in str(store):
                    composed.store = None  # known when the job runs
                choices = read(composed)
                jobs = [Job(swept(own), choices, choices.one(Run.store))]
        with self._patience(), interruptible():
            return [replace(job, choices=experiment.check(job.choices)) for job in jobs], master

    @contextmanager
    def _patience(self) -> Iterator[None]:
        """Print a sentence if the checks take a while."""
        timer = threading.Timer(PATIENCE, say, (self.name, self.experiment.checking))
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()

    def _checked(self, jobs: Sequence[Job]) -> list[tuple[Choices, str | None]]:
        """Return the sweeps of some jobs; refuse invalid ones and those whose store differs."""
        # As they were written: made absolute, a URL would be a folder.
        stores = dict.fromkeys(job.store for job in jobs if job.store is not None)
        for path in stores:
            check_target(path)
        sweeps = fused(self.experiment, jobs)
        for choices, store in sweeps:
            _cluster(choices)
            check_folder("cache", cache := self._cache_folder(choices))
            check_apart(map(Path, stores), Path(cache), self.beside)
            with self._variables(choices):
                plan = Plan(self.experiment, choices)
                _check_size(plan)
                if store is not None:
                    existing(self.experiment, Path(store), plan)
        return sweeps

    def _variables(self, choices: Choices) -> AbstractContextManager[None]:
        return environment(self.experiment.environment(choices))

    def _cache_folder(self, choices: Choices) -> str | Path:
        return choices.one(Run.cache) or user_cache_path(self.name)

    def _preview(self, choices: Choices, store: str | None) -> None:
        cache = Path(self._cache_folder(choices))
        found = preview(self.experiment, choices, cache, Path(store) if store else None)
        show(foreseen(found.stages))
        show(found.sentence)

    # running --------------------------------------------------------------------------------

    def _job(self, composed: DictConfig) -> None:
        """Run one job of Hydra's own launchers: a sweep with its own store."""
        try:
            choices = read_configuration(self.experiment, composed)
            overrides = list(HydraConfig.get().overrides.task)
            folder = Path(HydraConfig.get().runtime.output_dir)
            self.run_jobs([Job(swept(overrides), choices, choices.one(Run.store))], folder)
        except Exception as error:  # else Hydra would add its own message
            self.raised.append(error)

    def run_jobs(self, jobs: Sequence[Job], folder: Path) -> None:
        """Run the sweeps of some jobs; a failed one does not stop the others.

        Raises
        ------
        SweepIncomplete
            If cells of some failed, or their report is not complete.
        """
        failures: list[tuple[str, str]] = []
        left: list[str] = []
        log = FailureLog(folder)
        for choices, store in fused(self.experiment, jobs):
            with self._variables(choices):
                keys = {key.lstrip("+~") for job in jobs for key in job.overrides}
                unread = Plan(self.experiment, choices).unread(keys)
                remarks = [f"{key} is set, but this sweep does not read it" for key in unread]
                self._say_all((*remarks, *self.experiment.remarks(choices)))
                self._say_all(self.experiment.about(choices))
                if choices.one(Run.dry_run):  # if Hydra has expanded the jobs
                    self._preview(choices, store)
                    continue
                path = Path(store) if store else folder / "sweep.zarr"
                finished = self.run(choices, path, log)
                failures += finished.failures
                left += [finished.left] * bool(finished.left)
        if failures:
            named = "; ".join(f"{what} ({why})" for what, why in failures[:NAMED_FAILURES])
            more = len(failures) - NAMED_FAILURES
            tables = sum(what.startswith("table ") for what, _ in failures)
            counts = {"cell": len(failures) - tables, "table": tables}
            counted = [f"{n:,} {word}{'s' * (n > 1)}" for word, n in counts.items() if n]
            left.append(
                f"{' and '.join(counted)} failed: {named}"
                + (f"; and {more:,} more" if more > 0 else "")
                + (f"; tracebacks and arguments are in {_near(log.path)}" if log.written else "")
            )
        if left:
            raise SweepIncomplete("; ".join(left))

    def run(self, choices: Choices, store: Path, log: FailureLog) -> Finished:
        """Run one sweep into a store, and report it; failures are logged."""
        check_apart([store], Path(self._cache_folder(choices)), self.beside)
        with ThreadPoolExecutor(1, "removing") as thread:  # the old store, during the report
            place = self.place(choices, store)
            place = replace(place, remove=lambda folder: thread.submit(remove_folder, folder))
            with watching(self.name, log) as watch:
                finished = sweep(self.experiment, choices, place, watch)
            say(self.name, summary(finished.progress, finished.seconds))
            try:
                with interruptible():
                    self.report(store, choices, finished)
            except SweepIncomplete as error:
                finished.left = str(error)
            except Exception as error:  # the store is complete without it
                say(self.name, f"the store is written, but not its report: {reason(error)}")
        return finished

    def _say_all(self, sentences: Iterable[str]) -> None:
        for sentence in sentences:
            say(self.name, sentence)

    def place(self, choices: Choices, store: Path) -> Place:
        """Return the store, cache and cluster of a sweep."""
        limit = int(choices.one(Run.cache_limit) * 1e9)
        folder = Path(self._cache_folder(choices))
        return Place(store, folder, _cluster(choices), limit, choices.one(Run.verify))

    def _cache(self, words: list[str]) -> int:
        """Print the contents of the cache, or clear it."""
        place = next((one[6:] for one in words if one.startswith("cache=")), None)
        folder = Path(place or user_cache_path(self.name))
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


def _near(path: Path) -> str:
    """Return a path relative to the current folder if it is inside."""
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def _check_size(plan: Plan) -> None:
    """Refuse a sweep of too many cells."""
    cells = sum(plan.count(bound) for bound in plan.bound.values())
    if cells > MOST_CELLS:
        listed = ", ".join(f"{key} ({count:,})" for key, count in plan.swept.items())
        raise ConfigurationError(
            f"the sweep has {cells:,} cells, but may have at most {MOST_CELLS:,}; "
            f"numbers of values: {listed}"
        )


def _cluster(choices: Choices) -> ClusterChoice:
    given: dict[str, Any] = {one.name: choices.one(one) for one in Cluster.declared}
    key = given.pop("private_key")  # `Settings` has another `key`
    return ClusterChoice(**given, key=key)


@contextmanager
def _arguments(arguments: list[str]) -> Iterator[None]:
    """Let Hydra read these arguments instead of the process's own."""
    before, sys.argv = sys.argv, arguments
    try:
        yield
    finally:
        sys.argv = before
