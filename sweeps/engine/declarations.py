"""Checks of an experiment's declarations when it is assembled."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain
from typing import Any

import numpy as np

from sweeps.engine.errors import DeclarationError

RNG, THERE = "rng", "there"
NO_STATUS = "-"

Stages = Iterable[Any]  # of `sweeps.engine.stage`, which imports this module


def check_declarations(
    settings: Iterable[Any], stages: Stages, tables: Iterable[Any], statuses: Iterable[Any]
) -> None:
    """Raise DeclarationError for the first mistake in the declarations of an experiment.

    Parameters
    ----------
    settings : iterable of Setting
        All of the experiment's, including those of the engine.
    stages, tables, statuses : iterables
        Those of the experiment.
    """
    stages, statuses = tuple(stages), tuple(statuses)
    keys = _once((one.key for one in settings), "settings")
    _once((one.name for one in stages), "stages")
    outputs = [
        f"{one.group or stage.group}/{one.name}"
        for stage in stages
        for one in stage.outputs
        if stage.group is not None and one.stored
    ]
    _once(outputs, "outputs of a group of the store")
    for setting in settings:
        _check_name(f"setting {setting.key}", setting.name)
    for stage in stages:
        _check_stage(stage, keys)
        _check_arguments(stage, {one.name for one in stages})
        if stage.status and stage.status != NO_STATUS:
            _check_known(f"stage {stage.name}: status", stage.status, [s.name for s in statuses])
    for status in statuses:
        for one in status.over:
            _check_known(f"status {status.name}: setting", one.key, keys)
    groups = {name.rpartition("/")[0] for name in outputs}
    for table in tables:
        _check_group(f"table {table.group}", table.group)
        for group in table.of:
            _check_known(f"table {table.group}: group", group, groups)
        groups.add(table.group)


def _check_stage(stage: Any, keys: set[str]) -> None:
    what = f"stage {stage.name}"
    _check_name(what, stage.name)
    _once((one.name for one in stage.outputs), f"outputs of {what}")
    if stage.group is not None:
        _check_group(what, stage.group)
    for output in stage.outputs:
        for name in (output.name, *output.dims):
            _check_name(what, name)
        if output.group is not None:
            _check_group(what, output.group)
        for dim, begin in output.origin.items():
            _check_known(f"{what}: dimension of an origin", dim, output.dims)
            _check_known(f"{what}: output of an origin", begin, [o.name for o in stage.outputs])
        _check_dtype(f"{what}: {output.name}", output.dtype, stage.group and output.stored)
    named = (*stage.along, *stage.gather, *(stage.stream or ()), *stage.optional, *stage.names)
    taken = chain.from_iterable(stage.at.items())
    for setting in (*named, *taken):
        _check_known(f"{what}: setting", setting.key, keys)
    if stage.optional and not {*stage.optional} <= {*(stage.stream or ())}:
        raise DeclarationError(f"{what} has optional settings that its stream does not have")
    drawn = stage.stream is not None or stage.noise or stage.optional
    if drawn and RNG not in stage.arguments:
        raise DeclarationError(f"{what} has a stream, but its function does not take {RNG}")
    if THERE in stage.arguments and not stage.gather:
        raise DeclarationError(f"{what} takes {THERE}, but gathers nothing")
    # An argument may be of a group that the experiment lacks.
    for name in stage.arguments:
        source = stage.reads.get(name, name)
        found = next(_offered(stage, source), source)
        if hasattr(found, "key"):
            _check_known(f"{what}: setting", found.key, keys)


def _check_arguments(stage: Any, stages: set[str]) -> None:
    """Refuse an argument that is both a setting and another stage."""
    own = {stage.name, getattr(stage.function, "__name__", "")}  # a function may refine a setting
    for name in stage.arguments:
        if name in stages - own and name not in stage.reads:
            for setting in _offered(stage, name):
                raise DeclarationError(
                    f"stage {stage.name}: argument {name!r} is both the setting {setting.key} and "
                    "a stage; rename one of them, or say which by reads"
                )


def _offered(stage: Any, name: Any) -> Iterator[Any]:
    """Yield settings of a name in the groups that a stage uses."""
    if isinstance(name, str):
        for group in stage.uses:
            yield from (one for one in group.declared if one.key.rpartition(".")[2] == name)


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
