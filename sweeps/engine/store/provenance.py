"""Provenance of a store's results, and the check of sweeps that extend it."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import Count, Number, Switch, Text, Word, format_value
from sweeps.engine.declare.settings import Run, Setting, ZippedAxis, flatten, nested, read_choices
from sweeps.engine.declare.stage import Experiment
from sweeps.engine.resolve.keys import digest
from sweeps.engine.resolve.modules import save_parsed_modules
from sweeps.engine.resolve.plan import Plan

SHARED_ATTRIBUTES = ("version", "seed")  # attributes that every group of a store repeats
ENGINE_LIBRARIES = ("dask", "numpy", "xarray", "zarr")


def provenance(plan: Plan, failures: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return root attributes: everything that results depend on, and nothing else.

    They hold no times, hosts, paths or numbers of workers: equal sweeps make equal stores.
    `failures` maps the names of failed cells to reasons.
    """
    experiment, choices = plan.experiment, plan.choices
    attributes: dict[str, Any] = {
        "title": experiment.title,
        "Conventions": "CF-1.11",
        "configuration": nested(
            {s.key: s.kind.as_input(choices[s]) for s in _result_settings(experiment)}
        ),
        "version": " ".join([experiment.name, *_installed_version(experiment.name)]),
        "seed": Run.seed.kind.as_input(choices[Run.seed]),
        "versions": versions(plan),
        "code": dict(sorted(plan.code.items())),
        "parts": {key: part for parts in _code_parts(plan).values() for key, part in parts.items()},
        "shown": _display_digest(plan),
        "cells": {bound.name: plan.fingerprint(bound) for bound in plan.targets},
        "axes": [key for keys in plan.axis_lengths for key in keys.split("+")],
        "swept": [setting.name for setting in plan.varied_settings],
        **experiment.attributes(choices),
    }
    if choices.zipped:
        attributes["joint"] = [
            [axis.name, axis.keys, [[*map(str, point)] for point in axis.points], axis.labels]
            for axis in choices.zipped
        ]
    if failures:
        attributes["failures"] = dict(sorted(failures.items()))
    return attributes


def _code_parts(plan: Plan) -> dict[str, dict[str, str]]:
    """Return, by stage, the parts of its code digest by name, each as the beginning of its hash.

    A name that stages use for different parts is followed by the stage's name.
    """
    digests: dict[str, str] = {}
    parts: dict[str, dict[str, str]] = {}
    for stage, code in sorted(plan.digests.items()):
        for name, value in sorted(code.parts.items()):
            key = name if digests.setdefault(name, value) == value else f"{name} ({stage})"
            parts.setdefault(stage, {})[key] = value[:12]
    return parts


