"""Stages and experiments: plain functions whose argument names declare their inputs.

A decorator declares a stage, which remains a plain function:

    @stage(Output("period", unit="s", label="period"), uses=(Spring, Mass))
    def period(stiffness, mass):
        return 2 * math.pi * math.sqrt(mass / stiffness)

Each argument is a setting, the result of another stage, `rng` or `valid`. The dependencies of a
result, and so its cells, key, dimensions and progress line, follow from these names.
"""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property, partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sweeps.engine.declare.display import Display
from sweeps.engine.declare.errors import DeclarationError, locate
from sweeps.engine.declare.kinds import Identified, Value
from sweeps.engine.declare.settings import (
    COORDINATE,
    DIMENSION,
    ENGINE_SETTINGS,
    Choices,
    Run,
    Setting,
    Settings,
    ZippedAxis,
)
from sweeps.engine.declare.storable import is_storable

if TYPE_CHECKING:
    import xarray as xr

Condition = Callable[[Choices], bool]
Say = Callable[[str], None]

RNG, VALID = "rng", "valid"  # arguments that are neither settings nor stages
STATUS = "status"  # group of the states of cells
FIRST_PREFIX = "first_"  # before the name of a dimension: the output at which arrays begin on it


def always(choices: Choices) -> bool:
    """Return True: the stage belongs to every configuration."""
    return True


RESULT, INNER, STATE, MEASURED, SHARE = "result", "inner", "state", "measured", "share"


@dataclass(frozen=True)
class Output:
    """Array that a stage returns for every cell, a variable of the store.

    `dims` are the dimensions within a cell. A dimension named after a gathered setting takes the
    values of the setting as coordinate. If the stage also returns an integer `first_row`, the array
    of a cell begins at that index of the dimension `row`, which takes the label and unit of
    `first_row`.
    """

    name: str
    dims: tuple[str, ...] = ()
    dtype: str = "f4"
    label: str = ""
    unit: str = "1"
    pad: complex | str | None = None  # up to the largest cell's array; None: all have one shape
    without: tuple[str, ...] = ()  # settings of its stage that it does not depend on
    # RESULT; COORDINATE of its group; INNER: an input of other stages, not stored; STATE of the
    # cells that a group gathers; MEASURED by the machine, such as a run time: differs between runs;
    # SHARE: a fraction from 0 to 1 as an unsigned integer, whose largest value means 1.
    role: str = RESULT
    attrs: Mapping[str, Any] = field(default_factory=dict, hash=False)  # besides unit and label

    @property
    def is_stored(self) -> bool:
        """Whether it is a variable of the store, if its stage has a group."""
        return self.role != INNER

    @property
    def identity(self) -> tuple[Any, ...]:
        """Its part of the keys of results."""
        return self.name, self.dtype, repr(self.fill_value)

    @property
    def fill_value(self) -> complex | str:
        """Value of missing results: NaN, NaT, no text, false, unsigned 0, else `pad` or -1."""
        of_kind: dict[str, complex | str] = {"f": np.nan, "U": "", "b": False, "u": 0, "M": "NaT"}
        of_kind["c"] = complex(np.nan, np.nan)
        integer_fill = -1 if self.pad is None else self.pad
        return of_kind.get(np.dtype(self.dtype).kind, integer_fill)

    @property
    def store_dtype(self) -> tuple[np.dtype[Any], complex | str]:
        """Dtype and fill value in the store; shares become signed, so that -1 means missing."""
        dtype = np.dtype(self.dtype)
        if self.role != SHARE:
            return dtype, self.fill_value
        return np.dtype(f"i{2 * dtype.itemsize}"), -1


coordinate = partial(Output, role=COORDINATE)
inner = partial(Output, role=INNER)


@dataclass(frozen=True)
class Status:
    """State of the cells of a group, a variable of `status`; -1 missing, 0 failed, 1 done.

    With axes `over`, it combines the cells of all stages of the groups that have it: failed if any
    failed, else missing if any is missing. Without axes, stages return it as an output.
    """

    name: str
    label: str = ""
    over: tuple[Setting, ...] = ()


