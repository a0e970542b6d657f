"""Refusals of values of settings, with the values that are allowed instead."""

from __future__ import annotations

from typing import Any, NoReturn

from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import SetOf, format_value
from sweeps.engine.declare.settings import Choices, Setting


def refuse(setting: Setting, value: Any, allowed: str) -> NoReturn:
    """Raise `ConfigurationError`: a setting has a value that is not among those allowed."""
    text = value if isinstance(value, str) else format_value(value)
    raise ConfigurationError(f"{setting.key} has {text}, but must be {allowed}")


def require(choices: Choices, setting: Setting, allowed: Any, reason: str) -> None:
    """Refuse (`ConfigurationError`) every other value of a setting."""
    for value in choices[setting]:
        if value != allowed:
            refuse(setting, _quote(value), f"{format_value(allowed)} {reason}")


def require_among(choices: Choices, setting: Setting, whole: Setting, reason: str = "") -> None:
    """Refuse (`ConfigurationError`) values of a setting, or members of a set, absent in another."""
    values = choices[setting]
    for value in (values[0] or ()) if isinstance(setting.kind, SetOf) else values:
        if value not in choices[whole]:
            known = ", ".join(map(format_value, choices[whole]))
            refuse(setting, _quote(value), f"one of {known}, the values of {whole.key}{reason}")


def _quote(value: Any) -> Any:
    return repr(str(value)) if isinstance(value, str) else value
