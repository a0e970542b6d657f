"""Tables of run time against error, and the cost of a profile of a given error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.render.view import ROLL
from sweeps.engine.settings import Choices

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]

SPREAD, BIN_WIDTH = 0.5, 1.0
TARGET = 1e-3  # error whose cost is tabulated
VIEWS = ("ship", "aspect")


def tabulate(measured: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return median and worst of all views, for every engine and sampling."""
    return summary(measured).assign_attrs(title="Run time against error, all samplings")


def tabulate_nominal(measured: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the table by engine and pixel, at the default sampling or the nearest to it."""
    return nominal(summary(measured)).assign_attrs(title="Run time against error")


def tabulate_cost(measured: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the cost of a profile of the error `TARGET` by engine."""
    return costs(nominal(summary(measured))).assign_attrs(
        title=f"Cost of a median error of {TARGET:.1%}"
    )


def nominal(table: xr.Dataset) -> xr.Dataset:
    """Return the part of a table that is rolled, spread and binned most nearly as by default."""
    wanted = {"roll": ROLL, "spread": SPREAD, "bin_width": BIN_WIDTH}
    at = {name: value for name, value in wanted.items() if name in table.dims}
    return table.sel(at, method="nearest")


def summary(measured: xr.Dataset) -> xr.Dataset:
    """Return median times, median and worst errors, and the share of answers that changed."""
    import xarray as xr

    found: dict[str, xr.DataArray] = {}

    def add(name: str, array: xr.DataArray, label: str, unit: str = "1") -> None:
        found[name] = array.assign_attrs(units=unit, long_name=label)

    for name in ("run_time", "ratio"):
        about = measured[name].attrs
        label = f"{about['long_name']}; median of views"
        add(name, measured[name].median(VIEWS), label, about["units"])
    for name in ("extent_error", "ifov_error", "profile_error"):
        array, label = measured[name].astype("f8"), measured[name].attrs["long_name"]
        add(f"{name}_median", array.median(VIEWS), f"{label}, median of views")
        add(f"{name}_worst", array.max(VIEWS), f"{label}, worst of views")
    label = f"{measured.changed.attrs['long_name']}, mean of views"
    add("changed", measured.changed.astype("f8").mean(VIEWS), label)
    return xr.Dataset(found)


def costs(table: xr.Dataset) -> xr.Dataset:
    """Return time, ratio and pixel at which the median profile error is `TARGET`."""
    import xarray as xr

    if "pixel" not in table.dims:
        table = table.expand_dims("pixel")
    figures = {
        "run_time": ("time of a view of that error", "s"),
        "ratio": ("that time over a view by embree at 0.25 m, timed alongside", "1"),
        "pixel": ("pixel of that error", "m"),
    }
    error = table.profile_error_median
    return xr.Dataset(
        {
            f"{name}_needed": xr.apply_ufunc(
                at_error,
                table[name],
                error,
                input_core_dims=[["pixel"], ["pixel"]],
                vectorize=True,
            ).assign_attrs(units=unit, long_name=label)
            for name, (label, unit) in figures.items()
        }
    )


def at_error(figure: Floats, error: Floats, target: float = TARGET) -> float:
    """Return a figure where an error is met, by the power law between the pixels around it.

    That of the coarsest pixel if all errors are less, and NaN if all are more, or one is not known.
    """
    order = np.argsort(error)
    if not (np.isfinite(error).all() and np.isfinite(figure).all()) or error[order[0]] > target:
        return np.nan
    floor = np.finfo(np.float64).tiny  # errors may be 0, which has no logarithm
    x, y = np.log(np.maximum(error[order], floor)), np.log(figure[order])
    return float(np.exp(np.interp(np.log(target), x, y)))