@dataclass(frozen=True, eq=False)
class Group:
    """A group of the store, and the defaults of its stages."""

    path: str
    when: Condition = always  # whether a configuration has it at all
    uses: tuple[type[Settings], ...] = ()  # of stages without `uses`
    dims: tuple[str, ...] = ()  # their order; unnamed dimensions come first
    status: Status | None = None  # None: every stage has a status of its own
    names: Mapping[Setting, str] = field(default_factory=dict)  # of dimensions, in it

    def stage(self, *outputs: Output, **options: Any) -> StageDecorator:
        """Declare a function as a stage of the group; see `Stage`."""
        return stage(*outputs, **{"group": self, "uses": self.uses, **options})

    def table(self, name: str, make: Callable[..., xr.Dataset | None], *displays: Display) -> Table:
        """Return a table of the group; see `Table`."""
        return Table(f"tables/{name}", (self.path,), make, self.when, displays)


UNSTORED = Group("")


@dataclass(frozen=True, eq=False)
class At:
    """Input from another stage, read at substituted values of its settings.

    `settings` maps each such setting to the setting whose value replaces it, for example to train
    at one range for all cells. Settings zipped with it take their values at the same point. With
    `in_blocks`, gathered arrays are read when they are indexed (`GatheredArray`), not beforehand.
    """

    stage: str
    settings: Mapping[Setting, Setting] = field(default_factory=dict)
    in_blocks: bool = False


@dataclass(frozen=True)
class Stream:
    """Settings whose values key a stream of random numbers, besides `seed` and a name.

    Cells that differ only in other settings share their noise.
    """

    settings: tuple[Setting, ...]
    name: str = ""  # by default the stage's
    optional: tuple[Setting, ...] = ()  # do not count where their value is 0 or false


class Mode(Enum):
    """When a stage is called, and where its results are kept."""

    CACHED = "cached"  # arrays, on disk
    IN_MEMORY = "in memory"  # any objects, of which each worker keeps the last few
    # Called while planning: a quick function of settings. Its result, a number, a text or a tuple
    # of them, enters keys by its value, not by its inputs.
    DERIVED = "derived"


