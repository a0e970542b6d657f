"""The overrides of a command line: checked, expanded into jobs, and these fused into sweeps.

Jobs of one store are one sweep, in which settings that differ between them become axes. Settings
that the jobs cross are axes of their own. Settings that change together, as those of a group's
choices (`spring=soft,hard`), run together along one axis named after the group.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from pathlib import Path
from typing import Any

from hydra.core.config_loader import ConfigLoader
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, Transformer
from hydra.errors import HydraException
from omegaconf import DictConfig

from sweeps.engine.configuration import (
    composed,
    composing,
    members,
    not_members,
    read_configuration,
    unknown,
)
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import MOST_VALUES, Value, rank, shown
from sweeps.engine.places import Where, where
from sweeps.engine.settings import Choices, Joint, Run, Setting, nested
from sweeps.engine.stage import Experiment

STORE = "sweep.zarr"
STEPS = ("start", "stop", "step")  # keys of a setting whose values are given by them
MOST_JOBS = 1_000  # each is composed by itself; more values of a setting are an axis


@dataclass(frozen=True)
class Job:
    """One job of a command line: its overrides by key, its choices, and the path of its store."""

    overrides: dict[str, str]
    choices: Choices
    store: str


def read_jobs(experiment: Experiment, arguments: Sequence[str], *, several: bool) -> list[Job]:
    """Return the jobs of a command line, with choices that are checked setting by setting.

    With `several`, values that are swept make a job each, unless they are an axis.

    Raises
    ------
    ConfigurationError
        Naming the first invalid key, its value and what is allowed.
    """
    with composing(experiment):
        overrides = _parsed(experiment, arguments, several=several)
        return [
            job_of(experiment, composed(experiment, lines), lines, STORE)
            for lines in _expanded(experiment, overrides)
        ]


def job_of(
    experiment: Experiment, configuration: DictConfig, lines: Iterable[str], store: str
) -> Job:
    """Return a job of a composed configuration; `store` is where it goes if that names none."""
    by_key = dict(line.partition("=")[::2] for line in lines)
    choices = replace(read_configuration(experiment, configuration), given=tuple(by_key))
    return Job(by_key, choices, choices.one(Run.store) or store)


# checks -------------------------------------------------------------------------------------------


def _parsed(experiment: Experiment, arguments: Sequence[str], *, several: bool) -> list[Override]:
    """Return the overrides of some arguments, whose keys and choices of groups exist."""
    loader = GlobalHydra.instance().config_loader()
    parser = OverridesParser.create(loader)
    overrides = []
    for place, argument in enumerate(arguments):
        key, _, value = argument.partition("=")
        if not key.lstrip("+~"):
            raise ConfigurationError(f"{argument} has no key, but must be KEY=VALUE")
        try:
            [override] = parser.parse_overrides([argument])
        except (HydraException, TypeError, ValueError) as error:
            if whole := _split_at_spaces(arguments[place:]):
                hint = f"which the shell has split at a space: quote it, '{whole}'"
            else:
                hint = (
                    f"but must be KEY=VALUE in Hydra's syntax: {str(error).partition(chr(10))[0]}"
                )
            raise ConfigurationError(f"{argument} cannot be read, {hint}") from error
        if override.is_sweep_override() and not several:
            raise ConfigurationError(
                f"{key} is {value}, but must be one value or a list: quote it, '{key}=[{value}]', "
                f"or as a text, \"{key}='{value}'\"; or sweep over it, -m {argument}"
            )
        _check_key(experiment, loader, override)
        overrides.append(override)
    return overrides


def _split_at_spaces(arguments: Sequence[str]) -> str:
    """Return the list or mapping of which a shell made the first arguments; empty if it is none."""
    for end in range(2, len(arguments) + 1):
        text = " ".join(arguments[:end])
        if all(text.count(left) == text.count(right) for left, right in ("[]", "{}")):
            return text
    return ""


def _check_key(experiment: Experiment, loader: ConfigLoader, override: Override) -> None:
    """Refuse a key that is not in the configuration, or a value that a group does not have."""
    key = override.key_or_group
    value: Any = override.value()
    if options := loader.get_group_options(key):
        for one in override.sweep_iterator() if override.is_sweep_override() else [value]:
            if isinstance(one, list):
                hint = f"; {key}.name takes a list" if f"{key}.name" in experiment.by_key else ""
                given = str(override.input_line).partition("=")[2]
                raise ConfigurationError(f"{key} is {given}, but must be one choice{hint}")
            if one is not None and one not in options:
                listed = ", ".join(options)
                raise ConfigurationError(f"{key} is {one!r}, but must be one of {listed}")
        return
    tree: Mapping[str, Any] = nested(experiment.by_key)
    words = key.split(".")
    for depth, word in enumerate(words):
        if word not in tree:
            raise unknown(experiment, tree, ".".join(words[:depth]), key)
        is_last = depth == len(words) - 1
        tree = members(tree[word]) or ({} if is_last else dict.fromkeys(STEPS))
    if tree and not override.is_delete() and not isinstance(value, dict):
        raise not_members(tree, key, value)


# jobs ---------------------------------------------------------------------------------------------


def _expanded(experiment: Experiment, overrides: Sequence[Override]) -> Iterator[tuple[str, ...]]:
    """Return the overrides of every job.

    Swept settings are axes of one job, `a=1,2` as `a=[1,2]`, so that a grid of thousands of points
    is one. A key that another override refers to, as the store's path may, stays swept, as do
    groups, and settings of one value.

    Raises
    ------
    ConfigurationError
        If an axis, or the jobs, would be too many.
    """
    lines = [str(one.input_line) for one in overrides]
    axes = {setting.key for setting in experiment.declared if not setting.fixed}
    options: dict[str, list[str]] = {}  # the last of a key counts
    for override, line in zip(overrides, lines, strict=True):
        key, name = override.get_key_element(), override.key_or_group
        options[key] = [line]
        if not override.is_sweep_override():
            continue
        values = _values(override, MOST_VALUES)
        refers = any(f"{{{name}}}" in other for other in lines)
        if (
            name in axes
            and not refers
            and not any(value.startswith(("[", "{")) for value in values)
        ):
            options[key] = [f"{key}=[{','.join(values)}]"]
        else:
            options[key] = [f"{key}={value}" for value in values]
    if math.prod(map(len, options.values())) > MOST_JOBS:
        longest = max(options, key=lambda key: len(options[key]))
        raise ConfigurationError(
            f"{longest} has {len(options[longest]):,} values of all that make jobs, but there may "
            f"be at most {MOST_JOBS:,} jobs"
        )
    return product(*options.values())


def _values(override: Override, most: int) -> list[str]:
    """Return values of a swept override as they are written; too many are refused, not made."""
    values = override.sweep_iterator(transformer=Transformer.encode)
    found = [str(one) for one in islice(values, most + 1)]
    if len(found) > most:
        raise ConfigurationError(
            f"{override.input_line} has too many values; there may be at most {most:,}"
        )
    return found


# jobs as one sweep --------------------------------------------------------------------------------


Point = tuple[Value, ...]
OWN_STORES = "put it into the store's path for a store each"


def fused(experiment: Experiment, jobs: Sequence[Job]) -> list[tuple[Choices, Where]]:
    """Return choices and the place of the store of each sweep that jobs are fused into.

    Raises
    ------
    ConfigurationError
        If jobs of one store differ in something that takes one value.
    """
    by_store: dict[Where, list[Job]] = {}
    for job in jobs:
        store = where("store", job.store)
        if isinstance(store, Path):
            store = Path(os.path.abspath(store))
        by_store.setdefault(store, []).append(job)
    return [(_fuse(experiment, group), store) for store, group in by_store.items()]


def _fuse(experiment: Experiment, jobs: Sequence[Job]) -> Choices:
    first = jobs[0].choices
    if any(job.choices.joint != first.joint for job in jobs):
        raise ConfigurationError(
            f"grid.zip has settings whose values differ between jobs of one store; {OWN_STORES}"
        )
    union: dict[Setting, Point] = {}  # of settings that differ
    for setting in experiment.declared:
        values = {value for job in jobs for value in job.choices[setting]}
        _check_alike(setting, [value for job in jobs for value in job.choices[setting]])
        if all(job.choices[setting] == first[setting] for job in jobs):
            continue
        if setting.fixed:
            asked = " and ".join(shown(value) for value in sorted(values, key=rank))
            raise ConfigurationError(
                f"{setting.key} is {asked} in jobs of one store, but must be one: "
                f"{setting.fixed}; {OWN_STORES}"
            )
        union[setting] = tuple(sorted(values, key=rank))
    values_of = {setting.key: values for setting, values in union.items()}
    joint = _bound_together(jobs, union) if union else []
    return replace(
        first, values={**first.values, **values_of}, joint=(*first.joint, *joint), asked=set()
    )


def _check_alike(setting: Setting, values: Sequence[Value]) -> None:
    """Refuse values of different origin with the same name, which one store cannot distinguish."""
    origins = {(value, getattr(value, "origin", None)) for value in values}
    counts = Counter(value for value, _ in origins)
    if twice := [value for value, count in counts.items() if count > 1]:
        raise ConfigurationError(
            f"{setting.key} has {str(twice[0])!r} for two values in jobs of one store, but their "
            f"names must differ; name one of them, or {OWN_STORES}"
        )


def _bound_together(jobs: Sequence[Job], union: Mapping[Setting, Point]) -> list[Joint]:
    """Return joint axes of settings that are not crossed; of all settings if nothing crosses."""
    groups: list[Joint] = []
    alone = list(union)
    for key in jobs[0].overrides:
        own = [setting for setting in alone if _follows(jobs, key, setting)]
        if len(own) > 1:
            alone = [setting for setting in alone if setting not in own]
            labels = {
                tuple(job.choices.one(setting) for setting in own): job.overrides[key]
                for job in jobs
            }
            name = re.split(r"[/.]", key.lstrip("+"))[-1]
            groups.append(_joint(name, own, dict(sorted(labels.items(), key=_by_label))))
    points = {
        point for job in jobs for point in product(*(job.choices[setting] for setting in union))
    }
    sizes = [len(union[setting]) for setting in alone] + [len(group.points) for group in groups]
    if math.prod(sizes) == len(points):
        return groups
    every = sorted(points, key=lambda point: [rank(value) for value in point])
    labels = {
        point: ",".join(f"{one.name}={value}" for one, value in zip(union, point, strict=True))
        for point in every
    }
    return [_joint("job", list(union), labels)]


def _follows(jobs: Sequence[Job], key: str, setting: Setting) -> bool:
    """Return whether the value swept under a key alone decides that of a setting."""
    decided: dict[str | None, Point] = {}
    for job in jobs:
        values = job.choices[setting]
        if len(values) != 1 or decided.setdefault(job.overrides.get(key), values) != values:
            return False
    return len(set(decided.values())) > 1


def _by_label(labelled: tuple[Point, str]) -> tuple[bool, float, str]:
    """Return the sort key of a point with its label: numbers in ascending order, then words."""
    label = labelled[1]
    try:
        return False, float(label), label
    except ValueError:
        return True, 0.0, label


def _joint(name: str, settings: Sequence[Setting], labels: Mapping[Point, str]) -> Joint:
    """Return the joint axis of settings whose points have labels."""
    keys = tuple(setting.key for setting in settings)
    return Joint(name, keys, tuple(labels), tuple(labels.values()))
