"""An experiment: all that is declared of it, and what depends on what under a configuration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sweeps.engine.kinds import Value
from sweeps.engine.run_settings import ENGINE_SETTINGS, Run
from sweeps.engine.settings import Choices, Setting, Settings
from sweeps.engine.stage import RNG, THERE, Condition, Stage, always

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Table:
    """A group of the store that is made of other groups when all cells are done.

    Attributes
    ----------
    group : str
        Group that it becomes.
    of : tuple of str
        Groups that it is made of, and that must be there.
    make : callable
        (data set of each of them, ..., choices) -> data set, or None where there is nothing.
    when : callable
        Whether a configuration has it.
    """

    group: str
    of: tuple[str, ...]
    make: Callable[..., xr.Dataset | None]
    when: Condition = always


@dataclass(frozen=True)
class Status:
    """State of some stages over some axes; -1 missing, 0 failed, 1 done.

    Attributes
    ----------
    name : str
        Group and variable, as in `status:view`: what stages call it.
    over : tuple of Setting
        Its axes. A place is failed if anything there failed, else missing if anything is.
    label : str
        `long_name` of the variable.
    """

    name: str
    over: tuple[Setting, ...]
    label: str


def nothing_to_check(choices: Choices) -> Choices:
    """The choices as they are."""
    return choices


@dataclass(frozen=True)
class Experiment:
    """What is declared of an experiment.

    Attributes
    ----------
    name : str
        Name of the command.
    title : str
        Title of its stores.
    settings : tuple of Settings
        Groups of settings.
    stages : tuple of Stage
        In the order in which progress names them.
    tables : tuple of Table
        Made in this order.
    statuses : tuple of Status
        States that several stages share.
    check : callable
        Choices -> choices: refuses those that make no sense together (`ConfigurationError`), and
        drops values that nothing uses.
    remarks : callable
        Choices -> sentences for the user.
    versions : tuple of str
        Distributions whose versions the store's attributes have.
    attributes : callable
        Choices -> further root attributes.
    conf : Path or None
        Folder of its Hydra configuration.
    code : tuple of str
        Packages whose code counts in the keys of results.
    """

    name: str
    title: str
    settings: tuple[type[Settings], ...]
    stages: tuple[Stage, ...]
    tables: tuple[Table, ...] = ()
    statuses: tuple[Status, ...] = ()
    check: Callable[[Choices], Choices] = nothing_to_check
    remarks: Callable[[Choices], list[str]] = lambda choices: []
    versions: tuple[str, ...] = ()
    attributes: Callable[[Choices], Mapping[str, Any]] = lambda choices: {}
    conf: Path | None = None
    code: tuple[str, ...] = ()

    @cached_property
    def declared(self) -> tuple[Setting, ...]:
        """Every setting, those of the engine among them."""
        groups = (*self.settings, *ENGINE_SETTINGS)
        return tuple(setting for group in groups for setting in group.declared)

    @cached_property
    def by_name(self) -> dict[str, Stage]:
        """Stages by their names."""
        return {one.name: one for one in self.stages}


@dataclass(frozen=True)
class Argument:
    """Where an argument of a stage's function comes from.

    Attributes
    ----------
    name : str
        Its name.
    setting : Setting or None
        The setting whose value it is.
    source : Bound or None
        The stage whose result it is.
    """

    name: str
    setting: Setting | None = None
    source: Bound | None = None


@dataclass(frozen=True, eq=False)
class Bound:
    """A stage with its arguments found, and what it depends on.

    Attributes
    ----------
    stage : Stage
        As declared.
    arguments : tuple of Argument
        All but `rng` and `there`.
    needs : tuple of str
        Keys of all settings that a cell depends on, through its inputs, too; sorted.
    """

    stage: Stage
    arguments: tuple[Argument, ...]
    needs: tuple[str, ...]
    inputs: tuple[Bound, ...] = field(default=())

    @cached_property
    def name(self) -> str:
        """Name of the stage."""
        return self.stage.name

    @cached_property
    def random(self) -> bool:
        """Whether it draws."""
        return RNG in self.stage.arguments

    @cached_property
    def along(self) -> tuple[str, ...]:
        """Keys of the axes that it computes together."""
        return tuple(one.key for one in self.stage.along)

    @cached_property
    def gather(self) -> tuple[str, ...]:
        """Keys of the axes that it wants whole."""
        return tuple(one.key for one in self.stage.gather)


class DeclarationError(TypeError):
    """What is declared of an experiment does not fit together: a mistake of its author."""


def bind(experiment: Experiment) -> dict[str, Bound]:
    """Stages by name with their arguments found, every stage behind those that it needs.

    Raises
    ------
    DeclarationError
        If an argument is neither a setting nor a stage, or stages need each other in a circle.
    """
    bound: dict[str, Bound] = {}
    under_way: list[str] = []

    def visit(name: str) -> Bound:
        if name in bound:
            return bound[name]
        if name in under_way:
            raise DeclarationError(f"stages need each other: {' -> '.join((*under_way, name))}")
        under_way.append(name)
        declared = experiment.by_name[name]
        arguments = tuple(
            _found(experiment, declared, argument, visit)
            for argument in declared.arguments
            if argument not in (RNG, THERE)
        )
        under_way.pop()
        bound[name] = _bound(declared, arguments)
        return bound[name]

    for declared in experiment.stages:
        visit(declared.name)
    return bound


def _found(
    experiment: Experiment, declared: Stage, name: str, visit: Callable[[str], Bound]
) -> Argument:
    """An argument's setting or stage: as `reads` has it, else of that name."""
    source = declared.reads.get(name, name)
    if isinstance(source, Setting):
        return Argument(name, setting=source)
    if isinstance(source, str) and source == name:
        for group in declared.uses:
            if isinstance(found := getattr(group, name, None), Setting):
                return Argument(name, setting=found)
    if source in experiment.by_name:
        return Argument(name, source=visit(source))
    groups = ", ".join(group.__name__ for group in declared.uses) or "the groups it uses"
    raise DeclarationError(
        f"stage {declared.name}: argument {name!r} is neither a setting of {groups} nor a stage"
    )


def _bound(declared: Stage, arguments: tuple[Argument, ...]) -> Bound:
    inputs = tuple(one.source for one in arguments if one.source is not None)
    needs = {one.setting.key for one in arguments if one.setting is not None}
    at = {one.key: other.key for one, other in declared.at.items()}
    for source in inputs:
        needs.update(at.get(key, key) for key in source.needs)
    if RNG in declared.arguments:
        needs.add(Run.seed.key)
        needs.update(one.key for one in declared.stream or ())
    gathered = {one.key for one in declared.gather}
    together = {one.key for one in declared.along}
    if missing := (together | gathered) - needs:
        raise DeclarationError(f"stage {declared.name} does not need {', '.join(sorted(missing))}")
    for source in inputs:
        whole = (together | gathered) & set(source.needs)
        if whole and not source.stage.kept:
            raise DeclarationError(
                f"stage {declared.name}: {source.name} is not kept, so that it cannot depend on "
                f"{', '.join(sorted(whole))}, which {declared.name} wants together"
            )
    return Bound(declared, arguments, tuple(sorted(needs - gathered)), inputs)


def value_token(value: Value) -> str:
    """Text that stands for a value in a key: equal for equal values only."""
    identity = getattr(value, "identity", None)
    return repr(value) if identity is None else f"={identity!r}"