@dataclass(frozen=True, eq=False)
class Stage:
    """A function with its inputs and outputs; declared by `stage`, `derived` or `in_memory`.

    A stage with one output returns an array, a stage with several a mapping of arrays.
    """

    name: str  # of the function, unless another is given
    function: Callable[..., Any]
    outputs: tuple[Output, ...]
    uses: tuple[type[Settings], ...] = ()  # where arguments are looked up; then among the stages
    reads: dict[str, Any] = field(default_factory=dict)  # argument: setting, name of a stage, `At`
    # Axes that one call computes together: the function gets a tuple of the missing values, and
    # returns arrays with these axes first. A result must not depend on the other values.
    along: tuple[Setting, ...] = ()
    # Axes that each call gathers: the function gets a tuple of all values, and inputs that have
    # these axes after the axes of `along`. Failed inputs hold fill values; `valid` flags the rest.
    gather: tuple[Setting, ...] = ()
    stream: Stream | None = None  # of `rng`; None: keyed by all dependencies
    group: Group = UNSTORED  # of the store; by default its results only serve other stages
    mode: Mode = Mode.CACHED
    keep: int = 0  # results of a stage in memory that a worker keeps
    version: str = ""  # counts in keys instead of the function's code, if it is given

    def __post_init__(self) -> None:
        tuples = {"uses": self.uses, "along": self.along, "gather": self.gather}
        tuples |= {f"dims of {output.name}": output.dims for output in self.outputs}
        tuples |= {"settings of its stream": self.stream.settings} if self.stream else {}
        for description, value in tuples.items():
            if not isinstance(value, tuple | list):
                name = getattr(value, "key", value)
                problem = (
                    f"stage {self.name} has {name!r} as {description}, but must have a tuple, "
                )
                raise DeclarationError(locate(self.function, f"{problem}with a comma: (NAME,)"))
        for output in self.outputs:
            if not isinstance(output.unit, str):
                problem = (
                    f"stage {self.name}: {output.name} has unit={output.unit!r}, "
                    "but must have a text"
                )
                raise DeclarationError(locate(self.function, problem))

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """Names of the arguments that a sweep passes; others keep their default.

        They have no default, or `reads` or `uses` has their name. A function with `**values` also
        takes every name in `reads`.
        """
        parameters = inspect.signature(self.function).parameters.values()
        takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters)
        names = tuple(
            parameter.name
            for parameter in parameters
            if parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
            and (
                parameter.default is parameter.empty
                or parameter.name in self.reads
                or any(hasattr(group, parameter.name) for group in self.uses)
            )
        )
        return names + tuple(name for name in self.reads if takes_any and name not in names)

    def origin(self, output: Output) -> dict[str, Output]:
        """Return, by dimension, the output with the index at which arrays of `output` begin."""
        firsts = {first.name: first for first in self.outputs if not first.dims}
        origins = {dim: firsts.get(f"{FIRST_PREFIX}{dim}") for dim in output.dims}
        return {dim: first for dim, first in origins.items() if first is not None}

    def has_fixed_shape(self, output: Output) -> bool:
        """Return whether arrays must have one shape in all cells."""
        padded = output.pad is not None or self.origin(output)
        return output.is_stored and bool(output.dims) and not padded

    @property
    def substitutions(self) -> dict[Setting, Setting]:
        """Return the replacement of each setting that inputs read at another setting's value."""
        mappings = (read.settings for read in self.reads.values() if isinstance(read, At))
        return {
            target: replacement for settings in mappings for target, replacement in settings.items()
        }

    def stored_as(self, output: Output) -> tuple[str, str]:
        """Return group and name of an output in the store; the group is empty if not stored."""
        status = self.group.status
        if output.role == STATE and status is not None:
            return STATUS, output.name if status.over else status.name
        return self.group.path if output.is_stored else "", output.name

    @property
    def is_cached(self) -> bool:
        """Whether results are cached on disk."""
        return self.mode is Mode.CACHED

    @property
    def is_derived(self) -> bool:
        """Whether it is called while planning."""
        return self.mode is Mode.DERIVED

    def check_value(self, value: Value) -> Value:
        """Return the result of a derived stage; raise DeclarationError if it cannot be in a key."""
        for element in value if isinstance(value, tuple) else (value,):
            if isinstance(element, tuple):
                self.check_value(element)
            elif type(element).__repr__ is object.__repr__ and not isinstance(element, Identified):
                raise DeclarationError(
                    f"stage {self.name} returned {type(element).__name__!r}, but a derived stage "
                    "must return a number, text, null, a tuple of them, or a value with an identity"
                )
        return value

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the function."""
        return self.function(*arguments, **named)


StageDecorator = Callable[[Callable[..., Any]], Stage]


def stage(*outputs: Output, name: str = "", **options: Any) -> StageDecorator:
    """Declare a function as a stage with some outputs; other arguments as of `Stage`."""
    return lambda function: Stage(name or function.__name__, function, outputs, **options)


def derived(**options: Any) -> StageDecorator:
    """Declare a quick function of settings, whose result counts as a value; see `Stage`."""
    return stage(mode=Mode.DERIVED, **options)


def in_memory(*, keep: int = 2, **options: Any) -> StageDecorator:
    """Declare a function whose last `keep` results stay in memory only; see `Stage`."""
    return stage(mode=Mode.IN_MEMORY, keep=keep, **options)


@dataclass(frozen=True)
class Table:
    """A group of the store computed at the end from other groups, all of which must exist."""

    group: str
    of: tuple[str, ...]
    # (data set of each group, ..., choices) -> data set, or None if it is empty
    make: Callable[..., xr.Dataset | None]
    when: Condition = always
    displays: tuple[Display, ...] = ()  # tables that show it; by default one of all variables


@dataclass(frozen=True)
class Experiment:
    """Declaration of an experiment: settings, or groups of them, stages and tables.

    Progress lists stages, and tables are computed, in the order in which they stand here. Raises
    `DeclarationError` if declarations do not fit each other.
    """

    name: str  # of the command, and of its distribution
    title: str  # of its stores
    parts: tuple[type[Settings] | Setting | Stage | Table, ...]  # each kind in its order
    # Refuses inconsistent choices (`ConfigurationError`), and drops values that
    # nothing uses.
    check: Callable[[Choices], Choices] = lambda choices: choices
    attributes: Callable[[Choices], Mapping[str, Any]] = lambda choices: {}  # of its stores
    # Returns functions that run once each, on any worker of this machine, before the first cell;
    # prints a sentence on them by `say`.
    prepare: Callable[[Choices, Say], Sequence[Callable[[], object]]] = lambda choices, say: ()
    conf: Path | None = None  # folder of its Hydra configuration
    # Folders of other packages with more files of its groups, such as `experiment/mine.yaml`.
    added_conf: tuple[Path, ...] = ()
    code: tuple[str, ...] = ()  # packages whose code counts in the keys of results

    def __post_init__(self) -> None:
        for mistake in find_mistakes(self):
            raise DeclarationError(mistake)

    @cached_property
    def declared(self) -> tuple[Setting, ...]:
        """Every setting, including the engine's."""
        engine = (setting for group in ENGINE_SETTINGS for setting in group.declared)
        return (*self.experiment_settings, *engine)

    @cached_property
    def experiment_settings(self) -> tuple[Setting, ...]:
        """Every setting of the experiment."""
        groups = (
            (part,) if isinstance(part, Setting) else part.declared
            for part in self.parts
            if not isinstance(part, Stage | Table)
        )
        return tuple(setting for group in groups for setting in group)

    @cached_property
    def stages(self) -> tuple[Stage, ...]:
        """Every stage."""
        return tuple(part for part in self.parts if isinstance(part, Stage))

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """Every table."""
        return tuple(part for part in self.parts if isinstance(part, Table))

    @cached_property
    def by_key(self) -> dict[str, Setting]:
        """Every setting by its key."""
        return {setting.key: setting for setting in self.declared}

    @cached_property
    def by_name(self) -> dict[str, Stage]:
        """Stages by their names."""
        return {stage.name: stage for stage in self.stages}


