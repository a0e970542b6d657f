"""Settings of an experiment, each declared once: key, kind, bounds, unit, label and default.

A subclass of `Settings` declares the settings of one group of the configuration:

    class Spring(Settings, key="spring"):
        '''The spring.'''
        stiffness = number(10.0, low=0, unit="N m-1", label="stiffness")

The schema of the configuration, a setting's checks, its line in the table of settings and its
coordinate in a store follow from its declaration.
"""

from __future__ import annotations

import math
import os
from collections import ChainMap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, ClassVar, Self

from sweeps.engine.declare.errors import ConfigurationError, DeclarationError, locate
from sweeps.engine.declare.kinds import (
    Count,
    Draws,
    Groups,
    Kind,
    Number,
    SetOf,
    Switch,
    Text,
    Value,
    Vector,
    Word,
    format_value,
    quote_value,
)

CACHE_VARIABLE = "SWEEP_CACHE"  # environment variable with the folder of the cache
DIMENSION, COORDINATE = "dimension", "coordinate"  # roles in a store of a setting of one value
AFFECTS_NO_RESULT = "no result depends on it"  # why such a setting takes one value


class Unit(str):
    """A unit of settings that stages get in SI: its symbol, and its factor to SI."""

    si: float

    def __new__(cls, symbol: str, si: float = 1.0) -> Self:
        """Return the unit of a symbol."""
        unit = super().__new__(cls, symbol)
        unit.si = si
        return unit


@dataclass(frozen=True, eq=False)
class Setting:
    """Declaration of one setting.

    `label` describes it. `default` is written as a user would write it, or is another setting,
    whose values replace null.
    """

    kind: Kind
    default: Any
    label: str
    unit: str = "1"
    help: str = ""  # more in `--settings` than the label
    dimension: str = ""  # its name in stores; by default the last word of its key
    # Reason to refuse several values; empty: they make an axis. None: inherit it from the class.
    not_swept: str | None = None
    # With one value, in stores: a DIMENSION, a scalar COORDINATE, or nothing; None: inherit it.
    role: str | None = None
    key: str = ""  # in the configuration, given by `Settings`

    @property
    def name(self) -> str:
        """Name of its dimension."""
        return self.dimension or self.key.rpartition(".")[2]

    @property
    def attrs(self) -> dict[str, str]:
        """CF attributes of its coordinate."""
        is_text = isinstance(self.kind, Word | Text)
        return ({} if is_text else {"units": self.unit}) | {"long_name": self.label}

    @property
    def fallback(self) -> Setting | None:
        """The setting whose values replace null, if any."""
        return self.default if isinstance(self.default, Setting) else None

    @property
    def default_input(self) -> Any:
        """Its default as a user would write it."""
        return None if isinstance(self.default, Setting) else self.default

    @property
    def affects_results(self) -> bool:
        """Whether results depend on it."""
        return self.not_swept != AFFECTS_NO_RESULT

    def in_si(self, value: Value) -> Value:
        """Return a value, or a tuple of values, as stages get it: in SI of a `Unit`."""
        if not isinstance(self.unit, Unit) or value is None:
            return value
        if isinstance(value, tuple):
            return tuple(map(self.in_si, value))
        return value * self.unit.si

    @property
    def message_name(self) -> str:
        """Its name in messages."""
        return self.key

    def override(self, values: Iterable[Value]) -> str:
        """Return the override that gives it some values."""
        return f"{self.key}=[{','.join(map(format_value, values))}]"

    def values(self, given: Any) -> tuple[Value, ...]:
        """Return values of a user's input, in ascending order; raise `ConfigurationError`."""
        try:
            values = self.kind.values(self.key, given)
        except ValueError as error:
            raise ConfigurationError(str(error)) from None
        if self.not_swept and len(values) > 1 and not isinstance(self.kind, Draws):
            count = f"{self.key} has {len(values)} values"
            raise ConfigurationError(f"{count}, but must have one: {self.not_swept}")
        return values


