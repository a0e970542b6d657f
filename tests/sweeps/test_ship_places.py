"""Ships are at the corner of the grid of IFOVs, or at another place for each draw."""

from functools import cache
from pathlib import Path

import pytest
from commands import FAST, chosen
from trimesh.creation import box

from ncti.ladar import spread_place
from ncti.render import line_image
from sweeps.engine.cache.index import CellIndex
from sweeps.engine.objects import Objects
from sweeps.engine.resolve.plan import Plan
from sweeps.engine.run.schedule import Schedule
from sweeps.experiment import EXPERIMENT
from sweeps.stages import ladar, likelihood
from sweeps.stages.classifier import AspectSelection

GIVEN = (
    *(*FAST, "grid.ship=[duncan,spruance]", "grid.aspect=[0,60]", "grid.frame_count=[2,16]"),
    *("classifier=all", "classifier.mnn.epochs=5"),
)


@cache
def plan_of(*overrides):
    return Plan(EXPERIMENT, chosen(*GIVEN, *overrides))


def to_make(*overrides):
    """Return the number of range extents that a sweep with an empty cache makes."""
    schedule = Schedule(plan_of(*overrides))
    schedule.look_up(CellIndex(Objects(Path("none")), print))
    extents = {"extent", "offset_extent", "placed_extent"}
    return sum(cells for bound, cells, _ in schedule.missing_cells if bound.name in extents)


def keys(stage, *overrides):
    plan = plan_of(*overrides)
    return {plan.key(plan.bound[stage], place) for place in plan.cells(plan.bound[stage])}


def test_one_range_extent_is_made_per_ship_place():
    """Templates have eight places, the corner among them; a draw has one of its own."""
    views, corner = 4, "ladar.place=corner"
    assert to_make(corner, "classifier.template_places=1") == views
    assert to_make(corner) == 8 * views
    assert to_make() == (8 + 1) * views
    assert to_make("grid.replicate=3") == (8 + 3) * views
    assert keys("offset_extent", corner) == keys("extent") == keys("extent", "grid.replicate=3")
    assert keys("expected") < keys("placed_profile")
    assert keys("expected") == keys("placed_profile", "classifier.template_places=1")
    # Views that are not learned are no templates.
    training = "classifier.training_aspect=[60]"
    assert to_make(training) == (1 + 1) * 2 + (8 + 1) * 2
    unknown = ("classifier.unknown=[spruance]", training)
    assert to_make(*unknown) == (1 + 1) * 3 + (8 + 1)


@pytest.mark.parametrize("number", [0, 1, 5])
def test_template_place_is_mirrored_for_the_opposite_side(number):
    shift, mirrored_shift = (
        likelihood.template_offset(
            number, "duncan", 300.0, side, None, None, AspectSelection(None, None, ())
        )
        for side in (300.0, 60.0)
    )
    assert shift == spread_place(number)
    image = line_image(box((60.0, 10.0, 8.0)), aspect=60, depression=3.84, spacing=0.5)
    ifovs = ladar.ifovs(ladar.extent(image, slant_range=100e3, shift=mirrored_shift), 300.0, 60.0)
    assert ifovs.shift == shift