@dataclass(frozen=True, eq=False)
class BoundStage:
    """Stage whose arguments, except `rng` and `valid`, are resolved to settings and stages."""

    stage: Stage
    arguments: Mapping[str, Setting | BoundStage]
    needs: tuple[str, ...]  # keys of settings that a cell depends on, also by its inputs; sorted
    inputs: tuple[BoundStage, ...]
    name: str
    random: bool  # whether it draws
    along: tuple[str, ...]  # keys of the axes that it computes together
    gather: tuple[str, ...]  # keys of the axes that it gathers


def bind(experiment: Experiment, zipped: Sequence[ZippedAxis] = ()) -> dict[str, BoundStage]:
    """Return stages by name with resolved arguments, every stage after its inputs.

    `zipped` are the settings that run together in a sweep.

    Raises
    ------
    DeclarationError
        If an argument is neither a setting nor a stage, or stages depend on each other in a circle.
    """
    bound: dict[str, BoundStage] = {}
    visiting: list[str] = []
    zipped_with = {key: axis.keys for axis in zipped if len(axis.points) > 1 for key in axis.keys}

    def visit(name: str) -> BoundStage:
        if name in visiting:
            raise DeclarationError(
                f"stages depend on each other in a circle: {' -> '.join((*visiting, name))}"
            )
        if name not in bound:
            visiting.append(name)
            declared = experiment.by_name[name]
            parameters = [
                parameter for parameter in declared.arguments if parameter not in (RNG, VALID)
            ]
            arguments = {
                parameter: resolve_argument(declared, parameter) for parameter in parameters
            }
            bound[name] = _bind_stage(declared, arguments, zipped_with)
            visiting.pop()
        return bound[name]

    def resolve_argument(declared: Stage, name: str) -> Setting | BoundStage:
        """Return an argument's setting or stage: from `reads`, else the one of that name."""
        subject = f"stage {declared.name}: argument {name!r} is"
        source = declared.reads.get(name, name)
        source = source.stage if isinstance(source, At) else source
        settings = (getattr(group, name, None) for group in declared.uses if source == name)
        setting = next(
            (candidate for candidate in (source, *settings) if isinstance(candidate, Setting)), None
        )
        if setting is not None:
            # A function may refine the setting of its name.
            stage_names = {
                declared.name,
                getattr(declared.function, "__name__", ""),
                *declared.reads,
            }
            if name in experiment.by_name.keys() - stage_names:
                raise DeclarationError(
                    f"{subject} both the setting {setting.key} and a stage; rename one of them, or "
                    "say which by reads"
                )
            if setting.key not in experiment.by_key:
                subject = f"stage {declared.name}: setting {setting.key}"
                raise DeclarationError(f"{subject} is not in the experiment")
            return setting
        if source in experiment.by_name:
            return visit(source)
        groups = ", ".join(group.__name__ for group in declared.uses) or "the groups it uses"
        sentence = f"{subject} neither a setting of {groups} nor a stage"
        raise DeclarationError(locate(declared.function, sentence))

    for declared in experiment.stages:
        visit(declared.name)
    return bound


