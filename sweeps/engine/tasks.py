"""Tasks of a worker: calls of stages, whose inputs it reads or makes, and whose results it packs.

A task is a batch of calls. A call computes one cell, or several along the axes that its stage
computes together. Inputs come by recipe: a plain value, arrays from a pack, a stack of such arrays,
or an object made by another stage in this process, which keeps the last few of each.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict, defaultdict, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sweeps.engine.declarations import RNG, VALID
from sweeps.engine.errors import DeclarationError
from sweeps.engine.failures import described, reason, traceback_of
from sweeps.engine.packs import Arrays, Pack, Spot, read_cells, write_pack
from sweeps.engine.seeds import cell_rng
from sweeps.engine.stage import MEASURED, Output, Stage

AHEAD_BYTES = 2**25  # of inputs that are read at once
AHEAD_CALLS = 512


@dataclass(frozen=True)
class Step:
    """Description of a stage for workers."""

    name: str
    place: str  # module and qualified name of its function
    function: Callable[..., Any] | None  # itself, if workers cannot import it
    outputs: tuple[Output, ...]
    even: tuple[str, ...]  # of these, names of those whose shape is the same in all cells
    keep: int  # number of results in memory, of a stage not kept on disk

    @classmethod
    @cache
    def of(cls, stage: Stage) -> Step:
        """Return the description of a stage."""
        function = stage.function
        place = f"{function.__module__}:{function.__qualname__}"
        imported = "<" not in place and not place.startswith("__main__:")
        given = None if imported else function
        even = tuple(one.name for one in stage.outputs if stage.place_of(one) and one.even)
        return cls(stage.name, place, given, stage.outputs, even, stage.memory)

    @property
    def call(self) -> Callable[..., Any]:
        """The function."""
        found: Any = self.function or resolve_name(self.place)
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
class Recipe:
    """A function and its arguments, with seed and name of `rng` and the flags of `valid`.

    An object that is kept in memory has a key.
    """

    step: Step
    sources: Mapping[str, Source]
    stream: tuple[int, dict[str, Any]] | None = None
    valid: NDArray[np.bool_] | None = None
    key: str = ""


Source = tuple[Any] | Read | Recipe
"""A plain value in a tuple, cells to be read, or an object made or kept in this process."""


class Call(NamedTuple):
    """One call of a function, and the cells that it computes."""

    recipe: Recipe
    shape: tuple[int, ...]  # lengths of the axes that it computes together
    cells: tuple[tuple[str, int], ...]  # key of each wanted, and its place on these axes
    # Calls, by number of a cell, that compute it again, alone, to compare it.
    again: tuple[tuple[int, Call], ...] = ()


class Done(NamedTuple):
    """Outcome of a call: the spot of each of its cells, or why that failed."""

    seconds: float
    cells: tuple[Spot | str, ...] = ()
    arguments: str = ""  # of a call that failed
    traceback: str = ""
    damaged: tuple[str, ...] = ()  # keys of lost inputs, without which it was not run


class Report(NamedTuple):
    """Outcome of a task: its calls in order, and the packs that it wrote."""

    calls: tuple[Done, ...]
    packs: tuple[Pack, ...] = ()
    unwritten: OSError | None = None  # why results could not be packed, if so
    # Shapes met, by stage and output, of outputs that have the same in every cell.
    shapes: tuple[tuple[str, str, tuple[int, ...]], ...] = ()


class Damaged(Exception):
    """Inputs differ from what was written."""

    def __init__(self, keys: tuple[str, ...]) -> None:
        super().__init__("damaged")
        self.keys = keys


Cell = tuple[str, Arrays]  # its key, and its results


def run_calls(calls: tuple[Call, ...], folder: Path) -> Report:
    """Run calls one after the other, even if some raise, and pack their results in a folder."""
    outcomes = [_run(call, inputs, folder) for call, inputs in _with_inputs(calls, folder)]
    results: dict[str, list[Cell]] = defaultdict(list)
    spent: dict[str, float] = defaultdict(float)  # s, by stage
    shapes: set[tuple[str, str, tuple[int, ...]]] = set()
    for call, (done, cells) in zip(calls, outcomes, strict=True):
        step = call.recipe.step
        results[step.name] += cells
        spent[step.name] += done.seconds
        for output in step.even if cells else ():  # those of a call are of one array
            shapes.add((step.name, output, cells[0][1][output].shape))
    packs: dict[str, Pack] = {}
    spots: dict[str, Iterator[Spot]] = {}
    for name, written in results.items():
        if not written:
            continue
        try:
            packs[name] = pack = write_pack(folder, name, written, spent[name])
        except OSError as error:
            return Report((), unwritten=error)
        spots[name] = iter([Spot(pack.path, row, key) for row, key in enumerate(pack.keys)])
    finished = []
    for call, (done, _) in zip(calls, outcomes, strict=True):
        name = call.recipe.step.name
        found = tuple(why or next(spots[name]) for why in done.cells)
        finished.append(done._replace(cells=found))
    return Report(tuple(finished), tuple(packs.values()), shapes=tuple(sorted(shapes)))


def uneven(
    stage: str, output: str, shape: tuple[int, ...], other: tuple[int, ...]
) -> DeclarationError:
    """Return the error of arrays of two shapes, which a store cannot hold without padding."""
    return DeclarationError(
        f"stage {stage}: {output} has the shape {shape} in one cell and {other} in another, but no "
        "value to pad it with; declare pad=... or origin=..."
    )


def _run(call: Call, inputs: Inputs, folder: Path) -> tuple[Done, list[Cell]]:
    """Return the outcome of a call, with empty texts instead of spots, and its finished cells."""
    start = time.perf_counter()
    given: dict[str, Any] = {}
    try:
        given = _arguments(call.recipe, inputs, folder)
        cells = _computed(call, given)
    except Damaged as error:
        return Done(0.0, damaged=error.keys), []
    except Exception as error:
        if call.recipe.stream is not None:  # from which the generator can be made again
            seed, name = call.recipe.stream
            given[RNG] = f"cell_rng({seed}, **{name})"
        why = (reason(error),) * len(call.cells)
        return Done(0.0, why, described(given), traceback_of(error)), []
    seconds = time.perf_counter() - start
    differing = dict(_differing(call, cells, folder))
    whole = [cell for number, cell in enumerate(cells) if number not in differing]
    return Done(seconds, tuple(differing.get(k, "") for k in range(len(cells)))), whole


def _computed(call: Call, arguments: Mapping[str, Any]) -> list[Cell]:
    """Return each wanted cell of a call's result."""
    step = call.recipe.step
    arrays = arrays_of(step.name, step.outputs, step.call(**arguments), call.shape)
    cells: list[Cell] = []
    for key, place in call.cells:
        at: Any = (*np.unravel_index(place, call.shape), ...)  # an array even for one value
        cells.append((key, {name: array[at].copy() for name, array in arrays.items()}))
    return cells


