"""Stages: plain functions whose argument names say what they need, and what they give.

A stage is declared by a decorator and stays the plain function that it is:

    @stage(Output("period", unit="s", label="period"), uses=(Spring, Mass))
    def period(stiffness, mass):
        return 2 * math.pi * math.sqrt(mass / stiffness)

Each argument is a setting, the result of another stage, `rng` or `there`. What the result depends
on, and so its cells, its key, its dimensions and its progress line, is derived from these names.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from sweeps.engine.settings import Choices, Setting, Settings

RNG, THERE = "rng", "there"

Condition = Callable[[Choices], bool]


def always(choices: Choices) -> bool:
    """True: the stage is there whatever the configuration."""
    return True


@dataclass(frozen=True)
class Output:
    """One array that a stage gives for every cell.

    Attributes
    ----------
    name : str
        Name of the variable; in one group of a store every variable has another.
    dims : tuple of str
        The array's own dimensions. One that is named like the dimension of a gathered setting has
        the values of that as its coordinate.
    dtype : str
        Type in the store.
    label, unit : str
        `long_name` and `units` of the variable.
    fill : float or None
        What stands in the store where there is no result. None: NaN of floats, -1 of integers.
    failed : float or None
        What stands there where the stage failed; as `fill` when None.
    pad : float or None
        What fills a cell's array up to the size of the largest; as `fill` when None.
    origin : mapping of str to str
        For an own dimension whose arrays lie at different places: the output, a whole number, that
        says where on the dimension the cell's array begins; its label and unit are the dimension's.
    without : tuple of str
        Names of settings that this output does not depend on though its stage does.
    group : str or None
        Group of the store; that of the stage when None.
    stored : bool
        Whether the store has it; not so of what is only handed on to other stages.
    step : float
        Unit of the integers: 1/255 of shares kept in bytes.
    attrs : mapping
        Further attributes.
    """

    name: str
    dims: tuple[str, ...] = ()
    dtype: str = "f4"
    label: str = ""
    unit: str = "1"
    fill: float | None = None
    failed: float | None = None
    pad: float | None = None
    origin: Mapping[str, str] = field(default_factory=dict)
    without: tuple[str, ...] = ()
    group: str | None = None
    stored: bool = True
    step: float = 1.0
    attrs: Mapping[str, Any] = field(default_factory=dict)

    @property
    def empty(self) -> float:
        """What stands where there is no result."""
        if self.fill is not None:
            return self.fill
        return np.nan if np.dtype(self.dtype).kind == "f" else -1


@dataclass(frozen=True, eq=False)
class Stage:
    """A function, what it needs and what it gives; see `stage` for the attributes."""

    name: str
    function: Callable[..., Any]
    outputs: tuple[Output, ...]
    uses: tuple[type[Settings], ...] = ()
    reads: Mapping[str, Any] = field(default_factory=dict)
    along: tuple[Setting, ...] = ()
    gather: tuple[Setting, ...] = ()
    stream: tuple[Setting, ...] | None = None
    noise: str = ""
    optional: tuple[Setting, ...] = ()
    group: str | None = None
    dims: tuple[str, ...] = ()
    when: Condition = always
    memory: int = 0
    plain: bool = False
    status: str = ""
    also: tuple[str, ...] = ()
    coordinates: bool = False
    at: Mapping[Setting, Setting] = field(default_factory=dict)
    names: Mapping[Setting, str] = field(default_factory=dict)

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """Names of the function's arguments."""
        return tuple(inspect.signature(self.function).parameters)

    @property
    def kept(self) -> bool:
        """Whether results are kept on disk."""
        return not (self.memory or self.plain)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """What the function returns."""
        return self.function(*arguments, **named)


def stage(
    *outputs: Output,
    uses: tuple[type[Settings], ...] = (),
    reads: Mapping[str, Any] | None = None,
    name: str = "",
    **how: Any,
) -> Callable[[Callable[..., Any]], Stage]:
    """Declare a function a stage.

    Parameters
    ----------
    *outputs : Output
        What it gives. A stage of one output returns that array, one of several a mapping.
    uses : tuple of Settings
        Where the names of arguments are looked up, in this order; then the names of stages are.
    reads : mapping of str to Setting or str
        Arguments that stand for a setting, or a stage, of another name.
    name : str
        Name of the stage; the function's when empty.
    along : tuple of Setting
        Axes that it computes together: it gets a tuple of the values wanted, those missing, and
        its arrays have these as leading axes. A value's result must not depend on its company.
    gather : tuple of Setting
        Axes that it wants whole: it gets a tuple of all values, and inputs with these as leading
        axes (behind those of `along`). Inputs that failed are filled; `there` tells which.
    stream : tuple of Setting
        Settings whose values name the stream of `rng`, besides `seed` and the stage's name (or
        `noise`); what else differs between cells then shares its noise. None: all it depends on.
    optional : tuple of Setting
        Of these, those that are left out of the stream's name where they have their first value.
    group : str
        Group of the store that the outputs go to; None: they only serve other stages.
    dims : tuple of str
        Order of its dimensions in the store; those not named come first.
    when : callable
        Whether a configuration has this stage at all.
    memory : int
        How many results, any objects, a process keeps in memory; they are never kept on disk.
        0: results are arrays, and kept there.
    plain : bool
        Whether it is a quick function of settings that is called while planning; its result, a
        number, a text or a tuple of them, counts as a value, wherever it came from.
    status : str
        Name of the group and variable, as in `status:view`, that its state counts in.
    also : tuple of str
        Distributions behind its numbers that no import shows.
    coordinates : bool
        Whether the outputs are coordinates of their group.
    at : mapping of Setting to Setting
        Inputs are taken where the one setting has the value of the other.
    names : mapping of Setting to str
        Names of dimensions in its group, where they differ from the settings' own.
    """

    def declare(function: Callable[..., Any]) -> Stage:
        return Stage(
            name or function.__name__, function, outputs, uses=uses, reads=reads or {}, **how
        )

    return declare


def plain(
    *, uses: tuple[type[Settings], ...] = (), reads: Mapping[str, Any] | None = None, name: str = ""
) -> Callable[[Callable[..., Any]], Stage]:
    """Declare a quick function of settings, whose result counts as a value; see `stage`."""
    return stage(uses=uses, reads=reads, name=name, plain=True)


def in_memory(
    *,
    uses: tuple[type[Settings], ...] = (),
    reads: Mapping[str, Any] | None = None,
    name: str = "",
    keep: int = 2,
    **how: Any,
) -> Callable[[Callable[..., Any]], Stage]:
    """Declare a function whose result lives in memory only, `keep` of them; see `stage`."""
    return stage(uses=uses, reads=reads, name=name, memory=keep, **how)
