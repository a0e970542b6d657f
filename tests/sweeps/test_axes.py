"""A slice of a sweep over several settings equals the sweep of the single values."""

import pytest
import xarray as xr
from commands import FAST, assert_slice, swept

from sweeps.experiment import EXPERIMENT

TINY = (*FAST, "grid.ship=[duncan,spruance]", "grid.aspect=[0,60]", "grid.frame_count=[2,4]")
INFRARED = (
    "sensor=infrared",
    "infrared.range=50",
    "infrared.subpixel_offsets=1",
    "infrared.orders=1",
)
FLOWN = (
    *("sensor=irar", "grid.ship=roberts", "grid.aspect=175", "irar.ifov=1500", "irar.samples=30"),
    *("irar.line_rate=20", "irar.pulse_rate=2000", "irar.detectors=2", "irar.range=3"),
)
# Overrides, and pairs of values of some settings.
AXES = {
    "laser radar": (
        (*TINY, "classifier=all", "classifier.mnn.epochs=5"),
        {"ladar.cnr": (26, 32), "ladar.place": ("corner", "random")},
    ),
    "imager": (
        (*TINY, *INFRARED, "infrared.super_resolution=none"),
        {"infrared.nedt": (0.2, 0.4), "infrared.ifov": (150, 200), "seed": (0, 7)},
    ),
    "flights": (
        (*FAST, *FLOWN, "grid.pulse_width=30"),
        {"irar.cnr": (10, 20), "ladar.cnr": (26, 32)},
    ),
}
UNITS = {setting.key: setting.unit for setting in EXPERIMENT.declared}


@pytest.mark.parametrize("name", AXES)
def test_slices_equal_stores_of_single_values(name, folder, results):
    """The slice is at the last value of each setting, which is given first."""
    overrides, values = AXES[name]
    lists = [f"{key}=[{','.join(map(str, pair[::-1]))}]" for key, pair in values.items()]
    swept(folder / "all.zarr", results, *overrides, *lists)
    tree = xr.open_datatree(folder / "all.zarr", engine="zarr")
    sizes: dict[str, tuple] = {}
    for node in tree.subtree:
        for dim in node.to_dataset().indexes:
            sizes.setdefault(dim, tuple(node[dim].values.tolist()))
            if dim in dimensions(values):
                attrs = node[dim].attrs
                key = dimensions(values)[dim]
                assert attrs["long_name"] and attrs.get("units", "1") == UNITS[key]
    single = [f"{key}={pair[1]}" for key, pair in values.items()]
    reference = folder / "alone.zarr"
    swept(reference, folder / "own", *overrides, *single)
    labels = {dim: values[key][1] for dim, key in dimensions(values).items()}
    assert assert_slice(folder / "all.zarr", reference, **labels) >= set(labels) - {"ladar_cnr"}
    for dim, key in dimensions(values).items():
        assert sizes[dim] == values[key]


def dimensions(values):
    """Return the keys of settings by the names of their dimensions."""
    dims = {"ladar.cnr": "ladar_cnr"} if "irar.cnr" in values else {}
    return {dims.get(key, key.rpartition(".")[2]): key for key in values}
