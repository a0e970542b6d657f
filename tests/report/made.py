"""Tables made by hand, with what a store says of its axes."""

import numpy as np
import xarray as xr

from ncti import ships

ATTRIBUTES = {
    "range": {"units": "km", "long_name": "slant range"},
    "pulse_width": {"units": "ns", "long_name": "pulse width, full width at 1/e^2"},
    "aspect": {"units": "degree", "long_name": "aspect, 0 bow-on, 90 port beam"},
    "depression": {"units": "degree"},
    "aircraft_speed": {"units": "m s-1"},
    "aircraft_heading": {"units": "degree"},
    "aircraft_track": {"units": "degree"},
    "pointing": {"units": "degree"},
    "mirror_angle": {"units": "degree"},
    "ifov": {"units": "urad"},
    "line_rate": {"units": "Hz"},
    "pulse_rate": {"units": "Hz"},
    "jitter_time": {"units": "s"},
    "cnr": {"units": "dB", "long_name": "carrier-to-noise ratio"},
    "extinction": {"units": "dB km-1", "long_name": "extinction of the air"},
    "flown_pulse_width": {"units": "ns"},
    "nedt": {"units": "K"},
}
SHIPS = ("duncan", "horne", "spruance", "texas")
SOURCE = {
    "configuration": {"grid": {"ship": list(SHIPS), "aspect": list(range(0, 91, 3))}},
    "mesh_digests": {name: ships.digest(name) for name in SHIPS},
}
"""Attributes of a store of the article's own ships and aspects, all settings at their defaults."""
FIGURES = ("accuracy", "ci_low", "ci_high", "n")


def with_units(dataset: xr.Dataset) -> xr.Dataset:
    """The same with units and meanings of its axes."""
    for name in set(ATTRIBUTES) & set(dataset.coords):
        dataset[name].attrs = {"units": "1"} | ATTRIBUTES[name]
    return dataset


def scores(seed: int = 0, prefixes=("",), bins=("0-27", "30-57", "overall"), spread=False, **axes):
    """A group of tables: percentages by chance over some axes and aspect bins.

    An axis given as one value is a scalar coordinate; a dict makes a joint axis of its items.
    """
    rng = np.random.default_rng(seed)
    coords, dims = {}, {}
    for name, value in axes.items():
        if isinstance(value, dict):
            dims[name] = len(next(iter(value.values())))
            coords |= {own: (name, list(values)) for own, values in value.items()}
        elif isinstance(value, list | tuple):
            dims[name] = len(value)
            coords[name] = (name, list(value))
        else:
            coords[name] = value
    lowest = [float(label.partition("-")[0]) for label in bins[:-1]]
    coords |= {"aspect_bin": list(bins), "aspect_low": ("aspect_bin", [*lowest, np.nan])}
    data = {}
    for prefix in prefixes:
        own = {
            name: size
            for name, size in dims.items()
            if prefix != "training_" or name not in ("frame_count", "super_resolution", "range")
        }
        shape, over = (*own.values(), len(bins)), (*own, "aspect_bin")
        share = rng.uniform(0.2, 0.8, shape)
        data |= {
            f"{prefix}accuracy": (over, share),
            f"{prefix}ci_low": (over, share - 0.1),
            f"{prefix}ci_high": (over, share + 0.1),
            f"{prefix}n": (over, np.full(shape, 40)),
        }
        if spread:
            data[f"{prefix}spread"] = (over, np.full(shape, 0.05))
    return with_units(xr.Dataset(data, coords, {"receiver": "full_profile"}))


def formed(tables: xr.Dataset, counts=7, views=14, over=("vigilance",)) -> xr.Dataset:
    """Those tables with numbers of categories over some of their axes."""
    sizes = [tables.sizes[name] for name in over]
    return tables.assign(
        category_count=(over, np.broadcast_to(counts, sizes)),
        view_count=(over, np.broadcast_to(views, sizes)),
        settled=(over, np.ones(sizes, dtype="i1")),
    )
