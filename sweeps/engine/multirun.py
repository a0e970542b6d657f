"""Jobs of a Hydra multirun as one sweep: what differs between them becomes axes.

Settings that the jobs cross are axes of their own. Settings that change together, as those of a
group's choices (`ladar=full_profile,peak_pulse`), run together along one axis named after the
group. A store path that differs between jobs keeps them apart.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, ValueType
from hydra.errors import HydraException

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.experiment import Experiment
from sweeps.engine.kinds import Value
from sweeps.engine.provenance import written
from sweeps.engine.settings import Choices, Joint, Setting

Jobs = list[list[str]]
Point = tuple[Value, ...]

OUT_OF_JOB = re.compile(r"\$\{hydra:")


@dataclass(frozen=True)
class Job:
    """One job of a multirun.

    Attributes
    ----------
    overrides : mapping of str to str
        What was swept, key to value.
    choices : Choices
        What its configuration comes to.
    store : str or None
        Path of its store, if it has one of its own.
    """

    overrides: Mapping[str, str]
    choices: Choices
    store: str | None


def crossed(experiment: Experiment, arguments: Sequence[str]) -> list[str]:
    """Overrides of a multirun in which swept settings are lists: `a=1,2` becomes `a=[1,2]`.

    So a grid of thousands of points is one job. What another override names, as the path of the
    store, stays swept, and so does what takes one value, or is no setting at all.
    """
    try:
        parsed = OverridesParser.create().parse_overrides(list(arguments))
    except HydraException:
        return list(arguments)  # refused with its reason where Hydra reads it
    if any(one.key_or_group in ("hydra/sweeper", "hydra/launcher") for one in parsed):
        return list(arguments)
    store = next((one.input_line or "" for one in parsed if one.key_or_group == "store"), "")
    if OUT_OF_JOB.search(store):
        return list(arguments)
    axes = {one.key for one in experiment.declared if not one.fixed}
    return [
        _as_list(one)
        if one.is_sweep_override()
        and one.key_or_group in axes
        and not any(f"{{{one.key_or_group}}}" in str(other.input_line) for other in parsed)
        else str(one.input_line)
        for one in parsed
    ]


def _as_list(override: Override) -> str:
    from hydra.core.override_parser.types import Transformer

    values = [str(one) for one in override.sweep_iterator(transformer=Transformer.encode)]
    if any(value.startswith(("[", "{")) for value in values):
        return str(override.input_line)
    return f"{override.get_key_element()}=[{','.join(values)}]"


def split(arguments: Sequence[str]) -> Jobs | None:
    """Overrides of every job that Hydra's own sweeper would start; None where another one would."""
    parsed = OverridesParser.create().parse_overrides(list(arguments))
    kinds = {one.value_type for one in parsed}
    other = any(one.key_or_group == "hydra/sweeper" for one in parsed)
    if other or ValueType.GLOB_CHOICE_SWEEP in kinds:  # expanded by Hydra, which knows the groups
        return None
    return [job for batch in BasicSweeper.split_arguments(parsed, None) for job in batch]


def fused(experiment: Experiment, jobs: Sequence[Job]) -> list[tuple[Choices, str | None]]:
    """Choices, with the path of the store, of the sweeps that some jobs come to.

    Parameters
    ----------
    experiment : Experiment
        What is declared.
    jobs : sequence of Job
        In their order.

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
    if len(jobs) == 1:
        return first
    differing = [
        setting
        for setting in experiment.declared
        if any(job.choices[setting] != first[setting] for job in jobs)
    ]
    if any(job.choices.joint != first.joint for job in jobs):
        raise ConfigurationError(
            "grid.zip has settings whose values differ between jobs of one store; put them into "
            "the store's path for a store each"
        )
    if not differing:
        return first
    for setting in differing:
        if setting.fixed:
            asked = " and ".join(
                dict.fromkeys(str(written(setting, job.choices[setting])) for job in jobs)
            )
            raise ConfigurationError(
                f"{setting.key} is {asked} in jobs of one store, but must be one: "
                f"{setting.fixed}; put it into the store's path for a store each"
            )
    points = {
        point: job
        for job in jobs
        for point in product(*(job.choices[setting] for setting in differing))
    }
    union = {
        setting.key: _ascending(value for job in jobs for value in job.choices[setting])
        for setting in differing
    }
    values = {**first.values, **union}
    groups = _bound_together(jobs, differing, points)
    joint = tuple(
        Joint(
            name,
            tuple(setting.key for setting in members),
            tuple(there),
            tuple(labels),
        )
        for name, members, there, labels in groups
    )
    return Choices(values, (*first.joint, *joint))


Group = tuple[str, list[Setting], list[Point], list[str]]


def _bound_together(
    jobs: Sequence[Job], differing: Sequence[Setting], points: Mapping[Point, Job]
) -> list[Group]:
    """Settings that do not run crossed, by what was swept; all of them where nothing crosses."""
    swept = [key for key in jobs[0].overrides if len({job.overrides.get(key) for job in jobs}) > 1]
    taken: set[str] = set()
    groups: list[Group] = []
    for key in swept:
        own = [one for one in differing if one.key not in taken and _follows(jobs, key, one)]
        taken.update(one.key for one in own)
        if len(own) > 1:
            label: dict[Point, str] = {}
            for job in jobs:
                point = tuple(job.choices[one][0] for one in own)
                label.setdefault(point, job.overrides[key])
            there = sorted(label, key=lambda point: _natural(label[point]))
            groups.append((_word(key), own, there, [label[point] for point in there]))
    bound = {one.key for _, members, _, _ in groups for one in members}
    free = [one for one in differing if one.key not in bound]
    count = 1
    for one in free:
        count *= len({value for point in points for value in (point[differing.index(one)],)})
    for _, _, there, _ in groups:
        count *= len(there)
    if count == len(points):
        return groups
    every = sorted(points, key=lambda point: [_rank(value) for value in point])
    labels = [
        ",".join(f"{one.name}={value}" for one, value in zip(differing, point, strict=True))
        for point in every
    ]
    return [("job", list(differing), every, labels)]


def _follows(jobs: Sequence[Job], key: str, setting: Setting) -> bool:
    """Whether the value of a setting is decided by what is swept under a key, and by one value."""
    decided: dict[str | None, tuple[Value, ...]] = {}
    for job in jobs:
        values = job.choices[setting]
        if len(values) != 1 or decided.setdefault(job.overrides.get(key), values) != values:
            return False
    return len(set(decided.values())) > 1


def _natural(label: str) -> tuple[bool, float, str]:
    """Numbers in ascending order before words by name."""
    try:
        return False, float(label), label
    except ValueError:
        return True, 0.0, label


def _word(key: str) -> str:
    return key.lstrip("+").rpartition("/")[2].rpartition(".")[2]


def _ascending(values: Any) -> tuple[Value, ...]:
    return tuple(sorted(dict.fromkeys(values), key=_rank))


def _rank(value: Any) -> tuple[bool, Any]:
    return value is not None, 0 if value is None else value
