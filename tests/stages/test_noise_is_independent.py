"""Cells of different measurements draw their noise from streams of different names.

A setting that is missing from the name of a stream leaves each single result as probable as it was.
It shows only where cells are averaged: their noise then does not average out.
"""

import pytest
from commands import chosen

from sweeps.engine.resolve.plan import Plan
from sweeps.experiment import EXPERIMENT

RANGE = (
    *("sensor=range", "grid.ship=[duncan,texas]", "grid.aspect=[0,1]", "grid.pulse_width=[10,30]"),
    *("grid.range=[50,100]", "ladar.target_free_ifovs=[3000,4000]", "grid.replicate=2"),
    *("grid.frame_count=1", "render.engine=lines", "render.pixel=1", "render.samples=0"),
)
FLOWN = (
    *("sensor=irar", "grid.ship=[connole,roberts]", "grid.aspect=[175,176]", "grid.replicate=2"),
    *("grid.pulse_width=[10,30]", "irar.depression=[5,6.7]", "render.engine=embree"),
)
TIMED = (
    *("sensor=run_time", "grid.ship=[duncan,texas]", "grid.aspect=[0,1]", "render.engine=embree"),
    *("grid.pulse_width=[10,30]", "run_time.bin_width=[0.5,1]", "grid.frame_count=16"),
)


def streams(stage, *overrides):
    """Return a stage's cells by the names of their streams of noise, and the number of cells."""
    plan = Plan(EXPERIMENT, chosen(*overrides))
    bound = plan.bound[stage]
    return {
        repr(sorted(plan.stream(bound, cell)[1].items())): cell for cell in plan.cells(bound)
    }, len(list(plan.cells(bound)))


@pytest.mark.parametrize(
    ("stage", "overrides", "cells"),
    [
        ("averaged", RANGE, 2**6),  # two values of each of six settings
        ("test_signature", FLOWN, 2**5),
        ("profile_noise", TIMED, 2**4),
    ],
)
def test_no_two_cells_share_a_random_stream(stage, overrides, cells):
    names, count = streams(stage, *overrides)
    assert count == cells
    assert len(names) == cells
