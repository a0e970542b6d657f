"""Tasks of a worker: calls of stages, whose inputs it reads or makes, and whose results it packs.

A task is a batch of calls. A call computes one cell, or several along the axes that its stage
computes together. Inputs come by recipe: a plain value, arrays from a pack, a stack of such arrays,
or an object made by another stage in this process, which keeps the last few of each.
"""

from __future__ import annotations

import importlib
import threading
import time
from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sweeps.engine.declarations import RNG, THERE
from sweeps.engine.failures import described, reason, traceback_of
from sweeps.engine.packs import Pack, Spot, read_cells, write_pack
from sweeps.engine.returned import Arrays, Slot, arrays_of
from sweeps.engine.seeds import cell_rng
from sweeps.engine.stage import Stage

AHEAD_BYTES = 2**25  # of inputs that are read at once
AHEAD_RECIPES = 512


@dataclass(frozen=True)
class Step:
    """Description of a stage for workers."""

    name: str
    function: Any  # its module and qualified name, or itself if it is in no module
    outputs: tuple[Slot, ...]
    keep: int  # number of results in memory, of a stage not kept on disk
    drawn: bool  # whether it takes `rng`
    asks: bool  # whether it takes `there`

    @classmethod
    @cache
    def of(cls, stage: Stage) -> Step:
        """Return the description of a stage."""
        function: Any = stage.function
        module, name = function.__module__, function.__qualname__
        if module != "__main__" and "<" not in name:
            function = module, name
        stored = stage.group is not None
        outputs = tuple(
            Slot(one.name, one.dtype, one.empty, len(one.dims), stored and one.even, one.measured)
            for one in stage.outputs
        )
        asked = stage.arguments
        return cls(stage.name, function, outputs, stage.memory, RNG in asked, THERE in asked)

    @property
    def call(self) -> Callable[..., Any]:
        """The function."""
        if not isinstance(self.function, tuple):
            return self.function
        module, name = self.function
        found: Any = importlib.import_module(module)
        for word in name.split("."):
            found = getattr(found, word)
        return found.function if isinstance(found, Stage) else found


@dataclass(frozen=True)
class Read:
    """An argument read from packs: one cell, or many in an array of leading `shape`.

    Cells are at `places` of the flattened shape; the other places are empty.
    """

    step: Step
    spots: tuple[Spot, ...]
    shape: tuple[int, ...] | None = None
    places: tuple[int, ...] = ()


@dataclass(frozen=True)
class Made:
    """An argument made by another stage in this process, or kept from before."""

    step: Step
    key: str
    recipe: Recipe


# A plain value is wrapped in a tuple.
Source = tuple[Any] | Read | Made


@dataclass(frozen=True)
class Recipe:
    """Arguments of a function, seed and name of `rng`, shape and flags of `there`."""

    sources: Mapping[str, Source]
    stream: tuple[int, dict[str, Any]] | None = None
    there: tuple[tuple[int, ...], bytes] | None = None


@dataclass(frozen=True)
class Call:
    """One call of a function, and the cells that it computes."""

    step: Step
    recipe: Recipe
    shape: tuple[int, ...]  # lengths of the axes that it computes together
    cells: tuple[tuple[str, int], ...]  # key of each wanted, and its place on these axes
    # Calls, by number of a cell, that compute it again, alone, to compare it.
    again: tuple[tuple[int, Call], ...] = ()


@dataclass(frozen=True)
class Done:
    """Outcome of a call: spots of its cells, in order, or why it failed."""

    seconds: float
    spots: tuple[Spot, ...] = ()
    reason: str = ""
    arguments: str = ""  # of a call that failed
    traceback: str = ""
    damaged: tuple[str, ...] = ()  # keys of lost inputs, without which it was not run
    # How cells differ, by number, when they are computed again; these have no spot.
    differing: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """Outcome of a task: its calls in order, and the packs that it wrote by stage."""

    calls: tuple[Done, ...]
    packs: tuple[tuple[str, Pack], ...]
    spilled: str = ""
    # Shapes met, by stage and output, of outputs that have the same in every cell.
    shapes: tuple[tuple[str, str, tuple[int, ...]], ...] = ()


class Damaged(Exception):
    """Inputs differ from what was written."""

    def __init__(self, keys: tuple[str, ...]) -> None:
        super().__init__("damaged")
        self.keys = keys


