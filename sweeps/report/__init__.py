"""Reports of stores: on the screen, as a page, as tables, and as charts in notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweeps.report.notebook import chart

__all__ = ["chart"]


def __dir__() -> list[str]:
    """Return the names of the module, with those that are imported when they are used."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    """Import a name when it is used."""
    if name in __all__:
        from sweeps.report import notebook

        return getattr(notebook, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
