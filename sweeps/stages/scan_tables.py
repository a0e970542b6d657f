"""Tables of scans: shares over all draws, with intervals, and mean times."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ncti.evaluate import wilson_interval

if TYPE_CHECKING:
    import xarray as xr

DRAW = "replicate"
NOWHERE = -1  # of a detection: no target, but the sea
DECOY = "decoy"  # name of the last target
SHARES = {
    "share_detected": ("detected", "ships", "share of ships detected"),
    "share_right": ("right", "detected", "share of ships detected that are identified correctly"),
    "share_wrong": ("wrong", "detected", "share of ships detected that are misidentified"),
    "share_away": ("turned_away", "detected", "share of ships detected that are rejected"),
    "share_found": (
        "right",
        "ships",
        "share of all ships, detected and identified correctly",
    ),
    "share_decoys": ("decoys_detected", "decoys", "share of decoys detected"),
    "share_rejected": (
        *("decoys_rejected", "decoys_detected"),
        "share of decoys detected that are rejected",
    ),
    "share_false_rejected": (
        *("false_rejected", "false"),
        "share of detections of the sea that are rejected",
    ),
}
MEANS = {
    "false_a_field": ("false", "detections of the sea in a field"),
    "alarms_a_field": ("alarms", "pixels of the sea above the threshold in a field"),
    **{
        name: (name, f"mean {label}")
        for name, label in {
            "imaging": "time of the imager",
            "slewing": "time of moves to visits",
            "dwelling": "time of visits",
            "total": "time of the search",
            "alone": "time of the laser radar over the whole field",
        }.items()
    },
}


def tabulate(scan: xr.Dataset, *, ships: int) -> xr.Dataset:
    """Return shares over all draws with 95 % Wilson intervals, and means of counts and times.

    Of scans with so many ships in the field. A share of nothing is NaN, within 0 and 1.
    """
    import xarray as xr

    if DRAW not in scan.dims:
        scan = scan.expand_dims(DRAW)
    done = scan.detected.where(scan.detected >= 0).notnull()  # -1: the cell failed

    def total(name: str) -> xr.DataArray:
        counted = xr.full_like(scan.detected, ships) if name == "ships" else scan[name]
        return counted.where(done).sum(DRAW)

    found: dict[str, xr.DataArray] = {}

    def add(name: str, array: xr.DataArray, label: str, unit: str = "1") -> None:
        found[name] = array.assign_attrs(units=unit, long_name=label)

    add("draws", done.sum(DRAW), "draws of the field")
    for name, (part, whole, label) in SHARES.items():
        hits, trials = xr.broadcast(total(part), total(whole))
        low, high = wilson_interval(hits, trials)
        add(name, hits / trials.where(trials > 0), label)
        for end, bound in (("low", low), ("high", high)):
            add(f"{name}_{end}", hits.copy(data=bound), f"{end} end of its 95 % Wilson interval")
        add(f"{name}_of", trials, "number of trials of the share")
    of_ships = scan.chance.isel(target=slice(ships)).mean("target")
    add("chance", of_ships.where(done).mean(DRAW), "share of ships detected, in closed form")
    for name, (one, label) in MEANS.items():
        unit = str(scan[one].attrs.get("units", "1"))
        add(name, scan[one].where(done).mean(DRAW), label, unit)
    add("gain", found["alone"] / found["total"], "time of the laser radar alone over the search's")
    return xr.Dataset(found)