class Settings:
    """A group of settings, declared in the body of a class that inherits from this one."""

    key: ClassVar[str] = ""
    declared: ClassVar[tuple[Setting, ...]] = ()

    def __init_subclass__(cls, *, key: str = "", role: str = "", not_swept: str = "") -> None:
        settings: dict[Setting, Setting] = {}
        for name, value in list(vars(cls).items()):
            if isinstance(value, Setting):
                if name in ("key", "declared"):
                    problem = (
                        f"setting {name} must have another name: every group has its own {name}"
                    )
                    raise DeclarationError(locate(cls, problem))
                if not isinstance(value.unit, str):
                    problem = f"setting {name} has unit={value.unit!r}, but must have a text"
                    raise DeclarationError(locate(cls, f"{problem}, or Unit(SYMBOL, FACTOR)"))
                class_options = {"role": role, "not_swept": not_swept}.items()
                inherited: Any = {
                    option: default
                    for option, default in class_options
                    if getattr(value, option) is None
                }
                setting = replace(value, key=f"{key}.{name}".lstrip("."), **inherited)
                if value.fallback in settings:  # of the same group, whose key is set only now
                    setting = replace(setting, default=settings[value.fallback])
                setattr(cls, name, setting)
                settings[value] = setting
        cls.key = key
        cls.declared = tuple(settings.values())


def number(
    default: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    below: float = math.inf,
    null: bool = False,
    **options: Any,
) -> Setting:
    """Return a setting that is a finite number; pass `options` to `Setting`."""
    unit = options.get("unit", "1")
    kind = Number(low, high, below, unit, null=null or default is None)
    return Setting(kind, default, **options)


def count(default: Any, low: int = 1, high: float = math.inf, **options: Any) -> Setting:
    """Return a setting that is a whole number; pass `options` to `Setting`."""
    unit = options.get("unit", "1")
    return Setting(Count(low, high, unit=unit, null=default is None), default, **options)


def draws(default: int, high: int = 1000, **options: Any) -> Setting:
    """Return a setting that is a number of draws: an axis of their indices, from 0."""
    return Setting(Draws(high), default, **options)


def word(default: Any, words: tuple[str, ...], **options: Any) -> Setting:
    """Return a setting that is a word of a list; pass `options` to `Setting`."""
    return Setting(Word(tuple(words)), default, **options)


def switch(default: Any, **options: Any) -> Setting:
    """Return a setting that is true or false; pass `options` to `Setting`."""
    return Setting(Switch(), default, **options)


def text(default: str | None, **options: Any) -> Setting:
    """Return a setting that is a text, such as a path; pass `options` to `Setting`."""
    return Setting(Text(null=default is None), default, **options)


def vector(default: Any, size: int, low: float, high: float, **options: Any) -> Setting:
    """Return a setting whose value lists `size` finite numbers; pass `options` to `Setting`."""
    options.setdefault("not_swept", "its numbers belong together")
    element = Number(low, high, unit=options.get("unit", "1"))
    return Setting(Vector(size, element), default, **options)


def set_of(member: Setting, *, spellings: tuple[tuple[str, tuple[str, ...]], ...] = ()) -> Setting:
    """Return a setting whose value is a set of another's values; a default of None allows null."""
    kind = SetOf(replace(member.kind, null=False), spellings, null=member.default is None)
    return replace(member, kind=kind, not_swept=member.not_swept or "its values belong together")


# settings of the engine: the seed, and where and how a sweep runs

CLUSTERS = ("inline", "local", "address", "slurm")


class Run(Settings, not_swept=AFFECTS_NO_RESULT):
    """The run."""

    seed = count(0, 0, 2**63, label="seed of all noise", not_swept="")
    store = text(None, label="folder of the store; null: sweep.zarr")
    cache = text(None, label="cache of finished results; null: the user's cache folder")
    cache_limit = number(20, 0, 1e6, unit="GB", label="size of the cache above which a sweep warns")
    dry_run = switch(False, label="only print what would be computed")
    partial = switch(False, label="compute nothing, and store the cells that the cache has")


class Zip(Settings, key="grid", not_swept=AFFECTS_NO_RESULT):
    """Settings that run together."""

    zip = Setting(
        Groups(), None, label="settings that run together instead of crossed: [[a, b], [c, d]]"
    )


class Cluster(Settings, key="cluster", not_swept=AFFECTS_NO_RESULT):
    """The cluster; see `sweeps.engine.run.cluster.ClusterChoice`."""

    kind = word("local", CLUSTERS, label="where tasks run")
    workers = count(None, 1, 4096, label="worker processes, or jobs of Slurm; null: one per core")
    address = text(None, label="address of a dask scheduler")
    ca_file = text(None, label="TLS: file of the authority")
    cert = text(None, label="TLS: file of the certificate")
    private_key = text(None, label="TLS: file of its private key")
    queue = text(None, label="Slurm: partition")
    account = text(None, label="Slurm: account")
    walltime = text(None, label="Slurm: longest time of a job")
    memory = text(None, label="Slurm: memory of a job")
    interface = text(None, label="Slurm: network interface")