def _differing(call: Call, cells: Sequence[Cell], folder: Path) -> Iterator[tuple[int, str]]:
    """Yield how cells differ if they are computed again, each alone and from new objects."""
    for number, alone in call.again:
        forget_all()
        [inputs] = _read([alone.recipe], folder)
        done, again = _run(alone, inputs, folder)
        forget_all()
        if done.damaged:
            continue  # noticed by others who need it
        how = f"it raises {done.cells[0]}"
        if again:
            how = _difference(alone.recipe.step, cells[number][1], again[0][1])
        if how:
            yield number, f"it differs when computed again, alone: {how}"


def _difference(step: Step, first: Arrays, again: Arrays) -> str:
    """Return the first difference of two results, bit by bit; empty if there is none."""
    for name in (output.name for output in step.outputs if output.role != MEASURED):
        one, other = first[name], again[name]
        if one.shape != other.shape:
            return f"{name} has the shape {one.shape}, and then {other.shape}"
        for at in np.ndindex(one.shape) if one.tobytes() != other.tobytes() else ():
            if one[at].tobytes() != other[at].tobytes():
                where = f"{name}{list(at)}" if at else name
                return f"{where} is {one[at].item()!r}, and then {other[at].item()!r}"
    return ""


# arguments --------------------------------------------------------------------------------------

