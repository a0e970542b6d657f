"""The command line of an experiment, parsed by Hydra, and its exit status."""

from __future__ import annotations

import errno
import logging
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from io import TextIOWrapper
from pathlib import Path

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException
from platformdirs import user_cache_path

from sweeps.engine.cache.index import CellIndex
from sweeps.engine.cache.packs import RESOURCE_ERRORS, open_packs
from sweeps.engine.command.status import format_status
from sweeps.engine.command.usage import list_settings, usage
from sweeps.engine.declare.errors import ConfigurationError, DeclarationError, SweepIncompleteError
from sweeps.engine.declare.failures import FailureLog, one_line
from sweeps.engine.declare.kinds import Value
from sweeps.engine.declare.paths import PathOrUrl, path_beside, path_or_url
from sweeps.engine.declare.settings import Choices, Cluster, Run, nested
from sweeps.engine.declare.stage import BoundStage, Experiment, bind
from sweeps.engine.objects import UNREACHABLE
from sweeps.engine.resolve.overrides import (
    DEFAULT_STORE,
    Job,
    clear_before_set,
    config_name,
    error_message,
    fuse_jobs,
    make_job,
    quote_for_shell,
    read_jobs,
    register,
)
from sweeps.engine.resolve.plan import Plan, modules_of, stored_stages, with_inputs
from sweeps.engine.run.cluster import ClusterChoice
from sweeps.engine.run.forking import preloaded_modules, start_fork_server
from sweeps.engine.run.interrupts import Stopped, allow_interrupts, defer_signals, raise_if_stopped
from sweeps.engine.run.process import environment, flush_output, say, show
from sweeps.engine.run.progress import NAMED_FAILURES, count_table, show_progress, summary
from sweeps.engine.store.locks import cache_lock
from sweeps.engine.store.provenance import differences
from sweeps.engine.store.targets import check_cache_path, check_targets
from sweeps.engine.store.writing import read_attributes
from sweeps.engine.sweeping import RunOptions, SweepOutcome, extended_attributes, preview, sweep

ALL_DONE, SOME_FAILED, INVALID = 0, 1, 2
RESUME_HINT = "the same command resumes the sweep"
PRUNE = "prune="  # before the size to which --cache prunes
FULL_DISK = {errno.ENOSPC, errno.EDQUOT}
HELP, MULTIRUN = {"-h", "--help"}, {"-m", "--multirun"}

Report = Callable[[PathOrUrl, Choices, SweepOutcome], None]
PlannedSweep = tuple[Plan, RunOptions]


