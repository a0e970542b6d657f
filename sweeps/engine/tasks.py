"""What a worker does: calls of stages, whose results it packs.

A task is a batch of calls. A call computes one cell, or several along the axes that its stage
computes together.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sweeps.engine.inputs import Arrays, Damaged, Inputs, Recipe, Spot, Step
from sweeps.engine.results import Pack, write_pack


@dataclass(frozen=True)
class Call:
    """One call of a function, and the cells that it gives.

    Attributes
    ----------
    step : Step
        The stage.
    recipe : Recipe
        Its arguments.
    shape : tuple of int
        Lengths of the axes that it computes together.
    cells : tuple of (str, int)
        Key of each cell wanted, and its place on these axes.
    """

    step: Step
    recipe: Recipe
    shape: tuple[int, ...]
    cells: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Done:
    """What became of a call.

    Attributes
    ----------
    seconds : float
        Time that it took.
    spots : tuple of Spot
        Where its cells are, in their order; empty when it failed.
    reason : str
        Why it failed.
    damaged : tuple of str
        Keys of inputs that could not be read back, for want of which it was not tried.
    """

    seconds: float
    spots: tuple[Spot, ...] = ()
    reason: str = ""
    damaged: tuple[str, ...] = ()


@dataclass(frozen=True)
class Report:
    """What became of a task: its calls in their order, and the packs that it wrote by stage."""

    calls: tuple[Done, ...]
    packs: tuple[tuple[str, Pack], ...]
    spilled: str = ""


def run_calls(calls: tuple[Call, ...], folder: Path, spill: Path | None = None) -> Report:
    """Run calls one after the other and pack their results.

    Parameters
    ----------
    calls : tuple of Call
        The task.
    folder : Path
        Where packs are.
    spill : Path, optional
        Where results go when `folder` is full or cannot be written to.

    Returns
    -------
    Report
        With an entry for every call; one that raises does not keep the others from running.
    """
    outcomes: list[Done] = []
    results: dict[str, list[tuple[str, Arrays]]] = {}
    where: list[list[tuple[str, int]]] = []
    inputs = Inputs([call.recipe for call in calls], folder)
    for number, call in enumerate(calls):
        start = time.perf_counter()
        rows: list[tuple[str, int]] = []
        try:
            cells = _cells(call, call.step.call(**inputs.arguments(number, call.step)))
        except Damaged as error:
            outcomes.append(Done(time.perf_counter() - start, damaged=error.keys))
        except Exception as error:
            outcomes.append(Done(time.perf_counter() - start, reason=reason(error)))
        else:
            outcomes.append(Done(time.perf_counter() - start))
            there = results.setdefault(call.step.name, [])
            for cell in cells:
                rows.append((call.step.name, len(there)))
                there.append(cell)
        where.append(rows)
    packs, spilled = _pack(results, folder, spill)
    finished = tuple(
        Done(
            one.seconds,
            tuple((packs[name].path, row) for name, row in rows),
            one.reason,
            one.damaged,
        )
        for one, rows in zip(outcomes, where, strict=True)
    )
    return Report(finished, tuple(packs.items()), spilled)


def reason(error: BaseException) -> str:
    """An exception in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def _pack(
    results: Mapping[str, list[tuple[str, Arrays]]], folder: Path, spill: Path | None
) -> tuple[dict[str, Pack], str]:
    """A pack for every stage; beside the store, when the cache does not take it."""
    packs: dict[str, Pack] = {}
    spilled = ""
    for name, cells in results.items():
        try:
            packs[name] = write_pack(folder, name, cells)
        except OSError as error:
            if spill is None:
                raise
            spilled = f"{error.strerror or error}"
            pack = write_pack(spill, name, cells)
            packs[name] = Pack(str(spill / pack.path), pack.size, pack.keys)
    return packs, spilled


def _cells(call: Call, found: Any) -> list[tuple[str, Arrays]]:
    """Key and arrays of each cell that is wanted of what a call returned."""
    arrays = _named(call.step, found)
    cells: list[tuple[str, Arrays]] = []
    for name, array in arrays.items():
        if array.shape[: len(call.shape)] != call.shape:
            raise ValueError(
                f"{name} of {call.step.name} has shape {array.shape}, but must begin with "
                f"{call.shape}"
            )
    for key, place in call.cells:
        at: Any = (*np.unravel_index(place, call.shape), ...)  # an array even of one value
        cells.append((key, {name: array[at].copy() for name, array in arrays.items()}))
    return cells


def _named(step: Step, found: Any) -> Arrays:
    """What a function returned, by output."""
    names = [name for name, *_ in step.outputs]
    if not isinstance(found, Mapping):
        if len(names) != 1:
            raise TypeError(f"{step.name} must return a mapping of {', '.join(names)}")
        found = {names[0]: found}
    if set(found) != set(names):
        raise TypeError(
            f"{step.name} returned {', '.join(map(str, found))}, but must return {', '.join(names)}"
        )
    return {
        name: np.asarray(found[name]).astype(dtype, copy=False) for name, dtype, _ in step.outputs
    }
