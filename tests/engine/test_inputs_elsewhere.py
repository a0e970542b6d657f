"""Inputs taken at another setting's value (`Stage.at`), also where settings run together."""

from dataclasses import replace

import numpy as np
import pytest
from small_stores import opened
from toys import SPRINGS, Spring, compared, run, without

from sweeps.engine.errors import ConfigurationError
from sweeps.engine.plan import Plan
from sweeps.engine.settings import Joint, read_choices
from sweeps.engine.stage import Output, stage

# Nothing gathers the springs, which then may run together with other settings.
FEWER = replace(without(SPRINGS, "answers"), tables=(), statuses=())
REFERENCES = {"spring.reference": [1.0, 2.0, 4.0], "spring.mass": 1.0}
DESCENDING = ((70.0, 4.0), (80.0, 2.0), (90.0, 1.0))  # places differ from those of the values


def together(keys, points, given=REFERENCES):
    """Choices in which settings run together."""
    values = {key: sorted({point[k] for point in points}) for k, key in enumerate(keys)}
    choices = read_choices(FEWER.declared, {**given, **values})
    return replace(choices, joint=(Joint("joint", keys, points),))


@pytest.mark.parametrize("points", [DESCENDING, DESCENDING[::-1], DESCENDING[1:] + DESCENDING[:1]])
def test_an_input_on_a_joint_axis_is_that_of_the_value_asked_for(tmp_path, points):
    run(FEWER, together(("spring.limit", "spring.stiffness"), points), tmp_path / "s.zarr")
    found = opened(tmp_path / "s.zarr", "references").ratio
    assert found.dims == (
        "mass",
        "stiffness_there",
    )  # what runs together with the stiffness moves with it
    for reference in REFERENCES["spring.reference"]:
        run(
            FEWER,
            read_choices(
                FEWER.declared,
                {
                    "spring.stiffness": reference,
                    "spring.reference": reference,
                    "spring.mass": 1.0,
                    "spring.limit": dict((b, a) for a, b in points)[reference],
                },
            ),
            tmp_path / f"{reference}.zarr",
        )
        alone = opened(tmp_path / f"{reference}.zarr", "references").ratio
        assert float(found.sel(stiffness_there=reference).squeeze()) == float(alone.squeeze())


def test_what_the_input_does_not_need_stays_where_it_is():
    """The seed runs together with the stiffness, and draws no period."""
    plan = Plan(FEWER, together(("seed", "spring.stiffness"), ((1, 4.0), (2, 2.0), (3, 1.0))))
    bound, source = plan.bound["compared"], plan.bound["period"]
    for place in plan.cells(bound):
        there = plan.source_place(bound, source, place)
        value = plan.value(source, "spring.stiffness", there)
        assert value == plan.value(bound, "spring.reference", place)


def test_the_own_place_is_kept_where_it_has_the_value():
    """Both on one axis: the stiffness of each place is its own reference."""
    points = tuple((one, 100 - one, one) for one in (4.0, 1.0, 2.0))
    keys = ("spring.stiffness", "spring.limit", "spring.reference")
    plan = Plan(FEWER, together(keys, points, {"spring.mass": 1.0}))
    bound = plan.bound["compared"]
    for place in plan.cells(bound):
        assert plan.source_place(bound, plan.bound["period"], place) == place


@stage(
    Output("kept", label="period there, and the limit here", dtype="f8"),
    uses=(Spring,),
    at={Spring.stiffness: Spring.reference},
    group="references",
)
def limited(period, limit):
    """Use of what runs together with the value taken elsewhere."""
    return np.minimum(period, limit)


ALONE = (
    "spring.stiffness runs together with other settings, but must run alone because {} takes "
    "period at the value of spring.reference"
)


def test_a_place_that_is_left_open_is_refused():
    twice = ((1.0, 90.0), (1.0, 80.0), (2.0, 70.0))
    keys = ("spring.stiffness", "spring.limit")
    with pytest.raises(ConfigurationError) as refused:
        Plan(FEWER, together(keys, twice, {"spring.reference": 1.0}))
    assert str(refused.value) == ALONE.format("compared")
    mixed = replace(FEWER, stages=(*FEWER.stages[:-1], limited))
    with pytest.raises(ConfigurationError) as refused:
        Plan(mixed, together(("spring.limit", "spring.stiffness"), DESCENDING))
    assert str(refused.value) == ALONE.format("limited")


@pytest.mark.parametrize("stiffness", [4.0, [1.0, 4.0]])
def test_a_value_that_the_axis_lacks_is_named(stiffness):
    with pytest.raises(ConfigurationError) as refused:
        Plan(
            FEWER,
            read_choices(FEWER.declared, {"spring.stiffness": stiffness, "spring.reference": 2.0}),
        )
    assert str(refused.value) == (
        "spring.reference has 2, but every value must be one of spring.stiffness, because "
        f"{compared.name} takes period there"
    )
