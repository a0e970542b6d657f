"""Jobs as one sweep: settings that differ between jobs become axes.

Settings that the jobs cross are axes of their own. Settings that change together, as those of a
group's choices (`spring=soft,hard`), run together along one axis named after the group. A store
path that differs between jobs keeps them apart.
"""

from __future__ import annotations

import math
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import product

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import Value, rank, shown
from sweeps.engine.overrides import Job
from sweeps.engine.settings import Choices, Joint, Setting
from sweeps.engine.stage import Experiment

Point = tuple[Value, ...]
OWN_STORES = "put it into the store's path for a store each"


def fused(experiment: Experiment, jobs: Sequence[Job]) -> list[tuple[Choices, str]]:
    """Return choices and the path of the store of each sweep that jobs are fused into.

    Raises
    ------
    ConfigurationError
        If jobs of one store differ in something that takes one value.
    """
    by_store: dict[str, list[Job]] = {}
    for job in jobs:
        by_store.setdefault(os.path.abspath(job.store), []).append(job)
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
    return Choices({**first.values, **values_of}, (*first.joint, *joint))


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