Inputs = deque[Any]
"""Arrays of each cell that a recipe reads, in order; None where they cannot be read back."""


def _with_inputs(calls: Sequence[Call], folder: Path) -> Iterator[tuple[Call, Inputs]]:
    """Yield calls with what they read, for as many at once as fit, estimated from earlier ones.

    Opening a pack takes longer than reading a small cell in it.
    """
    start, window = 0, 1
    while start < len(calls):
        part = calls[start : start + window]
        found = _read([call.recipe for call in part], folder)
        cells = (arrays for inputs in found for arrays in inputs if arrays)
        size = sum(array.nbytes for arrays in cells for array in arrays.values())
        fitting = AHEAD_BYTES * len(part) // max(size, 1)
        start, window = start + len(part), min(max(fitting, 1), 8 * window, AHEAD_CALLS)
        yield from zip(part, found, strict=True)


def _read(recipes: Sequence[Recipe], folder: Path) -> list[Inputs]:
    """Return what each recipe itself reads; no two share an array."""
    wanted = [_spots(recipe) for recipe in recipes]
    cells = deque(read_cells(folder, [spot for spots in wanted for spot in spots]))
    return [deque(cells.popleft() for _ in spots) for spots in wanted]


def _spots(recipe: Recipe) -> list[Spot]:
    reads = (source for source in recipe.sources.values() if isinstance(source, Read))
    return [spot for read in reads for spot in read.spots]


def _arguments(recipe: Recipe, inputs: Inputs, folder: Path) -> dict[str, Any]:
    """Return arguments by name, and empty the inputs; raise `Damaged` if one is unreadable."""
    spots = _spots(recipe)
    if lost := [spot.key for spot, cell in zip(spots, inputs, strict=True) if cell is None]:
        raise Damaged(tuple(lost))
    given: dict[str, Any] = {}
    for name, source in recipe.sources.items():
        if isinstance(source, tuple):
            given[name] = source[0]
        elif isinstance(source, Recipe):
            given[name] = _object(source, folder)
        else:
            arrays = _joined(source, [inputs.popleft() for _ in source.spots])
            given[name] = arrays[source.step.outputs[0].name] if len(arrays) == 1 else arrays
    if recipe.stream is not None:
        seed, cell = recipe.stream
        given[RNG] = cell_rng(seed, **cell)
    if recipe.valid is not None:
        given[VALID] = recipe.valid.copy()
    return given


def _object(recipe: Recipe, folder: Path) -> Any:
    """Return an object by its key, made if missing; the oldest of its stage is evicted."""
    # By the function's name: stages that share one share its results. A function that comes with
    # each task, from a script or a session, is another object each time.
    objects = vars(_kept).setdefault(recipe.step.place, OrderedDict())
    if recipe.key in objects:
        objects.move_to_end(recipe.key)
        return objects[recipe.key]
    while len(objects) >= recipe.step.keep:
        objects.popitem(last=False)
    [inputs] = _read([recipe], folder)
    objects[recipe.key] = made = recipe.step.call(**_arguments(recipe, inputs, folder))
    return made


