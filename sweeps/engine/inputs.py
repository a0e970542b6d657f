"""Arguments of stages on a worker: read from packs, or made in memory.

Inputs come by recipe: a plain value, arrays from a pack, a stack of such arrays, or an object made
by another stage in this process, which keeps the last few of each.
"""

from __future__ import annotations

import importlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.results import read_cells
from sweeps.engine.seeds import cell_rng
from sweeps.engine.stage import RNG, THERE, Stage

Arrays = dict[str, NDArray[Any]]
Spot = tuple[str, int]  # a cell on disk: its pack and its row in there

AHEAD_BYTES = 2**25  # of inputs that are read at once
AHEAD_RECIPES = 512


@dataclass(frozen=True)
class Step:
    """What a worker must know of a stage.

    Attributes
    ----------
    name : str
        Of the stage.
    function : tuple of str, or callable
        Module and qualified name of the function, or itself where it is in no module.
    outputs : tuple of (str, str, float)
        Name, type and empty value of each output.
    keep : int
        How many results are kept in memory, of one that is not kept on disk.
    drawn : bool
        Whether it takes `rng`.
    asks : bool
        Whether it takes `there`.
    """

    name: str
    function: Any
    outputs: tuple[tuple[str, str, float], ...]
    keep: int
    drawn: bool
    asks: bool

    @classmethod
    def of(cls, stage: Stage) -> Step:
        """What is to know of a stage."""
        function: Any = stage.function
        module, name = function.__module__, function.__qualname__
        if module != "__main__" and "<" not in name:
            function = module, name
        outputs = tuple((one.name, one.dtype, one.empty) for one in stage.outputs)
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
class Value:
    """An argument that is a plain value."""

    value: Any


@dataclass(frozen=True)
class Read:
    """An argument that is read from a pack."""

    step: Step
    key: str
    spot: Spot


@dataclass(frozen=True)
class Stack:
    """An argument of many cells in one array; places without a cell are empty."""

    step: Step
    shape: tuple[int, ...]
    places: tuple[int, ...]
    keys: tuple[str, ...]
    spots: tuple[Spot, ...]


@dataclass(frozen=True)
class Made:
    """An argument made by another stage in this process, or kept from before."""

    step: Step
    key: str
    recipe: Recipe


Source = Value | Read | Stack | Made


@dataclass(frozen=True)
class Recipe:
    """Arguments of a function.

    Attributes
    ----------
    sources : mapping of str to Source
        All but `rng` and `there`.
    stream : (int, mapping) or None
        Seed and name of the noise.
    there : (shape, flags) or None
        What `there` is.
    """

    sources: Mapping[str, Source]
    stream: tuple[int, dict[str, Any]] | None = None
    there: tuple[tuple[int, ...], bytes] | None = None


class Damaged(Exception):
    """Inputs that are not what was written."""

    def __init__(self, keys: tuple[str, ...]) -> None:
        super().__init__("damaged")
        self.keys = keys