def _bind_stage(
    declared: Stage,
    arguments: Mapping[str, Setting | BoundStage],
    zipped_with: Mapping[str, tuple[str, ...]],
) -> BoundStage:
    inputs = tuple(source for source in arguments.values() if isinstance(source, BoundStage))
    needs = {setting.key for setting in arguments.values() if isinstance(setting, Setting)}
    replacements = {
        target.key: replacement.key for target, replacement in declared.substitutions.items()
    }
    for source in inputs:
        keys = set(source.needs)
        for key in replacements.keys() & source.needs:  # and the keys that run together with it
            keys.difference_update(zipped_with.get(key, (key,)))
        needs.update(keys, (replacements[key] for key in replacements.keys() & source.needs))
    if RNG in declared.arguments:
        needs.add(Run.seed.key)
        stream = declared.stream or Stream(())
        needs.update(setting.key for setting in (*stream.settings, *stream.optional))
    along = tuple(setting.key for setting in declared.along)
    gather = tuple(setting.key for setting in declared.gather)
    whole_axes = {*along, *gather}
    if missing := whole_axes - needs:
        message = _unneeded_message(declared.name, missing, inputs)
        raise DeclarationError(locate(declared.function, message))
    for source in inputs:
        if not source.stage.is_cached and (shared := whole_axes & set(source.needs)):
            raise DeclarationError(
                f"stage {declared.name}: {source.name} is not kept on disk, so it cannot depend on "
                f"{', '.join(sorted(shared))}, which {declared.name} takes whole"
            )
    cell_needs = tuple(sorted(needs.difference(gather)))
    random = RNG in declared.arguments
    return BoundStage(declared, arguments, cell_needs, inputs, declared.name, random, along, gather)


def _unneeded_message(name: str, keys: Collection[str], inputs: Iterable[BoundStage]) -> str:
    """Return the message on axes of `along` or `gather` on which no input depends."""
    listed = ", ".join(sorted(keys))
    upstream = (bound for source in inputs for bound in (source, *source.inputs) if bound.random)
    drawing = next((bound.name for bound in upstream), None)
    message = f"stage {name} does not need {listed}"
    if drawing is None:
        return message
    hint = f"to let {drawing}, which takes rng, draw anew for each, name the settings of its stream"
    return f"{message}; {hint}: stream=Stream((..., {listed}))"


def value_token(value: Value) -> str:
    """Return the text of a value in a key; distinct values have distinct texts."""
    return f"={value.identity!r}" if isinstance(value, Identified) else repr(value)


# checks of declarations ---------------------------------------------------------------------------


def find_mistakes(experiment: Experiment) -> Iterator[str]:
    """Yield the mistakes in the declarations of an experiment; `bind` raises the others.

    A mistake may follow from an earlier one.
    """
    settings, stages = experiment.declared, experiment.stages
    keys = [setting.key for setting in settings]
    yield from _find_duplicates(keys, "settings")
    yield from _find_duplicates((stage.name for stage in stages), "stages")
    outputs = [
        "/".join(stage.stored_as(output))
        for stage in stages
        for output in stage.outputs
        if stage.stored_as(output)[0]
    ]
    states = {stage.group.status or stage: None for stage in stages if _has_state(stage)}
    outputs += [f"{STATUS}/{state.name}" for state in states]
    yield from _find_duplicates(outputs, "outputs of a group of the store")
    for setting in settings:
        yield from _check_name(f"setting {setting.key}", setting.name)
        if setting.role and setting.role not in (DIMENSION, COORDINATE):
            role = f"role={setting.role!r}, but must have one of"
            yield f"setting {setting.key} has {role} {DIMENSION!r}, {COORDINATE!r}"
    for stage in stages:
        yield from _find_stage_mistakes(stage, keys)
    groups = {name.rpartition("/")[0] for name in outputs}
    for table in experiment.tables:
        yield from _check_group(f"table {table.group}", table.group)
        yield from _find_unknown(f"table {table.group}: group", table.of, groups)
        groups.add(table.group)
    yield from _find_name_clashes(settings, bind(experiment).values())


def _has_state(stage: Stage) -> bool:
    """Return whether the engine, not the stage, provides a stage's state in the store."""
    stored = any(output.is_stored and output.role != COORDINATE for output in stage.outputs)
    status = stage.group.status
    return bool(stage.group.path) and stored and (status is None or bool(status.over))