@dataclass(frozen=True)
class Command:
    """The command line of an experiment; `report` is called with the store, choices and outcome.

    By default, it prints the tables, the store, and commands that print more. `report_paths`
    returns the paths to which the report of a store writes. `remarks` returns lines on the sweep,
    printed before it starts. `imports` are modules of the report, imported while workers start.
    """

    experiment: Experiment
    report: Report | None = None
    report_paths: Callable[[Path], Iterable[Path]] = lambda store: ()
    remarks: Callable[[Choices], Iterable[str]] = lambda choices: ()
    imports: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the command."""
        return self.experiment.name

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Run a command line; return 0 all done, 1 some cells failed, 2 wrong configuration.

        Any error is reported in one sentence. Failing to write the output returns 1.
        """
        words = list(sys.argv[1:] if arguments is None else arguments)
        logging.basicConfig(format=f"{self.name}: %(message)s")
        if isinstance(sys.stdout, TextIOWrapper):  # whose encoding may lack characters
            sys.stdout.reconfigure(errors="backslashreplace")
        message, status = self._run_catching_errors(words)
        if message:
            say(self.name, message)
        if reason := flush_output():
            say(self.name, f"the output cannot be written: {reason}")
        return status or (SOME_FAILED if reason else ALL_DONE)

    def _run_catching_errors(self, words: Sequence[str]) -> tuple[str, int]:
        """Run a command line; return its error as a sentence, if any, and the exit status."""
        try:
            with defer_signals():
                self._dispatch(words)
                raise_if_stopped()
                return "", ALL_DONE
        except SystemExit as ended:  # of a parser, after its help or a wrong option
            return "", ended.code if isinstance(ended.code, int) else ALL_DONE
        except Stopped as stopped:
            return f"{stopped.message}; {RESUME_HINT}", stopped.status
        except (ConfigurationError, DeclarationError) as error:
            return str(error), INVALID
        except (HydraException, OmegaConfBaseException) as error:
            return error_message(error), INVALID
        except SweepIncompleteError as error:
            return str(error), SOME_FAILED
        except MemoryError as error:
            return f"out of memory ({error}); {RESUME_HINT}", SOME_FAILED
        except OSError as error:
            location = f" {error.filename!r}" if error.filename else ""
            verb = "write" if error.errno in FULL_DISK else "access"
            verb = "reach" if error.errno == UNREACHABLE else verb
            message = f"cannot {verb}{location}: {error.strerror or error}"
            temporary = {errno.EIO, *FULL_DISK, *RESOURCE_ERRORS}
            return message, SOME_FAILED if error.errno in temporary else INVALID

    def _dispatch(self, words: Sequence[str]) -> None:
        experiment = self.experiment
        if HELP.intersection(words):
            show(usage(experiment))
            return
        if "--settings" in words:
            show(list_settings(experiment, [word for word in words if word != "--settings"]))
            return
        if "--cache" in words:
            done = [word for word in words if word == "clear" or word.startswith(PRUNE)]
            _, path = self._store_and_cache(
                [word for word in words if word not in done], "--cache", "clear", f"{PRUNE}20GB"
            )
            self._print_cache(path, _prune_limit(done))
            return
        if "--status" in words:
            for part in format_status(*self._store_and_cache(words, "--status")):
                show(part)
            return
        if "--why" in words:
            self._print_differences([word for word in words if word != "--why"])
            return
        for word in words:
            self._check_option(word)
        if not any(map(_is_for_hydra, words)):
            overrides = [word for word in words if word not in MULTIRUN]
            jobs = read_jobs(experiment, overrides, several=len(overrides) < len(words))
            self._start_fork_server(jobs)
            self._run_all(self.prepare(jobs), {key for job in jobs for key in job.overrides})
            return
        register(experiment)
        overrides = [word for word in words if "=" in word and not word.startswith("-")]
        options = [word for word in words if word not in overrides]
        argv = sys.argv
        sys.argv = [sys.argv[0], *options, *clear_before_set(experiment, overrides)]
        try:
            # Hydra then raises errors, instead of printing them and ending the process.
            with environment({"HYDRA_FULL_ERROR": "1"}):
                conf = None if experiment.conf is None else str(experiment.conf)
                name = config_name(experiment)
                hydra.main(version_base="1.3", config_path=conf, config_name=name)(self._run_job)()
        finally:
            sys.argv = argv

    def _check_option(self, word: str) -> None:
        """Refuse a setting or a group of settings that is written as an option."""
        stripped = word.lstrip("-").replace("-", "_")
        group, conf = re.split("[.=]", stripped)[0], self.experiment.conf
        is_known = group in nested(self.experiment.by_key)
        if word.startswith("--") and (is_known or (conf is not None and (conf / group).is_dir())):
            spelling = f"{'' if is_known else '+'}{stripped}{'' if '=' in stripped else '=VALUE'}"
            raise ConfigurationError(f"{word} is not an option; give it without dashes, {spelling}")

    def _run_job(self, composed: DictConfig) -> None:
        """Run one job of Hydra: a sweep, by default with its own store."""
        hydra_config = HydraConfig.get()
        store = Path(hydra_config.runtime.output_dir, DEFAULT_STORE)
        job = make_job(self.experiment, composed, hydra_config.overrides.task, str(store))
        self._run_all(self.prepare([job]), job.overrides)

    def prepare(self, jobs: Sequence[Job]) -> list[PlannedSweep]:
        """Return the checked sweeps of some jobs; an invalid job stops them all."""
        with allow_interrupts():
            checked = [replace(job, choices=self.experiment.check(job.choices)) for job in jobs]
        stores = dict.fromkeys(path_or_url("store", job.store) for job in jobs)
        sweeps: list[PlannedSweep] = []
        with allow_interrupts():
            fused = fuse_jobs(self.experiment, checked)
            for cache in dict.fromkeys(choices.value(Run.cache) for choices, _ in fused):
                check_targets(stores, self._cache_path(cache), self.report_paths)
            for choices, store in fused:
                options = self._run_options(choices, store)
                with environment(choices.variables):
                    plan = Plan(self.experiment, choices)
                    extended_attributes(store, plan)
                sweeps.append((plan, options))
        return sweeps

    def _start_fork_server(self, jobs: Sequence[Job]) -> None:
        """Let local workers of new stores import their modules while this process checks jobs."""
        stages: dict[str, BoundStage] = {}
        for job in jobs:
            value, store = job.choices.value, path_or_url("store", job.store)
            computes = not (value(Run.dry_run) or value(Run.partial))
            is_new = isinstance(store, Path) and not os.path.lexists(store)
            if computes and is_new and value(Cluster.kind) == "local":
                bound_stages = bind(self.experiment, job.choices.zipped)
                stages |= with_inputs(
                    stored_stages(bound_stages.values(), job.choices), bound_stages
                )
        modules = modules_of(stages.values())
        if modules and "__main__" not in modules:  # a script, which must be guarded first
            start_fork_server(preloaded_modules(modules))

    def _print_differences(self, words: Sequence[str]) -> None:
        """Print the differences between each stage's keys and a store's."""
        [job] = read_jobs(self.experiment, words, several=False)
        choices, path = self.experiment.check(job.choices), path_or_url("store", job.store)
        with environment(choices.variables):
            plan, attributes = Plan(self.experiment, choices), read_attributes(path)
            if attributes is None:
                raise ConfigurationError(f"store is {str(path)!r}, which does not exist")
            lines = [f"{name}: {', '.join(parts)}" for name, parts in differences(plan, attributes)]
            for line in lines or ["nothing differs: the store has all of the sweep"]:
                show(line)

    def _store_and_cache(
        self, arguments: Sequence[str], *options: str
    ) -> tuple[PathOrUrl, PathOrUrl]:
        """Return the store and the cache that a command line sets, ignoring some options."""
        words = [word for word in arguments if word not in options]
        if invalid := [word for word in words if "=" not in word]:
            allowed = " and ".join(["settings, such as cache=PLACE", *options[1:]])
            raise ConfigurationError(f"{options[0]} has {invalid[0]!r}, but takes {allowed}")
        [job] = read_jobs(self.experiment, words, several=False)
        return path_or_url("store", job.store), self._cache_path(job.choices.value(Run.cache))

    def _cache_path(self, value: Value) -> PathOrUrl:
        return path_or_url("cache", str(value)) if value else user_cache_path(self.name)

    def _run_options(self, choices: Choices, store: PathOrUrl) -> RunOptions:
        """Return the store, cache and cluster of a sweep."""
        return RunOptions(
            store,
            self._cache_path(choices.value(Run.cache)),
            ClusterChoice(**{setting.name: choices.value(setting) for setting in Cluster.declared}),
            int(choices.value(Run.cache_limit) * 1e9),
            partial=bool(choices.value(Run.partial)),
            imports=self.imports,
        )

    # running --------------------------------------------------------------------------------

    def _run_all(self, sweeps: Sequence[PlannedSweep], keys: Collection[str]) -> None:
        """Run all sweeps of a command line that sets `keys`, even if one of them fails.

        Raises
        ------
        SweepIncompleteError
            If cells of a sweep failed, or its report is not complete.
        """
        messages: list[str] = []
        for plan, options in sweeps:
            choices = plan.choices
            with environment(choices.variables):
                unread = plan.unused_settings({key.lstrip("+~") for key in keys})
                unread_remarks = [
                    f"{key} is set, but this sweep does not read it" for key in unread
                ]
                for sentence in (*unread_remarks, *self.remarks(choices)):
                    say(self.name, sentence)
                if choices.value(Run.dry_run):
                    stages, sentence = preview(plan, options)
                    rows = {
                        name: (total, total - missing, missing)
                        for name, (total, missing) in stages.items()
                    }
                    show(count_table(dict(reversed(rows.items())), "cells", "reused", "to compute"))
                    show(sentence)
                else:
                    messages += self._run(plan, options)
        if messages:
            raise SweepIncompleteError("; ".join(messages))

    def _run(self, plan: Plan, options: RunOptions) -> list[str]:
        """Run one sweep and its report; return messages on failures."""
        base = path_beside(options.store)
        log = FailureLog(base.with_name(f"{base.name.removesuffix('.zarr')}-failures.log"))
        with show_progress(
            self.name, log, options.store, options.cache, record=not options.partial
        ) as callbacks:
            finished = sweep(plan, options, callbacks)
        if options.partial:
            return []
        say(self.name, summary(finished.progress, finished.seconds))
        messages = [_failure_text(finished.failures, log)] if finished.failures else []
        try:
            with allow_interrupts():
                (self.report or self._print_report)(options.store, plan.choices, finished)
        except SweepIncompleteError as error:
            messages.append(str(error))
        except Exception as error:  # the store is complete without it
            say(self.name, f"the store is written, but not its report: {one_line(error)}")
        return messages

    def _print_report(self, store: PathOrUrl, choices: Choices, finished: SweepOutcome) -> None:
        from sweeps.engine.store.tables import format_tables

        # Modules with `answer`, by the commands that print more.
        reports = entry_points(group="sweeps.reports") if self.experiment.tables else ()
        for entry in reports:
            with suppress(ConfigurationError):  # there is no table
                for sentence in entry.load().answer(store):
                    show(f"{sentence}\n")
        for text in format_tables(store, [table.group for table in self.experiment.tables]):
            show(f"{text}\n")
        path = os.path.relpath(store) if isinstance(store, Path) else store
        show(f"store   {path}")
        for entry in reports:
            show(f"next    {entry.name} {quote_for_shell(path)}")

    def _print_cache(self, path: PathOrUrl, limit: float | None) -> None:
        """Print the size of a cache, after deleting its oldest results beyond any limit [byte].

        Raises ConfigurationError if a sweep uses it.
        """
        check_cache_path(path)
        packs = open_packs(path, create=False)
        lock = nullcontext() if limit is None else cache_lock(packs.path, exclusive=True)
        try:
            with lock:
                index = CellIndex(packs, lambda sentence: say(self.name, sentence))
                cells, size = index.size() if limit is None else index.prune(limit)
        except BlockingIOError:
            reason = "which a sweep uses; wait until it ends"
            raise ConfigurationError(f"cache is {str(path)!r}, {reason}") from None
        done = "kept" if limit is None else "removed"
        show(f"{cells} cells, {size / 1e6:.1f} MB {done} in {path}")


