"""Parameter sweeps: `sweep` of a function over a grid, and the library's experiments.

The experiments are wired from declarations, configured by Hydra, run by dask and stored by zarr.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sweeps.engine.function import sweep

__all__ = ["sweep"]


def __getattr__(name: str) -> Any:
    """Import `sweep` when it is used: the command line starts faster without it."""
    if name == "sweep":
        from sweeps.engine.function import sweep

        return sweep
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
