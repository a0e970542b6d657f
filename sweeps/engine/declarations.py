"""Checks of an experiment's declarations when it is assembled."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import Any

import numpy as np

from sweeps.engine.errors import DeclarationError

RNG, VALID = "rng", "valid"
SINGLE = "dimension", "coordinate"  # what a setting of one value may be in a store

Stages = Iterable[Any]  # of `sweeps.engine.stage`, which imports this module


def check_declarations(settings: Iterable[Any], stages: Stages, tables: Iterable[Any]) -> None:
    """Raise DeclarationError for the first mistake in the declarations of an experiment.

    Parameters
    ----------
    settings : iterable of Setting
        All of the experiment's, including those of the engine.
    stages, tables : iterables
        Those of the experiment.
    """
    stages = tuple(stages)
    keys = _once((one.key for one in settings), "settings")
    _once((one.name for one in stages), "stages")
    outputs = [
        f"{stage.place_of(output)}/{output.name}"
        for stage in stages
        for output in stage.outputs
        if stage.place_of(output)
    ]
    _once(outputs, "outputs of a group of the store")
    for setting in settings:
        _check_name(f"setting {setting.key}", setting.name)
        if setting.single and setting.single not in SINGLE:
            raise DeclarationError(
                f"setting {setting.key} has single={setting.single!r}, but must have one of "
                f"{', '.join(map(repr, SINGLE))}"
            )
    for stage in stages:
        _check_stage(stage, keys)
    groups = {name.rpartition("/")[0] for name in outputs}
    for table in tables:
        _check_group(f"table {table.group}", table.group)
        for group in table.of:
            _check_known(f"table {table.group}: group", group, groups)
        groups.add(table.group)


def check_names(settings: Iterable[Any], stages: Iterable[Any]) -> None:
    """Raise DeclarationError if an output or own dimension is named like something in its group.

    Parameters
    ----------
    settings : iterable of Setting
        All of the experiment's.
    stages : iterable of Bound
        Its stages, with the settings that they depend on.
    """
    in_stores = {s.key: s for s in settings if s.single or not s.fixed}
    axes: dict[tuple[str, str], str] = {}  # keys of settings by group and name of the coordinate
    dims: set[tuple[str, str]] = set()
    stored = [
        (bound, output, bound.stage.place_of(output))
        for bound in stages
        for output in bound.stage.outputs
        if bound.stage.place_of(output)
    ]
    for bound, output, group in stored:
        dims |= {(group, dim) for dim in output.dims}
        for setting in (in_stores[key] for key in bound.needs if key in in_stores):
            axes[group, bound.stage.group.names.get(setting) or setting.name] = setting.key
    for bound, output, group in stored:
        what = f"stage {bound.name}: {output.name}"
        if (key := axes.get((group, output.name))) is not None:
            raise DeclarationError(f"{what} is named like the setting {key}; rename one of them")
        if (group, output.name) in dims and output.dims != (output.name,):
            raise DeclarationError(f"{what} is named like a dimension of its group")
        for dim in output.dims:
            key = axes.get((group, dim))
            if key is not None and key not in bound.gather:
                raise DeclarationError(
                    f"{what} has a dimension named like the setting {key}, which the stage does "
                    "not gather; rename one of them"
                )


def _check_stage(stage: Any, keys: set[str]) -> None:
    what = f"stage {stage.name}"
    _check_name(what, stage.name)
    _once((one.name for one in stage.outputs), f"outputs of {what}")
    named = (*stage.along, *stage.gather, *chain.from_iterable(stage.at.items()))
    if stage.group.path:
        _check_group(what, stage.group.path)
    named += (*stage.group.names, *(stage.group.status.over if stage.group.status else ()))
    for output in stage.outputs:
        for name in (output.name, *output.dims):
            _check_name(what, name)
        _check_dtype(f"{what}: {output.name}", output.dtype, stage.place_of(output))
    if stage.stream is not None:
        named += (*stage.stream.settings, *stage.stream.optional)
    for setting in named:
        _check_known(f"{what}: setting", setting.key, keys)
    if stage.stream is not None and RNG not in stage.arguments:
        raise DeclarationError(f"{what} has a stream, but its function does not take {RNG}")
    if VALID in stage.arguments and not stage.gather:
        raise DeclarationError(f"{what} takes {VALID}, but gathers nothing")


def _check_dtype(what: str, dtype: str, stored: Any) -> None:
    try:
        found = np.dtype(dtype)
    except TypeError:
        raise DeclarationError(f"{what} has the dtype {dtype!r}, unknown to numpy") from None
    plain = not (found.hasobject or found.names or found.subdtype)
    storable = found.kind == "U" or (found.kind in "biuf" and found.itemsize <= 8)
    if not plain or (stored and not storable):
        raise DeclarationError(
            f"{what} has the dtype {dtype!r}, but must have one of numbers of at most 8 bytes, "
            "truth values or texts of fixed width"
        )


def _check_name(what: str, name: str) -> None:
    if not name or "/" in name or name.startswith(".") or name.startswith("__"):
        raise DeclarationError(
            f"{what} has the name {name!r}, but a name must not be empty, have '/', or begin "
            "with '.' or '__'"
        )


def _check_group(what: str, path: str) -> None:
    for name in path.split("/"):
        _check_name(f"{what} in group {path!r}", name)


def _check_known(what: str, name: str, known: Iterable[str]) -> None:
    if name not in known:
        raise DeclarationError(f"{what} {name} is not in the experiment")


def _once(names: Iterable[str], what: str) -> set[str]:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise DeclarationError(f"two {what} have the name {name}")
        seen.add(name)
    return seen
