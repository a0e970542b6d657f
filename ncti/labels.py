"""Units and names of arrays, as data sets of xarray have them."""

from __future__ import annotations

from typing import Any

Labelled = tuple[Any, Any, dict[str, str]]


def labelled(dims: str | tuple[str, ...], values: Any, units: str, name: str) -> Labelled:
    """Return a variable of an xarray data set, with its unit and its long name."""
    return dims, values, {"units": units, "long_name": name}
