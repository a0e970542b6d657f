"""The distance of ships is a symmetric measure, and sisters are built at a given distance."""

import numpy as np
import pytest

import ncti
from ncti.features import ship_distance, sister

ASPECTS = [30.0, 150.0]


def test_distance_is_symmetric_and_zero_to_itself() -> None:
    first, second = map(ncti.ships.load, ("connole", "horne"))
    assert ship_distance(first, first, aspects=ASPECTS) == pytest.approx(0, abs=1e-12)
    distance = ship_distance(first, second, aspects=ASPECTS)
    assert distance == pytest.approx(ship_distance(second, first, aspects=ASPECTS), rel=1e-12)
    assert 0.02 < distance < 0.5


def test_sister_has_requested_distance_and_loadable_name() -> None:
    near = sister("connole", 0.004, aspects=ASPECTS, number=2)
    ship = ncti.ships.load("connole")
    assert ship_distance(ship, near, aspects=ASPECTS) == pytest.approx(0.004, rel=0.05)
    again = ncti.ships.load(near.metadata["name"])
    np.testing.assert_array_equal(again.vertices, near.vertices)
    assert near.metadata["name"].startswith("connole@0.2x")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"distance": 0.4}, "distance is 0.4"),
        ({"distance": 0.0}, "distance"),
        ({"aspects": []}, "aspects"),
        ({"name": "connole@0.1"}, "connole"),
    ],
)
def test_invalid_arguments_are_refused(change, message) -> None:
    with pytest.raises(ValueError, match=message):
        sister(**({"name": "connole", "distance": 0.01, "aspects": [30.0]} | change))
