"""Helpers that make tables, with the attributes that describe their axes and layout."""

import numpy as np
import xarray as xr

from ncti import ships
from sweeps.engine.declare.display import ATTRIBUTE
from sweeps.engine.declare.storable import encode_attrs
from sweeps.stages.scores import category_display, score_displays

UNITS = {"range": "km", "pulse_width": "ns", "aspect": "degree", "cnr": "dB", "ifov": "urad"}
SHIPS = ("duncan", "horne", "spruance", "texas")
SOURCE = {
    "configuration": {
        "grid": {"ship": list(SHIPS), "aspect": list(range(0, 91, 3))},
        "ladar": {"place": "corner"},
    },
    "mesh_digests": {name: ships.digest(name) for name in SHIPS},
}
"""Attributes of a store of the article's own ships and aspects, with the article's settings."""
BINS = ("0-27", "30-57", "overall")


def scores(seed=0, prefixes=("",), bins=BINS, **axes):
    """Return a dataset of random percentages over given axes and aspect bins.

    An axis given as one value is a scalar coordinate; a dict makes a joint axis of its items.
    """
    rng = np.random.default_rng(seed)
    coords, dims = {}, {}
    for name, value in axes.items():
        if isinstance(value, dict):
            dims[name] = len(next(iter(value.values())))
            coords |= {coordinate: (name, list(values)) for coordinate, values in value.items()}
        elif isinstance(value, list | tuple):
            dims[name] = len(value)
            coords[name] = (name, list(value))
        else:
            coords[name] = value
    coords["aspect_bin"] = list(bins)
    data = {}
    for prefix in prefixes:
        sizes = {
            name: size
            for name, size in dims.items()
            if prefix != "training_" or name != "frame_count"
        }
        over = (*sizes, "aspect_bin")
        share = rng.uniform(0.2, 0.8, (*sizes.values(), len(bins)))
        data |= {
            f"{prefix}accuracy": (over, share),
            f"{prefix}ci_low": (over, share - 0.1),
            f"{prefix}ci_high": (over, share + 0.1),
            f"{prefix}n": (over, np.full(share.shape, 40)),
        }
    table = xr.Dataset(data, coords, {"receiver": "full_profile"})
    for name in set(UNITS) & set(table.coords):
        table[name].attrs = {"units": UNITS[name], "long_name": f"the {name}"}
    return table


def displayed(tables, classifier="acn", **more):
    """Return the tables with the attributes that display a classifier's scores."""
    labels = {"classifier": classifier, "channel": "range"}
    displays = score_displays(labels, scored="ship", source=classifier, chance=(25.0, 25.0))
    attributes = [display.as_attribute(None) for display in (*displays, *more.values())]
    return tables.assign_attrs(encode_attrs({ATTRIBUTE: attributes}))


def categories(counts, views=124, **axes):
    """Return a dataset of numbers of categories over given axes, with its display."""
    shape = [len(values) for values in axes.values()]
    table = xr.Dataset(
        {
            "categories": (tuple(axes), np.broadcast_to(float(counts), shape)),
            "views": (tuple(axes), np.broadcast_to(views, shape)),
        },
        {name: (name, values) for name, values in axes.items()},
    )
    display = category_display({"classifier": "acn", "channel": "range"}, "acn").as_attribute(None)
    return table.assign_attrs(encode_attrs({ATTRIBUTE: [display]}) | {"receiver": "full_profile"})
