"""Parameter sweeps: `sweep` of a function over a grid, and experiments of declared stages.

Experiments are wired from declarations, configured by Hydra, run by dask and stored by zarr. This
package exports the names to declare them with: `from sweeps import Settings, Output, stage`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweeps.engine.command.line import Command
    from sweeps.engine.declare.display import Display, Figure
    from sweeps.engine.declare.settings import Settings, count, draws, number, switch, text, word
    from sweeps.engine.declare.stage import (
        SHARE,
        At,
        Experiment,
        Group,
        Output,
        Status,
        Stream,
        Table,
        stage,
    )
    from sweeps.engine.function.sweep import sweep

__all__ = [
    "SHARE",
    "At",
    "Command",
    "Display",
    "Experiment",
    "Figure",
    "Group",
    "Output",
    "Settings",
    "Status",
    "Stream",
    "Table",
    "count",
    "draws",
    "number",
    "stage",
    "sweep",
    "switch",
    "text",
    "word",
]
_HOMES = ("declare.settings", "declare.stage", "declare.display", "function.sweep", "command.line")


def __getattr__(name: str) -> Any:
    """Import a name when it is used: the command line starts faster without the others."""
    homes = _HOMES if name in __all__ else ()
    for module in (import_module(f"sweeps.engine.{home}") for home in homes):
        if hasattr(module, name):
            return getattr(module, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