def _joined(source: Read, cells: Sequence[Arrays]) -> Arrays:
    """Return arrays of one cell, or of many as one; empty values where there is no cell."""
    if source.shape is None:
        return cells[0]
    total = int(np.prod(source.shape))
    whole: Arrays = {}
    for output in source.step.outputs:
        name, shape = output.name, cells[0][output.name].shape
        if any(cell[name].shape != shape for cell in cells):
            raise ValueError(f"{name} of {source.step.name} has a shape that differs between cells")
        joined = np.empty((total, *shape), dtype=output.dtype)
        if len(cells) < total:
            joined[...] = output.empty
        joined[list(source.places)] = [cell[name] for cell in cells]
        whole[name] = joined.reshape(*source.shape, *shape)
    return whole


_kept = threading.local()


def forget_all() -> None:
    """Drop all objects kept in this thread."""
    vars(_kept).clear()


# results of a call --------------------------------------------------------------------------------


# Kinds of dtypes (see numpy) that may become another, if every value is the same in it.
CAST = {"f": "biuf", "i": "biuf", "u": "biuf", "b": "biuf", "c": "biufc"}

_dtype = cache(np.dtype)


@cache
def _largest(dtype: str) -> float:
    return float(np.finfo(dtype).max)


def arrays_of(stage: str, outputs: Sequence[Output], found: Any, along: tuple[int, ...]) -> Arrays:
    """Return the arrays of a result by output, of the declared dtypes.

    `along` are the lengths of the leading axes, along which values are computed together.

    Raises
    ------
    TypeError
        If an output is missing, has another shape, or would lose something in its dtype. One
        sentence with stage, output, what was returned, and what is allowed.
    """
    names = [output.name for output in outputs]
    if not isinstance(found, Mapping) and len(names) == 1:
        found = {names[0]: found}
    given = list(found) if isinstance(found, Mapping) else [type(found).__name__]
    if set(given) != set(names):
        raise TypeError(
            f"{stage} returned {', '.join(map(str, given))}, but must return {', '.join(names)}"
        )
    return {output.name: _array(stage, output, found[output.name], along) for output in outputs}


def _array(stage: str, output: Output, given: Any, along: tuple[int, ...]) -> NDArray[Any]:
    """Return one output as an array."""
    dtype = _dtype(output.dtype)
    if isinstance(given, float) and dtype.kind == "f" and abs(given) <= _largest(output.dtype):
        array = np.array(given, dtype)  # what follows takes 10 us, which counts for single numbers
    elif given is None:
        raise _refused(stage, output, "None")
    else:
        try:
            array = np.asarray(given)
        except ValueError:
            raise _refused(stage, output, "rows of different lengths", "an array") from None
        if array.dtype != dtype:
            array = _cast(stage, output, array, dtype)
    if array.shape[: len(along)] != along or array.ndim != len(along) + len(output.dims):
        leading = f"{along}, the numbers of values computed together, and " if along else ""
        allowed = f"one of {leading}{len(output.dims)} dimensions of its own"
        raise _refused(stage, output, f"an array of shape {array.shape}", allowed)
    return array


def _cast(stage: str, output: Output, array: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return an array in another dtype; digits of floats may go, and nothing else."""
    texts = dtype.kind in "SU" and all(isinstance(value, str | bytes) for value in array.flat)
    if not texts and array.dtype.kind not in CAST.get(dtype.kind, dtype.kind) and array.size:
        odd = next(
            (value for value in array.flat if value is None), f"values of dtype {array.dtype}"
        )
        raise _refused(stage, output, str(odd))
    with np.errstate(all="ignore"):
        cast = array.astype(dtype)
        if dtype.kind in "fc":
            lost = np.isinf(cast) & np.isfinite(array)
        else:
            lost = cast.astype(array.dtype) != array
    if dtype.kind in "iu" and array.dtype.kind in "iu":
        lost |= (cast < 0) != (array < 0)  # they may wrap there and back
    if lost.any():
        raise _refused(stage, output, repr(array[lost].flat[0].item()))
    return cast


def _refused(stage: str, output: Output, given: str, allowed: str = "") -> TypeError:
    allowed = allowed or f"values that the dtype {output.dtype} holds"
    return TypeError(f"{stage} returned {given} as {output.name}, but must return {allowed}")
