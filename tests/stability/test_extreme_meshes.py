"""Degenerate, coincident, sliver and needle facets do not change the visible box."""

import hard_meshes
import numpy as np
import pytest

from ncti.ladar import range_extent

VIEWS = (
    {"aspect": 37.0, "depression": 3.84},
    {"aspect": 0.0, "depression": 0.0, "slant_range": 1e3},
    {"aspect": 90.0, "depression": 90.0},
)
HARD = {
    "without area": hard_meshes.with_facets_without_area,
    "coincident": hard_meshes.with_coincident_facets,
    "turned": lambda: hard_meshes.with_coincident_facets(turned=True),
    **{
        f"slivers {e:g}": lambda e=e: hard_meshes.with_slivers(e)
        for e in (1e-3, 1e-6, 1e-9, 1e-15, 1e-300)
    },
    "needle 1e-9": lambda: hard_meshes.with_needle(1e-9),
}


@pytest.mark.parametrize("engine", hard_meshes.ENGINES)
@pytest.mark.parametrize("name", HARD)
def test_degenerate_facets_do_not_change_the_extent(engine, name):
    """The box looks the same as without these facets.

    Lines see the same surfaces, except that crossings within 1e-9 m may change places on a line of
    200 m, and that bent wavefronts are followed by chords, within 1/50 of a bin, wherever a surface
    begins. A pixel or ray whose centre is within 1/256 pixel of an edge may hit a sliver, whose
    plane may be arbitrarily wrong, in place of its neighbour; there are 30 edges of at most 200 m.
    """
    for view in VIEWS:
        far = view.get("slant_range", 1e12)
        plain, hard = (
            range_extent(hard_meshes.see(engine, some, **view), slant_range=far, ifov=15.0 / far)
            for some in (hard_meshes.box(), HARD[name]())
        )
        whole = plain.fraction.sum()
        allowed = 2 * 1e-9 * 200 * 200 / 0.5 / 15.0**2 + (2 / 50 * whole if far < 1e12 else 0.0)
        if engine != "lines":
            allowed = min(2 * 30 * 200.0 * 0.5 / 256 / 15.0**2, 0.1 * whole)
        difference = np.abs(plain.fraction.sum(axis=0) - hard.fraction.sum(axis=0)).sum()
        assert difference <= allowed
