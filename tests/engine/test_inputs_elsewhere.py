"""`At` takes inputs at another setting's value, also where settings run together."""

from dataclasses import replace

import pytest
from small_stores import opened
from toys import SPRINGS, having, run, without

from sweeps.engine.declare.settings import ZippedAxis, read_choices

# Without stages that gather springs, their settings may run together with others.
FEWER = having(without(SPRINGS, "answers"), tables=())
REFERENCES = {"spring.reference": [1.0, 2.0, 4.0], "spring.mass": 1.0}
DESCENDING = ((70.0, 4.0), (80.0, 2.0), (90.0, 1.0))  # not in the order of sorted stiffnesses


def together(keys, points, given=REFERENCES):
    """Return choices in which the settings `keys` run together, point by point."""
    values = {key: sorted({point[k] for point in points}) for k, key in enumerate(keys)}
    choices = read_choices(FEWER.declared, {**given, **values})
    return replace(choices, zipped=(ZippedAxis("joint", keys, points),))


@pytest.mark.parametrize("points", [DESCENDING, DESCENDING[::-1], DESCENDING[1:] + DESCENDING[:1]])
def test_an_input_on_a_joint_axis_is_that_of_the_value_asked_for(tmp_path, points):
    run(FEWER, together(("spring.limit", "spring.stiffness"), points), tmp_path / "s.zarr")
    results = opened(tmp_path / "s.zarr", "references").ratio
    assert results.dims == (
        "mass",
        "stiffness_there",
    )  # the limit that runs together with the stiffness gets no dimension of its own
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
        reference_results = opened(tmp_path / f"{reference}.zarr", "references").ratio
        assert float(results.sel(stiffness_there=reference).squeeze()) == float(
            reference_results.squeeze()
        )
