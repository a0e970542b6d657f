"""Tables of shares identified: the frames that suffice, and the cheapest setting that does."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ncti.labels import labelled_dataset
from studies.operate.costs import CNR, IFOV, relative_cost
from studies.operate.sufficiency import TAILS, cheapest_setting, crossing

if TYPE_CHECKING:
    import xarray as xr

LEVEL = 0.95  # share of views identified that suffices
OVER = ("ifov", "cnr", "pulse_width")  # axes of a setting of the laser radar
UNITS = ("urad", "dB", "ns")
ARTICLE = {"ifov": IFOV * 1e6, "cnr": CNR, "pulse_width": 30.0}
ENDS = ("low end of its 95 % interval", "high end of its 95 % interval")


def frames_needed(operated: xr.Dataset) -> xr.DataArray:
    """Return the fewest frames by which `LEVEL` of the views are identified, interpolated.

    The result keeps the other axes of `share`, and has `resample`: the first entry counts all
    views, the others are `resampled`. It is infinite where the largest frame count does not
    suffice.
    """
    import xarray as xr

    shares = xr.concat([operated.share.expand_dims("resample"), operated.resampled], "resample")
    reach = partial(crossing, places=operated.frame_count.values, level=LEVEL)
    return xr.apply_ufunc(reach, shares, input_core_dims=[["frame_count"]])


def tabulate_frames(operated: xr.Dataset) -> xr.Dataset:
    """Return the frames that suffice near the article's laser radar, with 95 % bootstrap intervals.

    The attribute `infinite` of `frames` holds the text to show for infinity.
    """
    needed = frames_needed(operated.sel(ARTICLE, method="nearest"))
    columns = {"frames": (needed.isel(resample=0), f"frames by which {LEVEL:.0%} are identified")}
    resampled = needed.isel(resample=slice(1, None))
    for name, q, words in zip(("low", "high"), TAILS, ENDS, strict=True):
        end = partial(np.quantile, q=q, method="inverted_cdf")
        columns[f"frames_{name}"] = resampled.reduce(end, "resample"), words
    table = labelled_dataset(columns)
    table.frames.attrs["infinite"] = f"more than {operated.frame_count.values.max():g}"
    return table


def tabulate_cheapest(operated: xr.Dataset) -> xr.Dataset:
    """Return the cheapest setting of the laser radar that suffices, alone and with the imager.

    `cost` has its interval; `chosen` and `best_` with each name of `OVER` are as of
    `cheapest_setting`.
    """
    import xarray as xr

    def cost(frames: Any, cnr: Any, ifov: Any) -> xr.DataArray:
        return xr.apply_ufunc(relative_cost, frames, cnr, ifov * 1e-6)

    needed = frames_needed(operated.sel(channel=["profile", "both"]))
    least = cheapest_setting(cost(needed, needed.cnr, needed.ifov), OVER)
    # Where no setting suffices, infinitely many of any.
    frames = least.cost / cost(1, least.cnr.fillna(CNR), least.ifov.fillna(1.0))
    columns: dict[str, tuple[Any, ...]] = {
        "cost": (least.cost, "energy times aperture area, over the article's sensor"),
        "cost_low": (least.cost_low, ENDS[0]),
        "cost_high": (least.cost_high, ENDS[1]),
        "frames": (frames, "frames of the cheapest setting"),
        "chosen": (least.chosen, "share of resamples in which the setting is the cheapest"),
    }
    for name, unit in zip(OVER, UNITS, strict=True):
        words = f"{name.replace('_', ' ')} of the cheapest setting"
        columns[f"best_{name}"] = least[name], words, unit
    table = labelled_dataset(columns)
    for name in ("cost", "frames"):
        table[name].attrs["infinite"] = "beyond the grid"
    return table
