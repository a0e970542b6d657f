"""Simulation of one ship by one sensor: labelled results with units, ready to plot.

Examples
--------
>>> import ncti
>>> profile = ncti.simulate.range_profile("duncan", aspect=37)
>>> profile.dims
('down_range',)

`profile.plot()` draws it, and `profile.expected.plot()` adds the average of many frames.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ncti.simulate.flights import flight
    from ncti.simulate.images import infrared_image
    from ncti.simulate.profiles import range_profile

__all__ = ["flight", "infrared_image", "range_profile"]

MODULES = {"flight": "flights", "infrared_image": "images", "range_profile": "profiles"}
"""Module of each function, imported on first access: a profile needs no flights."""


def __getattr__(name: str) -> Any:
    if name in MODULES:
        return getattr(import_module(f"{__name__}.{MODULES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*(name for name in globals() if name.startswith("__")), *__all__})
