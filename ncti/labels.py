"""Units and names of arrays in xarray data sets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

Labelled = tuple[Any, Any, dict[str, str]]


def labelled_array(dims: str | tuple[str, ...], values: Any, units: str, name: str) -> Labelled:
    """Return a variable of an xarray data set, with its unit and its long name."""
    return dims, values, {"units": units, "long_name": name}


def labelled_dataset(columns: Mapping[str, tuple[Any, ...]]) -> xr.Dataset:
    """Return a data set of columns (array, label[, unit]); the unit is "1" by default."""
    import xarray as xr

    dataset = xr.Dataset({name: array for name, (array, *_) in columns.items()})
    for name, (_, label, *unit) in columns.items():
        dataset[name].attrs |= {"units": unit[0] if unit else "1", "long_name": label}
    return dataset
