"""Jobs of a Hydra multirun as one sweep: settings that differ between jobs become axes.

Settings that the jobs cross are axes of their own. Settings that change together, as those of a
group's choices (`spring=soft,hard`), run together along one axis named after the group. A store
path that differs between jobs keeps them apart.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override, RangeSweep, Transformer
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, open_dict

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.front import legible
from sweeps.engine.kinds import MOST_VALUES, Value, rank
from sweeps.engine.provenance import written
from sweeps.engine.settings import Choices, Joint, Run, Setting
from sweeps.engine.stage import Experiment

Point = tuple[Value, ...]

MOST_JOBS = 1_000  # each is composed by itself; more values of a setting are an axis


@dataclass(frozen=True)
class Job:
    """One job of a multirun: swept values by key, and its choices."""

    overrides: Mapping[str, str]
    choices: Choices
    store: str | None  # if it has one of its own


# jobs of a command line ---------------------------------------------------------------------------


def crossed(experiment: Experiment, arguments: Sequence[str]) -> list[str]:
    """Return overrides of a multirun with swept settings as lists: `a=1,2` becomes `a=[1,2]`.

    A grid of thousands of points is then one job. A key that another override refers to, such as
    the store's path, stays swept, as do settings of one value and keys that are not settings.

    Raises
    ------
    ConfigurationError
        If a range has more values than an axis may have.
    """
    try:
        parsed = OverridesParser.create().parse_overrides(list(arguments))
    except HydraException:
        return list(arguments)  # refused with its reason where Hydra reads it
    lines = [str(one.input_line) for one in parsed]
    for one, line in zip(parsed, lines, strict=True):
        own_path = one.key_or_group == Run.store.key and "${hydra:" in line
        if own_path or one.key_or_group in ("hydra/sweeper", "hydra/launcher"):
            return list(arguments)
    axes = {one.key for one in experiment.declared if not one.fixed}
    return [
        _as_list(one)
        if one.is_sweep_override()
        and one.key_or_group in axes
        and not any(f"{{{one.key_or_group}}}" in other for other in lines)
        else line
        for one, line in zip(parsed, lines, strict=True)
    ]


def _as_list(override: Override) -> str:
    if (count := _count(override)) > MOST_VALUES:
        raise ConfigurationError(
            f"{override.key_or_group} is {_written(override)}, which has {_said(count)} values, "
            f"but may have at most {MOST_VALUES:,}"
        )
    values = [str(one) for one in override.sweep_iterator(transformer=Transformer.encode)]
    if any(value.startswith(("[", "{")) for value in values):
        return str(override.input_line)
    return f"{override.get_key_element()}=[{','.join(values)}]"


def _count(override: Override) -> float:
    """Return the number of values that a swept override has, without making them."""
    value = override.value()
    if isinstance(value, ChoiceSweep):
        return len(value.list)
    if not isinstance(value, RangeSweep):
        return 1
    start, stop, step = (float(one or 0) for one in (value.start, value.stop, value.step))
    count = (stop - start) / step if step else math.inf
    return math.inf if not math.isfinite(count) else max(0, math.ceil(count))


def _written(override: Override) -> str:
    """Return the value of an override as it was written."""
    return str(override.input_line).partition("=")[2]


def _said(count: float) -> str:
    return f"{count:,.0f}" if math.isfinite(count) else "endless"


def jobs_of(loader: Any, master: DictConfig) -> list[list[str]] | None:
    """Return overrides of every job of Hydra's basic sweeper; None if another one is configured.

    `loader` is Hydra's, `master` the configuration of a multirun with Hydra's own part.

    Raises
    ------
    ConfigurationError
        If there are more than `MOST_JOBS`.
    """
    if not master.hydra.sweeper._target_.endswith(f".{BasicSweeper.__name__}"):
        return None
    overrides = OmegaConf.to_container(master.hydra.overrides.task, resolve=False)
    parsed = OverridesParser.create(loader).parse_overrides(overrides)  # type: ignore[arg-type]
    many = [one for one in parsed if one.is_sweep_override()]
    if (count := math.prod(map(_count, many))) > MOST_JOBS:
        longest = max(many, key=_count)
        raise ConfigurationError(
            f"{longest.key_or_group} is {_written(longest)}, which makes {_said(count)} jobs, "
            f"but there may be at most {MOST_JOBS:,}; a setting that may have several values is "
            "an axis of one job"
        )
    return [job for batch in BasicSweeper.split_arguments(parsed, None) for job in batch]


def batches(master: DictConfig, jobs: Sequence[Job]) -> Iterator[list[Job]]:
    """Yield jobs that run at once: Hydra's batches, with all earlier jobs of their stores.

    A store grows from batch to batch, and finished cells are reused.
    """
    size = master.hydra.sweeper.max_batch_size or len(jobs)
    for end in range(size, len(jobs) + size, size):
        stores = {job.store for job in jobs[end - size : end]}
        yield [job for job in jobs[:end] if job.store in stores]


def read_job(
    loader: Any,
    master: DictConfig,
    overrides: Sequence[str],
    number: int,
    read: Callable[[DictConfig], Choices],
) -> Job:
    """Return a job of a multirun; `read` makes choices of its configuration."""
    with legible(overrides):
        composed = loader.load_sweep_config(master, list(overrides))
    with open_dict(composed):
        composed.hydra.job.id = composed.hydra.job.num = number
    HydraConfig.instance().set_config(composed)
    with open_dict(composed):
        del composed["hydra"]
    choices = read(composed)
    return Job(swept(overrides), choices, choices.one(Run.store))


def swept(overrides: Sequence[str]) -> dict[str, str]:
    """Return values set by overrides, by key, without those that only clear a setting."""
    pairs = (one.partition("=") for one in overrides)
    return {key: value for key, _, value in pairs if value != "null" or not key.startswith("++")}


# several jobs as one sweep ------------------------------------------------------------------------


def fused(experiment: Experiment, jobs: Sequence[Job]) -> list[tuple[Choices, str | None]]:
    """Return choices and the path of the store of each sweep that jobs are fused into.

    Raises
    ------
    ConfigurationError
        If jobs of one store differ in something that takes one value.
    """
    by_store: dict[str | None, list[Job]] = {}
    for job in jobs:
        by_store.setdefault(os.path.abspath(job.store) if job.store else None, []).append(job)
    return [(_fuse(experiment, group), store) for store, group in by_store.items()]


def _fuse(experiment: Experiment, jobs: Sequence[Job]) -> Choices:
    first = jobs[0].choices
    if any(job.choices.joint != first.joint for job in jobs):
        raise ConfigurationError(
            "grid.zip has settings whose values differ between jobs of one store; put them into "
            "the store's path for a store each"
        )
    for setting in experiment.declared:
        _check_alike(setting, [value for job in jobs for value in job.choices[setting]])
    differing = [
        setting
        for setting in experiment.declared
        if any(job.choices[setting] != first[setting] for job in jobs)
    ]
    for setting in differing:
        if setting.fixed:
            found = [written(setting, job.choices[setting]) for job in jobs]
            asked = " and ".join(dict.fromkeys("null" if x is None else str(x) for x in found))
            raise ConfigurationError(
                f"{setting.key} is {asked} in jobs of one store, but must be one: "
                f"{setting.fixed}; put it into the store's path for a store each"
            )
    union = {
        setting.key: tuple(
            sorted({value for job in jobs for value in job.choices[setting]}, key=rank)
        )
        for setting in differing
    }
    joint = _bound_together(jobs, differing) if differing else []
    return Choices({**first.values, **union}, (*first.joint, *joint))


def _check_alike(setting: Setting, values: Sequence[Value]) -> None:
    """Refuse values of different origin with the same name, which one store cannot distinguish."""
    origins: dict[Value, Any] = {}
    for value in values:
        origin = getattr(value, "origin", None)
        if origins.setdefault(value, origin) != origin:
            raise ConfigurationError(
                f"{setting.key} has {str(value)!r} for two values in jobs of one store, but their "
                "names must differ; name one of them, or put it into the store's path"
            )


def _bound_together(jobs: Sequence[Job], differing: Sequence[Setting]) -> list[Joint]:
    """Return joint axes of settings that are not crossed; of all settings if nothing crosses."""
    free = list(differing)
    groups: list[Joint] = []
    for key in jobs[0].overrides:
        own = [one for one in free if _follows(jobs, key, one)]
        free = [one for one in free if one not in own]
        if len(own) > 1:
            label: dict[Point, str] = {}
            for job in jobs:
                point = tuple(job.choices.one(one) for one in own)
                label.setdefault(point, job.overrides[key])
            there = sorted(label, key=lambda point: _natural(label[point]))
            groups.append(_joint(_word(key), own, there, [label[point] for point in there]))
    points = {
        point for job in jobs for point in product(*(job.choices[setting] for setting in differing))
    }
    bound = {key for group in groups for key in group.keys}
    counts = [
        len({point[place] for point in points})
        for place, one in enumerate(differing)
        if one.key not in bound
    ]
    if math.prod((*counts, *(len(group.points) for group in groups))) == len(points):
        return groups
    every = sorted(points, key=lambda point: [rank(value) for value in point])
    labels = [
        ",".join(f"{one.name}={value}" for one, value in zip(differing, point, strict=True))
        for point in every
    ]
    return [_joint("job", differing, every, labels)]


def _joint(
    name: str, settings: Sequence[Setting], points: Sequence[Point], labels: Sequence[str]
) -> Joint:
    return Joint(name, tuple(one.key for one in settings), tuple(points), tuple(labels))


def _follows(jobs: Sequence[Job], key: str, setting: Setting) -> bool:
    """Return whether the value swept under a key alone decides that of a setting."""
    decided: dict[str | None, Point] = {}
    for job in jobs:
        values = job.choices[setting]
        if len(values) != 1 or decided.setdefault(job.overrides.get(key), values) != values:
            return False
    return len(set(decided.values())) > 1


def _natural(label: str) -> tuple[bool, float, str]:
    """Return the sort key of a label: numbers in ascending order, then words."""
    try:
        return False, float(label), label
    except ValueError:
        return True, 0.0, label


def _word(key: str) -> str:
    return re.split(r"[/.]", key.lstrip("+"))[-1]