def differences(plan: Plan, old: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Yield each stage whose keys differ from the store's, with the differences."""
    settings, parts, new_versions = (
        _result_settings(plan.experiment),
        _code_parts(plan),
        versions(plan),
    )
    old_choices = read_choices(settings, flatten(settings, old.get("configuration", {})))
    keys = {setting.key for setting in settings if old_choices[setting] != plan.choices[setting]}
    code, old_parts, old_versions = (old.get(name, {}) for name in ("code", "parts", "versions"))
    differing: set[str] = set()
    for name, bound in plan.bound.items():
        libraries = {*plan.digests[name].libraries, *(["numpy"] if bound.random else [])}
        reasons = [
            f"{library} {old_versions[library]} -> {new_versions[library]}"
            for library in sorted(libraries & old_versions.keys())
            if old_versions[library] != new_versions[library]
        ]
        if name not in code:
            reasons = ["not in the store"]
        elif code[name] != plan.code[name]:
            changed_parts = [
                key for key, part in parts.get(name, {}).items() if old_parts.get(key) != part
            ]
            reasons += changed_parts or ([] if reasons else ["parts added or removed"])
        inputs = {
            source.name: {*source.needs} for source in bound.inputs if source.name in differing
        }
        reasons += sorted(keys & {*bound.needs, *bound.gather} - set().union(*inputs.values()))
        reasons += [f"its input {source}" for source in inputs]
        if reasons:
            differing.add(name)
            yield name, reasons if name in code else reasons[:1]


def _display_digest(plan: Plan) -> str:
    """Return the hash of all that a store displays besides results: labels, units, its tables."""
    experiment = plan.experiment
    settings = [
        (setting.key, setting.name, setting.label, setting.unit) for setting in experiment.declared
    ]
    stages = [(bound.stage.outputs, bound.stage.group.status) for bound in plan.targets]
    tables = [
        (table.group, table.of, _code_digest(table.make, plan), *map(repr, table.displays))
        for table in experiment.tables
        if table.when(plan.choices)
    ]
    save_parsed_modules()
    return digest(repr([settings, stages, tables]))


def _code_digest(function: Callable[..., Any], plan: Plan) -> str:
    """Return the digest of a table's function; empty if it cannot be hashed."""
    try:
        return plan.source_code.digest(function).digest
    except ConfigurationError:
        return ""


def _result_settings(experiment: Experiment) -> tuple[Setting, ...]:
    """Return the settings that results depend on."""
    return tuple(setting for setting in experiment.declared if setting.affects_results)


def versions(plan: Plan) -> dict[str, str]:
    """Return versions of the distributions that results depend on, and of Python."""
    libraries = {name: release for name in ENGINE_LIBRARIES for release in _installed_version(name)}
    for code in plan.digests.values():
        libraries |= code.libraries
    return {
        "python": ".".join(platform.python_version_tuple()[:2]),
        **dict(sorted(libraries.items())),
    }


def _installed_version(name: str) -> list[str]:
    """Return the version of a distribution; nothing if it is not installed."""
    try:
        return [version(name)]
    except PackageNotFoundError:
        return []


def check_extends(experiment: Experiment, path: str, old: Mapping[str, Any], plan: Plan) -> None:
    """Refuse a store whose attributes show another configuration or different code.

    A sweep may extend a store if it includes all of the store's values. The
    ConfigurationError names the keys that differ, and the remedy.
    """
    if "configuration" not in old or old.get("title") != experiment.title:
        content = repr(old["title"]) if "title" in old else "other data"
        raise ConfigurationError(
            f"store is {path!r}, which holds {content}; it must be a new path, or a store of "
            f"{experiment.name}"
        )
    settings = _result_settings(experiment)
    old_choices = read_choices(settings, flatten(settings, old["configuration"]))
    for setting in settings:
        stored, requested = old_choices[setting], plan.choices[setting]
        missing = sorted(set(stored).difference(requested), key=stored.index)
        if not missing:
            continue
        advice = "give another store"
        if (
            isinstance(setting.kind, Number | Count | Word | Switch | Text)
            and not setting.not_swept
        ):
            union = sorted({*stored, *requested}, key=lambda value: (value is None, value))
            advice = f"give {setting.override(union)} to have both, or another store"
        raise ConfigurationError(
            f"{setting.message_name} is {', '.join(map(format_value, requested))}, but the store "
            f"{path!r} has {', '.join(map(format_value, missing))}: {advice}"
        )
    texts = replace(
        old_choices,
        values={key: tuple(map(str, values)) for key, values in old_choices.values.items()},
        zipped=tuple(ZippedAxis(*axis) for axis in old.get("joint", ())),
    )
    for zipped in plan.choices.zipped:
        points = {tuple(map(str, point)) for point in zipped.points}
        if not set(texts.points(zipped.keys)) <= points:
            raise ConfigurationError(
                f"store is {path!r}, which has other values of {', '.join(sorted(zipped.keys))} "
                "together; include these points in those that run together, or give another store"
            )
    current = {"code": plan.code, "versions": versions(plan)}
    for kind, word in (("code", "different code of"), ("versions", "a different version of")):
        for name, value in old.get(kind, {}).items():
            if current[kind].get(name, value) != value:
                differs = ", ".join(dict(differences(plan, old)).get(name, ())[:3])
                label = f"{name} ({differs})" if differs else name
                raise ConfigurationError(
                    f"store is {path!r}, which was made by {word} {label}; give another "
                    "store, or remove it"
                )
