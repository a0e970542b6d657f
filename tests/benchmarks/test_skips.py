"""Exact skips give the same results as the computation without them."""

import pytest
import trimesh

from benchmarks import skips
from benchmarks.classifiers import source_task


@pytest.fixture(scope="module")
def task():
    return source_task(("duncan", "spruance"), (0.0, 45.0), 2)


@pytest.fixture(scope="module")
def barge():
    """Return a ship of few facets, which is not its own mirror image."""
    bounds = ([-50, -6, 0], [50, 6, 6]), ([-5, -4, 6], [15, 3, 12]), ([0, 1, 12], [1, 2, 25])
    boxes = [trimesh.creation.box(bounds=ends) for ends in bounds]
    return trimesh.boolean.union(boxes, engine="manifold")


def test_exact_skips_change_nothing(barge, task):
    """They are equal bit for bit; mirrored range extents by lines round by up to 1e-12.

    By pixels, float32 may put a pixel of an outline on the other side, 1e-3 of an IFOV.
    """
    found = {skip.name: skip.difference() for skip in skips.skips(barge, task) if skip.exact}
    assert len(found) == 9
    mirrored = {name: found.pop(name) for name in list(found) if name.startswith("twins")}
    assert set(found.values()) == {0}
    by_lines, by_pixels = mirrored.values()
    assert by_lines < 1e-12 and by_pixels < 1e-3
