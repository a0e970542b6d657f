"""Settings of an experiment, each declared once: key, kind, bounds, unit, label and default.

A class that inherits from `Settings` declares those of one group of the configuration:

    class Spring(Settings, key="spring"):
        '''The spring.'''
        stiffness = number(10.0, low=0, unit="N m-1", label="stiffness")

Everything else that the program says of a setting is derived from here: what the configuration may
hold, its checks, the table of all settings, and the coordinate that it is in a store.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import Count, Draws, Kind, Number, SetOf, Switch, Text, Value, Word


@dataclass(frozen=True, eq=False)
class Setting:
    """One setting.

    Attributes
    ----------
    kind : Kind
        What it may be.
    default : object
        What a configuration has unless it says otherwise, as a user would write it.
    label : str
        What it is, in a few words: the `long_name` of its coordinate.
    unit : str
        Its unit, 1 where it has none.
    help : str
        What else a user should know.
    dimension : str
        Name of its dimension in stores; the last word of its key when empty.
    fixed : str
        Why it takes one value only; empty where several make it an axis.
    shown : bool
        Whether it is a dimension even with one value, else a scalar coordinate.
    noted : bool
        Whether with one value it is a scalar coordinate of what depends on it.
    fallback : Setting or None
        Setting whose values null stands for.
    identity : bool
        Whether results depend on it; not so of what only says where and how to run.
    key : str
        Its key in the configuration, set by `Settings`.
    """

    kind: Kind
    default: Any
    label: str
    unit: str = "1"
    help: str = ""
    dimension: str = ""
    fixed: str = ""
    shown: bool = False
    noted: bool = False
    fallback: Setting | None = None
    identity: bool = True
    key: str = ""

    @property
    def name(self) -> str:
        """Name of its dimension."""
        return self.dimension or self.key.rpartition(".")[2]

    @property
    def attrs(self) -> dict[str, str]:
        """CF attributes of its coordinate."""
        worded = isinstance(self.kind, Word | Text)
        return ({} if worded else {"units": self.unit}) | {"long_name": self.label}

    def values(self, given: Any) -> tuple[Value, ...]:
        """Values of what a user gave, in ascending order; see `Kind.values`."""
        found = self.kind.values(self.key, given)
        if self.fixed and len(found) > 1 and not isinstance(self.kind, Draws):
            raise ConfigurationError(
                f"{self.key} has {len(found)} values, but must have one: {self.fixed}"
            )
        return found


class Settings:
    """A group of settings, declared in the body of a class that inherits from this one."""

    key: ClassVar[str] = ""
    declared: ClassVar[tuple[Setting, ...]] = ()

    def __init_subclass__(cls, *, key: str = "") -> None:
        found: dict[Setting, Setting] = {}
        for name, value in list(vars(cls).items()):
            if isinstance(value, Setting):
                if hasattr(Settings, name):
                    raise TypeError(f"{cls.__name__} has a setting {name}, a name that is taken")
                setting = replace(value, key=f"{key}.{name}".lstrip("."))
                if value.fallback in found:  # of the same group, which has its key only now
                    setting = replace(setting, fallback=found[value.fallback])
                setattr(cls, name, setting)
                found[value] = setting
        cls.key = key
        cls.declared = tuple(found.values())


def number(
    default: Any,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    below: float = math.inf,
    null: bool = False,
    **about: Any,
) -> Setting:
    """Setting that is a finite number; the rest as of `Setting`."""
    nullable = null or (default is None and about.get("fallback") is None)
    return Setting(Number(low, high, below, null=nullable), default, **about)


def count(default: Any, low: int = 1, high: float = math.inf, **about: Any) -> Setting:
    """Setting that is a whole number; the rest as of `Setting`."""
    nullable = default is None and about.get("fallback") is None
    return Setting(Count(low, high, null=nullable), default, **about)


def draws(default: int, high: int = 1000, **about: Any) -> Setting:
    """Setting that says how many draws there are: an axis of their numbers, from 0."""
    return Setting(Draws(high), default, **about)


def word(default: Any, words: tuple[str, ...], **about: Any) -> Setting:
    """Setting that is a word of a list; the rest as of `Setting`."""
    return Setting(Word(tuple(words)), default, **about)


def switch(default: Any, **about: Any) -> Setting:
    """Setting that is true or false; the rest as of `Setting`."""
    return Setting(Switch(), default, **about)


def text(default: str | None, **about: Any) -> Setting:
    """Setting that is a text, such as a path; the rest as of `Setting`."""
    return Setting(Text(null=default is None), default, **about)


def set_of(member: Setting, *, spellings: tuple[tuple[str, tuple[str, ...]], ...] = ()) -> Setting:
    """Setting whose one value is a set of what another setting may be.

    A default of None makes null a value, too.
    """
    kind = SetOf(member.kind, null=member.default is None, spellings=spellings)
    if isinstance(member.kind, Text | Number | Count) and member.default is None:
        kind = replace(kind, kind=replace(member.kind, null=False))
    return replace(member, kind=kind, fixed=member.fixed or "its values belong together")


@dataclass(frozen=True)
class Joint:
    """Settings that run together as one axis, instead of crossed.

    Attributes
    ----------
    name : str
        Name of the axis.
    keys : tuple of str
        Keys of its settings.
    points : tuple of tuple
        A value of each of them, for every place on the axis.
    labels : tuple or None
        What each place is called, where it has a name of its own.
    """

    name: str
    keys: tuple[str, ...]
    points: tuple[tuple[Value, ...], ...]
    labels: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Choices:
    """The values of every setting of a sweep.

    Attributes
    ----------
    values : mapping of str to tuple
        By key, ascending.
    joint : tuple of Joint
        Settings that do not run crossed.
    """

    values: Mapping[str, tuple[Value, ...]]
    joint: tuple[Joint, ...] = field(default=())

    def __getitem__(self, setting: Setting) -> tuple[Value, ...]:
        """All values of a setting."""
        return self.values[setting.key]

    def one(self, setting: Setting) -> Value:
        """The value of a setting that has one."""
        (value,) = self.values[setting.key]
        return value

    def having(self, setting: Setting, values: tuple[Value, ...]) -> Choices:
        """The same with other values of one setting."""
        return replace(self, values={**self.values, setting.key: values})


class Noting(Choices):
    """Choices that note which settings are asked for."""

    @cached_property
    def asked(self) -> set[str]:
        """Keys of these settings."""
        return set()

    def __getitem__(self, setting: Setting) -> tuple[Value, ...]:
        """All values of a setting."""
        self.asked.add(setting.key)
        return super().__getitem__(setting)

    def one(self, setting: Setting) -> Value:
        """The value of a setting that has one."""
        self.asked.add(setting.key)
        return super().one(setting)


def read_choices(settings: tuple[Setting, ...], given: Mapping[str, Any]) -> Choices:
    """Choices that a configuration makes.

    Parameters
    ----------
    settings : tuple of Setting
        All there are.
    given : mapping of str to object
        What a user wrote, by key; the default where a key is not there.

    Raises
    ------
    ConfigurationError
        Naming the first key that is wrong.
    """
    values: dict[str, tuple[Value, ...]] = {}
    for setting in settings:
        written = given.get(setting.key, setting.default)
        if written is None and setting.fallback is not None:
            continue
        values[setting.key] = setting.values(written)
    for setting in settings:
        if setting.key not in values and setting.fallback is not None:
            values[setting.key] = values[setting.fallback.key]
    return Choices(values)


def nested(settings: tuple[Setting, ...]) -> dict[str, Any]:
    """Settings by the words of their keys, group within group."""
    tree: dict[str, Any] = {}
    for setting in settings:
        *groups, last = setting.key.split(".")
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[last] = setting
    return tree


def flatten(settings: tuple[Setting, ...], tree: Mapping[str, Any]) -> dict[str, Any]:
    """Values by key from a mapping within mappings, for the settings that it has."""

    def lookup(words: list[str]) -> Iterator[Any]:
        branch: Any = tree
        for word in words:
            if not isinstance(branch, Mapping) or word not in branch:
                return
            branch = branch[word]
        yield branch

    return {setting.key: value for setting in settings for value in lookup(setting.key.split("."))}
