"""Ship identification by laser-radar range profiles: pure functions from ship sheet to score.

Packages, in the order the data flows: `ships`, `render`, `ladar`, `infrared`, `irar`, `search`,
`features`, `classify`, `evaluate`. Each imports only from those before it; `classify` and
`evaluate` see plain arrays and import none of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ncti import (
        classify,
        evaluate,
        features,
        infrared,
        irar,
        ladar,
        render,
        search,
        ships,
        simulate,
    )

__all__ = [
    "classify",
    "evaluate",
    "features",
    "infrared",
    "irar",
    "ladar",
    "render",
    "search",
    "ships",
    "simulate",
]


def __getattr__(name: str) -> Any:
    # Imported when it is first asked for, so that using one package does not wait for the others.
    if name in __all__:
        return import_module(f"{__name__}.{name}")
    if name == "__version__":
        from importlib.metadata import version

        return version("ncti-sweep")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
