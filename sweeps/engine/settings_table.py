"""All settings of an experiment in one table, for the terminal and for the documentation."""

from __future__ import annotations

from typing import Any

from sweeps.engine.experiment import Experiment
from sweeps.engine.settings import Setting

COLUMNS = ("key", "default", "unit", "allowed", "what it is")


def settings_table(experiment: Experiment) -> str:
    """Markdown table of every setting: key, default, unit, what is allowed and what it is."""
    rows = [COLUMNS, tuple("---" for _ in COLUMNS)]
    rows += [_row(one) for one in experiment.declared]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _row(setting: Setting) -> tuple[str, ...]:
    unit = "" if setting.unit == "1" else setting.unit
    about = ". ".join(filter(None, (setting.label, setting.help)))
    axis = f"one value: {setting.fixed}" if setting.fixed else ""
    allowed = "; ".join(filter(None, (setting.kind.allowed, axis)))
    return (f"`{setting.key}`", _written(setting.default), unit, allowed, about)


def _written(default: Any) -> str:
    """A default as it is written on the command line."""
    if default is None:
        return "null"
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, dict):
        return "{" + ", ".join(f"{key}: {_written(value)}" for key, value in default.items()) + "}"
    if isinstance(default, list | tuple):
        return "[" + ", ".join(map(_written, default)) + "]"
    return f"{default:.12g}" if isinstance(default, float) else str(default)
