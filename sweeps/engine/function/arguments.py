"""Values of a function's arguments as settings of a sweep: given by name, or as a data set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import (
    Count,
    Date,
    Kind,
    Number,
    Switch,
    Text,
    Value,
    sorted_values,
)
from sweeps.engine.declare.settings import COORDINATE, DIMENSION, Setting, ZippedAxis

MIN_INTEGER, MAX_INTEGER = -(2**63), 2**63 - 1  # whole numbers that a store holds


@dataclass(frozen=True, eq=False)
class Argument(Setting):
    """A function argument as a setting, whose default holds the values to sweep."""

    # Attributes besides unit and label.
    extra_attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def attrs(self) -> dict[str, Any]:
        """See `Setting.attrs`."""
        return {**super().attrs, **self.extra_attributes}

    @property
    def message_name(self) -> str:
        """See `Setting.message_name`."""
        return f"values[{self.name!r}]"

    def override(self, values: Iterable[Value]) -> str:
        """See `Setting.override`."""
        return f"values={{{self.name!r}: [{', '.join(map(_python_text, values))}], ...}}"


def read_values(
    function: str, values: Any, attrs: Mapping[str, Mapping[str, Any]]
) -> tuple[list[Argument], tuple[ZippedAxis, ...]]:
    """Return the settings of some values, and the zipped axes of settings that run together.

    Variables of a data set that share a dimension run together; its scalars are fixed.

    Raises
    ------
    ConfigurationError
        Naming the first argument whose values cannot be swept.
    """
    if not isinstance(values, Mapping):
        raise ConfigurationError(
            f"values is {_short_text(values)}, but must be a mapping of arguments to their values, "
            "such as {'x': [1, 2]}, or a data set of xarray"
        )
    if hasattr(values, "data_vars"):
        return _read_dataset(function, values, attrs)
    settings = []
    for name, argument_values in values.items():
        listed = _as_list(name, argument_values)
        attributes = {**getattr(argument_values, "attrs", {}), **attrs.get(name, {})}
        settings.append(_make_argument(function, name, listed, attributes))
    return settings, ()


def _read_dataset(
    function: str, values: Any, attrs: Mapping[str, Mapping[str, Any]]
) -> tuple[list[Argument], tuple[ZippedAxis, ...]]:
    settings: dict[str, list[Argument]] = {str(dim): [] for dim in values.dims}
    points: dict[str, list[list[Value]]] = {str(dim): [] for dim in values.dims}
    fixed: list[Argument] = []
    for name, variable in values.variables.items():
        attributes = {**variable.attrs, **attrs.get(name, {})}
        if variable.ndim > 1:
            has = f"the dimensions {', '.join(map(str, variable.dims))}"
            raise ConfigurationError(f"values[{name!r}] has {has}, but must have one or none")
        listed = _as_list(name, np.atleast_1d(variable.values))
        if variable.ndim:
            dim, distinct = str(variable.dims[0]), list(dict.fromkeys(listed))
            settings[dim].append(_make_argument(function, name, distinct, attributes))
            kind = settings[dim][-1].kind
            points[dim].append([kind.values(name, value)[0] for value in listed])
        else:
            fixed.append(_make_argument(function, name, listed, attributes, role=COORDINATE))
    zipped = [
        ZippedAxis(
            dim,
            tuple(argument.key for argument in arguments),
            tuple(zip(*points[dim], strict=True)),
            unlabelled=True,
        )
        for dim, arguments in settings.items()
        if arguments
    ]
    return [
        *(argument for arguments in settings.values() for argument in arguments),
        *fixed,
    ], tuple(zipped)


def _as_list(name: str, values: Any) -> list[Any]:
    """Return the values of an argument as Python values, or as times of numpy."""
    subject = f"values[{name!r}]"
    if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
        example = f"{{{name!r}: [{_python_text(values)}]}}"
        raise ConfigurationError(
            f"{subject} is {_short_text(values)}, but must be a list of values; one alone is "
            f"{example}"
        )
    if (ndim := getattr(values, "ndim", 1)) != 1:
        raise ConfigurationError(f"{subject} is an array of {ndim} dimensions, but must have one")
    listed = [_to_python(value) for value in values]
    if all(isinstance(value, np.datetime64) for value in listed):
        listed = list(np.array(listed))  # in one unit
    return listed


def _to_python(value: Any) -> Any:
    """Return a value as a Python value; times of numpy stay as they are."""
    if hasattr(value, "to_datetime64"):  # of pandas
        return value.to_datetime64()
    value = value.values if hasattr(value, "dims") else value  # of a data array
    value = value[()] if isinstance(value, np.ndarray) and not value.ndim else value
    times = isinstance(value, np.datetime64 | np.timedelta64)
    return value.item() if isinstance(value, np.generic) and not times else value


def _make_argument(
    function: str,
    name: str,
    listed: list[Any],
    attributes: Mapping[str, Any],
    role: str = DIMENSION,
) -> Argument:
    """Return the setting of an argument, with its values as default."""
    kind = _kind_of_values(listed)
    subject = f"values[{name!r}]"
    try:
        for value in listed:
            if not kind.holds(value):
                allowed = f"every value must be {kind.allowed}"
                raise ValueError(f"{subject} has {_short_text(value)}, but {allowed}")
        sorted_values(subject, listed)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None
    attrs = dict(attributes)
    label, unit = str(attrs.pop("long_name", name)), str(attrs.pop("units", "1"))
    key = f"{function}.{name}"
    return Argument(kind, listed, label, unit, role=role, key=key, extra_attributes=attrs)


def _kind_of_values(listed: list[Any]) -> Kind:
    """Return the kind of values that have one type; else numbers."""
    if listed and all(isinstance(value, np.datetime64) for value in listed):
        return Date(np.datetime_data(listed[0].dtype)[0])
    numbers = Count(low=MIN_INTEGER, high=MAX_INTEGER)
    kinds: dict[type, Kind] = {bool: Switch(), int: numbers, str: Text(), datetime: Date()}
    fitting = (
        kind
        for value_type, kind in kinds.items()
        if all(isinstance(value, value_type) for value in listed)
    )
    return next(fitting, Number())


def _python_text(value: Any) -> str:
    """Return the Python expression of a value."""
    return f"'{value}'" if isinstance(value, np.datetime64) else repr(value)


def _short_text(value: Any) -> str:
    """Return a value for messages, cut after 80 characters."""
    text = " ".join(_python_text(value).split())
    return text if len(text) < 80 else f"{text[:80]}..."