def run_calls(calls: tuple[Call, ...], folder: Path, spill: Path | None = None) -> Report:
    """Run calls one after the other, even if some raise, and pack their results.

    Packs are in `folder`; results go to `spill` when that is full or cannot be written to.
    """
    outcomes: list[tuple[Done, str, range]] = []  # with the rows of its cells among its stage's
    results: dict[str, list[tuple[str, Arrays]]] = defaultdict(list)
    shapes: set[tuple[str, str, tuple[int, ...]]] = set()
    inputs = Inputs([call.recipe for call in calls], folder)
    for number, call in enumerate(calls):
        start = time.perf_counter()
        cells: list[tuple[str, Arrays]] = []
        why: dict[str, Any] = {}
        given: dict[str, Any] = {}
        try:
            given = inputs.arguments(number, call.step)
            cells = _cells(call, call.step.call(**given))
        except Damaged as error:
            why = {"damaged": error.keys}
        except Exception as error:
            told = described(given | _named_stream(call))
            why = {"reason": reason(error), "arguments": told, "traceback": traceback_of(error)}
        seconds = time.perf_counter() - start
        differing = _differing(call, cells, folder) if cells and call.again else {}
        cells = [cell for number, cell in enumerate(cells) if number not in differing]
        done = Done(seconds, differing=differing, **why)
        for slot in call.step.outputs:
            if slot.even and cells:  # those of a call are of one array
                shapes.add((call.step.name, slot.name, cells[0][1][slot.name].shape))
        there = results[call.step.name]
        outcomes.append((done, call.step.name, range(len(there), len(there) + len(cells))))
        there += cells
    packs: dict[str, Pack] = {}
    spilled = ""
    for name, found in results.items():
        if not found:
            continue
        try:
            packs[name] = write_pack(folder, name, found)
        except OSError as error:
            if spill is None:
                raise
            spilled = f"{error.strerror or error}"
            pack = write_pack(spill, name, found)
            packs[name] = Pack(str(spill / pack.path), pack.size, pack.keys)
    finished = tuple(
        replace(
            done,
            spots=tuple(Spot(packs[name].path, row, packs[name].keys[row]) for row in rows),
        )
        for done, name, rows in outcomes
    )
    return Report(finished, tuple(packs.items()), spilled, tuple(sorted(shapes)))


def _named_stream(call: Call) -> dict[str, Any]:
    """Return `rng` by seed and name, from which it can be made again."""
    if call.recipe.stream is None:
        return {}
    seed, name = call.recipe.stream
    return {RNG: f"cell_rng({seed}, **{name})"}


def _cells(call: Call, found: Any) -> list[tuple[str, Arrays]]:
    """Return key and arrays of each wanted cell of a call's result."""
    arrays = arrays_of(call.step.name, call.step.outputs, found, call.shape)
    cells: list[tuple[str, Arrays]] = []
    for key, place in call.cells:
        at: Any = (*np.unravel_index(place, call.shape), ...)  # an array even for one value
        cells.append((key, {name: array[at].copy() for name, array in arrays.items()}))
    return cells


def _differing(call: Call, cells: Sequence[tuple[str, Arrays]], folder: Path) -> dict[int, str]:
    """Return how cells differ if they are computed again, each alone and from new objects."""
    differing: dict[int, str] = {}
    kept = dict(vars(_kept))
    for number, alone in call.again:
        vars(_kept).clear()
        try:
            found = alone.step.call(**Inputs([alone.recipe], folder).arguments(0, alone.step))
            [(_, again)] = _cells(alone, found)
            how = _difference(alone.step, cells[number][1], again)
        except Damaged:
            continue  # noticed by others who need it
        except Exception as error:
            how = f"it raises {reason(error)}"
        finally:
            vars(_kept).clear()
            vars(_kept).update(kept)
        if how:
            differing[number] = f"it differs when computed again, alone: {how}"
    return differing


def _difference(step: Step, first: Arrays, again: Arrays) -> str:
    """Return the first difference of two results, bit by bit; empty if there is none."""
    for name in (one.name for one in step.outputs if not one.measured):
        one, other = first[name], again[name]
        if one.shape != other.shape:
            return f"{name} has the shape {one.shape}, and then {other.shape}"
        for at in np.ndindex(one.shape) if one.tobytes() != other.tobytes() else ():
            if one[at].tobytes() != other[at].tobytes():
                where = f"{name}{list(at)}" if at else name
                return f"{where} is {one[at].item()!r}, and then {other[at].item()!r}"
    return ""