def _find_name_clashes(settings: Iterable[Setting], stages: Iterable[BoundStage]) -> Iterator[str]:
    """Yield clashes of the names of outputs and dimensions in a group."""
    stored_settings = {s.key: s for s in settings if s.role or not s.not_swept}
    axes: dict[tuple[str, str], str] = {}  # keys of settings by group and name of the coordinate
    stored = [
        (bound, output, group)
        for bound in stages
        for output in bound.stage.outputs
        if (group := bound.stage.stored_as(output)[0]) not in ("", STATUS)
    ]
    dims = {(group, dim) for _, output, group in stored for dim in output.dims}
    for bound, _, group in stored:
        for setting in (stored_settings[key] for key in bound.needs if key in stored_settings):
            axes[group, bound.stage.group.names.get(setting) or setting.name] = setting.key
    for bound, output, group in stored:
        subject = f"stage {bound.name}: {output.name}"
        if (key := axes.get((group, output.name))) is not None:
            yield f"{subject} is named like the setting {key}; rename one of them"
        if (group, output.name) in dims and output.dims != (output.name,):
            yield f"{subject} is named like a dimension of its group"
        for key in (axes[group, dim] for dim in output.dims if (group, dim) in axes):
            if key not in bound.gather:
                clash = f"has a dimension named like the setting {key}"
                yield f"{subject} {clash}, which the stage does not gather; rename one of them"


def _find_stage_mistakes(stage: Stage, keys: Sequence[str]) -> Iterator[str]:
    subject, status = f"stage {stage.name}", stage.group.status
    yield from _check_name(subject, stage.name)
    yield from _find_duplicates((output.name for output in stage.outputs), f"outputs of {subject}")
    if stage.group.path:
        yield from _check_group(subject, stage.group.path)
    if stage.group.path == STATUS and _has_state(stage):
        yield (
            f"{subject} is in the group {STATUS!r}, which has states of cells; give it another one"
        )
    for output in stage.outputs:
        for name in (output.name, *output.dims):
            yield from _check_name(subject, name)
        yield from _check_dtype(f"{subject}: {output.name}", output, stage.stored_as(output)[0])
    stream = stage.stream or Stream(())
    settings = (*stage.along, *stage.gather, *chain.from_iterable(stage.substitutions.items()))
    settings += (*stage.group.names, *(status.over if status else ()))
    settings += (*stream.settings, *stream.optional)
    yield from _find_unknown(f"{subject}: setting", [setting.key for setting in settings], keys)
    if stage.stream is not None and RNG not in stage.arguments:
        yield f"{subject} has a stream, but its function does not take {RNG}"
    if stage.mode is Mode.IN_MEMORY and stage.keep < 1:
        yield f"{subject} has keep={stage.keep}, but must keep at least 1 result"
    if VALID in stage.arguments and not stage.gather:
        yield f"{subject} takes {VALID}, but gathers nothing"


def _check_dtype(subject: str, output: Output, stored: Any) -> Iterator[str]:
    dtype = output.dtype
    try:
        numpy_dtype = np.dtype(dtype)
    except TypeError:
        yield f"{subject} has the dtype {dtype!r}, unknown to numpy"
        return
    if not is_storable(numpy_dtype) and (
        stored or numpy_dtype.hasobject or numpy_dtype.names or numpy_dtype.subdtype
    ):
        allowed = "numbers of at most 8 bytes (complex 16), M8[ns], truth values or texts of "
        allowed += "fixed width"
        yield f"{subject} has the dtype {dtype!r}, but must have one of {allowed}"
    elif output.role == SHARE and not (numpy_dtype.kind == "u" and numpy_dtype.itemsize < 8):
        yield f"{subject} has the dtype {dtype!r}, but a share must have one of u1, u2, u4"


def _check_name(subject: str, name: str) -> Iterator[str]:
    if not name or "/" in name or name.startswith((".", "__")):
        allowed = "a name must not be empty, have '/', or begin with '.' or '__'"
        yield f"{subject} has the name {name!r}, but {allowed}"


def _check_group(subject: str, path: str) -> Iterator[str]:
    for name in path.split("/"):
        yield from _check_name(f"{subject} in group {path!r}", name)


def _find_unknown(subject: str, names: Iterable[str], known: Collection[str]) -> Iterator[str]:
    return (f"{subject} {name} is not in the experiment" for name in names if name not in known)


def _find_duplicates(names: Iterable[str], kind: str) -> Iterator[str]:
    return (f"two {kind} have the name {name}" for name, n in Counter(names).items() if n > 1)