def _prune_limit(words: Sequence[str]) -> float | None:
    """Return the limit [byte] of `--cache clear` or `--cache prune=`; None if neither is given."""
    from dask.utils import parse_bytes

    if "clear" in words:
        return 0.0
    for word in words:
        if word.startswith(PRUNE):
            try:
                return float(parse_bytes(word.removeprefix(PRUNE)))
            except ValueError:
                raise ConfigurationError(f"{word} must be a size, such as {PRUNE}20GB") from None
    return None


def _failure_text(failures: Sequence[tuple[str, str]], log: FailureLog) -> str:
    """Return the message on failed cells and tables: numbers, the first of them, and the log."""
    listed = "; ".join(f"{name} ({reason})" for name, reason in failures[:NAMED_FAILURES])
    more = len(failures) - NAMED_FAILURES
    tables = sum(name.startswith("table ") for name, _ in failures)
    counts = {"cell": len(failures) - tables, "table": tables}
    parts = [f"{n:,} {word}{'s' * (n > 1)}" for word, n in counts.items() if n]
    return (
        f"{' and '.join(parts)} failed: {listed}"
        + (f"; and {more:,} more" if more > 0 else "")
        + (f"; tracebacks and arguments are in {os.path.relpath(log.path)}" if log.exists else "")
    )


def _is_for_hydra(word: str) -> bool:
    """Return whether a word of the command line needs Hydra's own options, jobs or folders."""
    is_option = word.startswith("-") and word not in MULTIRUN
    return is_option or word.lstrip("+~").startswith(("hydra.", "hydra/")) or "${hydra:" in word