class Inputs:
    """Arguments of recipes, requested in order, whose cells are read for many at once.

    Opening a pack takes longer than reading a small cell in it. No two recipes share an array.
    """

    def __init__(self, recipes: Sequence[Recipe], folder: Path) -> None:
        self._recipes = recipes
        self._folder = folder
        self._ahead: dict[int, dict[Spot, Arrays | None]] = {}
        self._read = 0
        self._window = 1

    def arguments(self, number: int, step: Step) -> dict[str, Any]:
        """Return arguments of one of the recipes, by name; raise `Damaged` if any is unreadable."""
        if number >= self._read:
            self._read_ahead(number)
        return self._arguments(step, self._recipes[number])

    def _read_ahead(self, number: int) -> None:
        """Read cells of the next recipes; as many as fit, estimated from earlier ones."""
        self._ahead.clear()
        window = self._recipes[number : number + self._window]
        seen: set[str] = set()
        wanted = [
            (id(one), spot)
            for recipe in window
            for one in _with_those_made(recipe, seen)
            for spot in _spots(one)
        ]
        found = read_cells(self._folder, [spot for _, spot in wanted])
        for (owner, spot), arrays in zip(wanted, found, strict=True):
            self._ahead.setdefault(owner, {})[spot] = arrays
        size = sum(array.nbytes for arrays in found if arrays for array in arrays.values())
        fitting = AHEAD_BYTES * len(window) // max(size, 1)
        self._window = min(max(fitting, 1), 8 * self._window, AHEAD_RECIPES)
        self._read = number + len(window)

    def _arguments(self, step: Step, recipe: Recipe) -> dict[str, Any]:
        there = self._ahead.pop(id(recipe), {})
        wanted = _spots(recipe)
        if lacking := [spot for spot in wanted if spot not in there]:
            there |= zip(lacking, read_cells(self._folder, lacking), strict=True)
        if lost := tuple(spot.key for spot in wanted if there[spot] is None):
            raise Damaged(lost)
        spots = {spot: arrays for spot, arrays in there.items() if arrays is not None}
        arguments = {name: self._value(source, spots) for name, source in recipe.sources.items()}
        if step.drawn:
            assert recipe.stream is not None
            seed, name = recipe.stream
            arguments[RNG] = cell_rng(seed, **name)
        if step.asks:
            assert recipe.there is not None
            shape, flags = recipe.there
            arguments[THERE] = np.frombuffer(flags, dtype=bool).reshape(shape).copy()
        return arguments

    def _value(self, source: Source, spots: Mapping[Spot, Arrays]) -> Any:
        if isinstance(source, tuple):
            return source[0]
        if isinstance(source, Read):
            arrays = _joined(source, [spots[spot] for spot in source.spots])
            return arrays[source.step.outputs[0][0]] if len(arrays) == 1 else arrays
        # An object by key, made if missing; the oldest of its stage is evicted.
        objects = _kept_of(source.step)
        if source.key in objects:
            objects.move_to_end(source.key)
            return objects[source.key]
        while len(objects) >= source.step.keep:
            objects.popitem(last=False)
        made = source.step.call(**self._arguments(source.step, source.recipe))
        objects[source.key] = made
        return made


def _with_those_made(recipe: Recipe, seen: set[str]) -> Iterator[Recipe]:
    """Yield a recipe, and those of the objects to be made for it that were not seen yet."""
    yield recipe
    for source in recipe.sources.values():
        if isinstance(source, Made) and source.key not in seen:
            seen.add(source.key)
            if source.key not in _kept_of(source.step):
                yield from _with_those_made(source.recipe, seen)


def _spots(recipe: Recipe) -> list[Spot]:
    """Return spots of the cells that a recipe itself reads, each once."""
    wanted: dict[Spot, None] = {}
    for source in recipe.sources.values():
        if isinstance(source, Read):
            wanted.update(dict.fromkeys(source.spots))
    return list(wanted)


def _joined(source: Read, cells: Sequence[Arrays]) -> Arrays:
    """Return arrays of one cell, or of many as one; empty values where there is no cell."""
    if source.shape is None:
        return cells[0]
    total = int(np.prod(source.shape))
    whole: Arrays = {}
    for name, dtype, empty, *_ in source.step.outputs:
        shape = cells[0][name].shape
        if any(cell[name].shape != shape for cell in cells):
            raise ValueError(f"{name} of {source.step.name} has a shape that differs between cells")
        joined = np.empty((total, *shape), dtype=dtype)
        if len(cells) < total:
            joined[...] = empty
        joined[list(source.places)] = [cell[name] for cell in cells]
        whole[name] = joined.reshape(*source.shape, *shape)
    return whole


_kept = threading.local()


def _kept_of(step: Step) -> OrderedDict[str, Any]:
    """Return objects made in this thread, the last few of a stage, by key."""
    # By the function's name: stages that share one share its results. A function that comes with
    # each task, from a script or a session, is another object each time.
    function: Any = step.function
    if not isinstance(function, tuple):
        function = function.__module__, function.__qualname__
    found: OrderedDict[str, Any] = vars(_kept).setdefault(".".join(function), OrderedDict())
    return found


def forget_all() -> None:
    """Drop all objects kept in this thread."""
    vars(_kept).clear()