class Inputs:
    """Arguments of recipes, whose cells are read for many recipes at once.

    To open a pack takes longer than to read a small cell in it. No two recipes share an array.

    Parameters
    ----------
    recipes : sequence of Recipe
        In the order in which their arguments are asked for.
    folder : Path
        Where packs are.
    """

    def __init__(self, recipes: Sequence[Recipe], folder: Path) -> None:
        self._recipes = recipes
        self._folder = folder
        self._ahead: dict[int, dict[Spot, Arrays | None]] = {}
        self._read = 0
        self._window = 1

    def arguments(self, number: int, step: Step) -> dict[str, Any]:
        """Arguments of one of the recipes, by name.

        Raises
        ------
        Damaged
            If cells cannot be read back.
        """
        recipe = self._recipes[number]
        if number >= self._read:
            self._read_ahead(number)
        return self._arguments(step, recipe, self._ahead.pop(id(recipe), {}))

    def _read_ahead(self, number: int) -> None:
        """Cells of the next recipes; as many as fit, going by those before."""
        self._ahead.clear()
        window = self._recipes[number : number + self._window]
        wanted: list[tuple[int, Spot]] = []
        seen: set[str] = set()
        for recipe in window:
            for one in _with_those_made(recipe, seen):
                wanted += [(id(one), spot) for spot in _spots(one)]
        found = read_cells(self._folder, [spot for _, spot in wanted])
        for (owner, spot), arrays in zip(wanted, found, strict=True):
            self._ahead.setdefault(owner, {})[spot] = arrays
        size = sum(array.nbytes for arrays in found if arrays for array in arrays.values())
        fitting = AHEAD_BYTES * len(window) // max(size, 1)
        self._window = min(max(fitting, 1), 8 * self._window, AHEAD_RECIPES)
        self._read = number + len(window)

    def _arguments(
        self, step: Step, recipe: Recipe, there: dict[Spot, Arrays | None]
    ) -> dict[str, Any]:
        wanted = _spots(recipe)
        if lacking := [spot for spot in wanted if spot not in there]:
            there |= zip(lacking, read_cells(self._folder, lacking), strict=True)
        if lost := tuple(key for spot, key in wanted.items() if there[spot] is None):
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
        match source:
            case Value():
                return source.value
            case Read():
                return _plain(source.step, spots[source.spot])
            case Stack():
                return _stacked(source, spots)
            case Made():
                return self._made(source)

    def _made(self, source: Made) -> Any:
        """An object by key, made when it is not there; the oldest of its stage makes room."""
        objects = _kept_of(source.step)
        if source.key in objects:
            objects.move_to_end(source.key)
            return objects[source.key]
        while len(objects) >= source.step.keep:
            objects.popitem(last=False)
        recipe = source.recipe
        arguments = self._arguments(source.step, recipe, self._ahead.pop(id(recipe), {}))
        made = source.step.call(**arguments)
        objects[source.key] = made
        return made


def _with_those_made(recipe: Recipe, seen: set[str]) -> Iterator[Recipe]:
    """A recipe, and those of the objects that are to be made for it and were not seen yet."""
    yield recipe
    for source in recipe.sources.values():
        if isinstance(source, Made) and source.key not in seen:
            seen.add(source.key)
            if source.key not in _kept_of(source.step):
                yield from _with_those_made(source.recipe, seen)


def _spots(recipe: Recipe) -> dict[Spot, str]:
    """Keys of the cells that a recipe reads itself, by their spots."""
    wanted: dict[Spot, str] = {}
    for source in recipe.sources.values():
        if isinstance(source, Read):
            wanted[source.spot] = source.key
        elif isinstance(source, Stack):
            wanted.update(zip(source.spots, source.keys, strict=True))
    return wanted


def _plain(step: Step, arrays: Arrays) -> Any:
    """The array of a stage that gives one, all of them by name of others."""
    return arrays[step.outputs[0][0]] if len(step.outputs) == 1 else arrays


def _stacked(source: Stack, spots: Mapping[Spot, Arrays]) -> Any:
    """Arrays of many cells as one; empty where there is no cell."""
    total = int(np.prod(source.shape))
    whole: Arrays = {}
    for name, dtype, empty in source.step.outputs:
        cells = [spots[spot][name] for spot in source.spots]
        shape = cells[0].shape
        if any(cell.shape != shape for cell in cells):
            raise ValueError(f"{name} of {source.step.name} has a shape that differs between cells")
        if len(cells) == total:
            stacked = np.empty((total, *shape), dtype=dtype)
        else:
            stacked = np.full((total, *shape), empty, dtype=dtype)
        stacked[list(source.places)] = cells
        whole[name] = stacked.reshape(*source.shape, *shape)
    return _plain(source.step, whole)


class _Kept(threading.local):
    """Objects made in this thread, the last few of each stage, by key."""

    def __init__(self) -> None:
        self.by_function: dict[str, OrderedDict[str, Any]] = {}


_kept = _Kept()


def _kept_of(step: Step) -> OrderedDict[str, Any]:
    # By the function: stages that share one share its results.
    return _kept.by_function.setdefault(str(step.function), OrderedDict())


def forget_all() -> None:
    """Drop all objects kept in this thread."""
    _kept.by_function.clear()