ENGINE_SETTINGS: tuple[type[Settings], ...] = (Run, Zip, Cluster)


@dataclass(frozen=True)
class ZippedAxis:
    """Axis of several settings: their keys, and the values of all at each position."""

    name: str
    keys: tuple[str, ...]
    points: tuple[tuple[Value, ...], ...]
    labels: tuple[str, ...] | None = None  # of the positions, if they have names
    unlabelled: bool = False  # has the settings' values as its only coordinates


@dataclass(frozen=True)
class Choices:
    """Values of every setting of a sweep by key, ascending, and the zipped axes."""

    values: Mapping[str, tuple[Value, ...]]
    zipped: tuple[ZippedAxis, ...] = ()
    given_keys: tuple[str, ...] = field(default=(), compare=False)  # on the command line
    read_keys: set[str] = field(default_factory=set, repr=False, compare=False)  # keys looked up

    def __getitem__(self, setting: Setting) -> tuple[Value, ...]:
        """Return all values of a setting."""
        self.read_keys.add(setting.key)
        return self.values[setting.key]

    @property
    def variables(self) -> dict[str, str]:
        """Environment variables of a sweep's calls, also on workers."""
        folder = self.value(Run.cache)
        return {CACHE_VARIABLE: os.path.abspath(folder)} if folder and "://" not in folder else {}

    def value(self, setting: Setting) -> Value:
        """Return the value of a setting that has one."""
        (value,) = self[setting]
        return value

    def replace(self, setting: Setting, values: tuple[Value, ...]) -> Choices:
        """Return choices with other values of one setting."""
        return replace(self, values={**self.values, setting.key: values})

    def points(self, keys: Sequence[str]) -> Iterator[tuple[Value, ...]]:
        """Yield the values of settings, in the order of `keys`, at each point of their axes."""
        zipped = [axis for axis in self.zipped if not set(axis.keys).isdisjoint(keys)]
        axes = [
            [dict(zip(axis.keys, point, strict=True)) for point in axis.points] for axis in zipped
        ]
        zipped_keys = {key for axis in zipped for key in axis.keys}
        crossed_keys = [key for key in keys if key not in zipped_keys]
        axes += [[{key: value} for value in self.values[key]] for key in crossed_keys]
        for point in product(*axes):
            values = ChainMap(*point)
            yield tuple(values[key] for key in keys)


def read_choices(settings: Iterable[Setting], given: Mapping[str, Any]) -> Choices:
    """Return the choices of a configuration: given values by key, else the defaults.

    Raises
    ------
    ConfigurationError
        Naming the first invalid key.
    """
    values: dict[str, tuple[Value, ...]] = {}
    fallbacks: dict[str, str] = {}
    for setting in settings:
        value = given.get(setting.key, setting.default_input)
        if value is None and setting.fallback is not None:
            fallbacks[setting.key] = setting.fallback.key
        else:
            values[setting.key] = setting.values(value)
    for key, fallback in fallbacks.items():
        values[key] = values[fallback]
    return Choices(values)


def read_entries(entries: Iterable[Setting], key: str, given: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the checked entries of a mapping that is one value of a setting.

    `entries` declare its keys. A key without a default is required, unless it may be null.

    Raises
    ------
    ConfigurationError
        Naming the first invalid key, its value and the allowed values.
    """
    by_name = {entry.name: entry for entry in entries}
    for name in given:
        if name not in by_name:
            raise ConfigurationError(
                f"{key}.{name} is not a key of the configuration; {key} has {', '.join(by_name)}"
            )
    for name, entry in by_name.items():
        if name not in given and entry.default is None and not entry.kind.null:
            raise ConfigurationError(f"{key} is {quote_value(given)}, but must have {name}")
    return {
        name: entry.values(given.get(name, entry.default))[0] for name, entry in by_name.items()
    }


def nested(by_key: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested mappings of values by key, split at the dots."""
    tree: dict[str, Any] = {}
    for key, value in by_key.items():
        *groups, last = key.split(".")
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[last] = value
    return tree


def flatten(settings: Iterable[Setting], tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by key from nested mappings, for the settings that they contain."""
    values = {}
    for setting in settings:
        *groups, last = setting.key.split(".")
        branch: Any = tree
        for group in groups:
            branch = branch.get(group) if isinstance(branch, Mapping) else None
        if isinstance(branch, Mapping) and last in branch:
            values[setting.key] = branch[last]
    return values
