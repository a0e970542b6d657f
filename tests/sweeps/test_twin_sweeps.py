"""One view of a symmetric ship is drawn for port and starboard, and nothing else changes."""

import numpy as np
import pytest
import trimesh
from commands import FAST, chosen, groups_of, swept
from trimesh.creation import box

from sweeps.engine.resolve.plan import Plan
from sweeps.experiment import EXPERIMENT

BOXES = (((-50, -6, 0), (50, 6, 6)), ((-5, -4, 6), (15, 4, 12)), ((0, -0.5, 12), (1, 0.5, 25)))
SMALL = (
    *("grid.frame_count=4", "grid.range=50", "classifier.name=acn", "ladar.target_free_ifovs=10"),
    *(
        "sensor=both",
        "infrared.subpixel_offsets=2",
        "infrared.orders=1",
        "infrared.training_range=25",
    ),
)


def barge(path, *more):
    """Write a file of a ship of boxes, and return the override that names it."""
    boxes = [box(bounds=bounds) for bounds in (*BOXES, *more)]
    trimesh.boolean.union(boxes, engine="manifold").export(path)
    return f"grid.ship={path}"


def drawn(*overrides):
    """Return keys of the range extents of all views, equal where both sides use one."""
    plan = Plan(EXPERIMENT, chosen(*SMALL, *overrides))
    bound = plan.bound["extent"]
    return [plan.key(bound, place) for place in plan.cells(bound)]


@pytest.mark.parametrize("engine", ["lines", "embree"])
def test_skipping_mirrored_views_gives_the_same_results(engine, folder, results):
    """Numbers in float32 are equal within rounding, 2e-6; maps in 255ths and names exactly."""
    ship = barge(folder / "barge.stl")
    overrides = (*SMALL, *FAST, f"render.engine={engine}", "grid.aspect=[40,180,199.7,320]", ship)
    overrides += ("grid.replicate=2",)
    swept(folder / "both.zarr", results, *overrides, "render.skip=[all,none]")
    compared = set()
    for name, group in groups_of(folder / "both.zarr").items():
        for variable in group.data_vars.values():
            if "skip" in variable.dims:
                compared.add(f"{name}/{variable.name}")
                plain, skipped = (variable.sel(skip=word).values for word in ("none", "all"))
                if variable.dtype.kind in "fu":
                    scale = np.abs(plain[np.isfinite(plain)]).max(initial=1)
                    np.testing.assert_allclose(skipped, plain, rtol=0, atol=2e-6 * scale)
                else:
                    assert np.array_equal(skipped, plain), (name, variable.name)
    profiles = {"range_profile/expected", "range_profile/averaged"}
    assert compared > profiles | {"infrared/image", "infrared/log_polar"}


def test_symmetric_ship_needs_one_view_for_both_sides(folder):
    ship = barge(folder / "barge.stl")
    sides = "grid.aspect=[2.7,90,180,270,357.3]"
    keys = drawn(ship, sides)
    assert len(set(keys)) == 3 and keys[0] == keys[4] and keys[1] == keys[3]
    assert len(set(drawn(ship, sides, "render.skip=none"))) == 5
