"""Fusion takes silhouettes at the range of the profiles, whatever runs together with it."""

import pytest
from commands import FAST, chosen

from sweeps.engine.plan import Plan
from sweeps.experiment import EXPERIMENT

SILHOUETTES = ("silhouette_scores", "silhouette_constants")


@pytest.mark.parametrize("zipped", ["[[infrared.ifov,infrared.range]]", "null"])
def test_silhouettes_are_of_the_range_of_the_profiles(zipped):
    choices = chosen(
        *FAST,
        *("sensor=both", "classifier=fusion", "grid.ship=[duncan,texas]", "grid.aspect=[0,45,90]"),
        *("grid.range=[25,50]", "infrared.ifov=[100,200]", "infrared.range=[50,25]"),
        f"grid.zip={zipped}",
    )
    plan = Plan(EXPERIMENT, choices)
    bound = plan.bound["fusion"]
    met = set()
    for place in plan.cells(bound):
        for name in SILHOUETTES:
            source = plan.bound[name]
            (_, there), *_ = plan.sources(bound, source, place)
            seen = plan.value(source, "infrared.range", there)
            ifov = plan.value(source, "infrared.ifov", there)
            assert seen == plan.value(bound, "grid.range", place)
            met.add((seen, ifov))
    pairs = {(50.0, 100.0), (25.0, 200.0)}
    crossed = {(50.0, 200.0), (25.0, 100.0)}
    assert met == (pairs | crossed if zipped == "null" else pairs)
