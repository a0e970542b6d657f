"""The scanning mirror's rotation matches finite differences, its sign, and the printed limit."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ncti.irar import mirror_rotation
from ncti.irar.mirror import compass_directions

depressions = st.floats(0.1, 60)
mirror_angles = st.floats(2, 80)
STEP = 1e-4


def reflected(along, across, *, depression, mirror_angle, azimuth):
    """Return the direction of a beam, turned in the scanner, after a plane mirror reflects it.

    The mirror reflects the level, undeflected beam to the depression: its normal is along the sum
    of the directions to the source and to the ship.
    """
    source, ship = (
        compass_directions(azimuth + 2 * mirror_angle, 0),
        compass_directions(azimuth, -depression),
    )
    normal = (source + ship) / np.linalg.norm(source + ship)
    incident = -compass_directions(
        azimuth + 2 * mirror_angle - np.degrees(along), -np.degrees(across)
    )
    return incident - 2 * (incident @ normal) * normal


@given(depressions, mirror_angles, st.floats(-360, 360))
def test_mirror_rotation_matches_finite_differences(depression, mirror_angle, azimuth):
    """Central differences of the reflection, exact to STEP^2 = 1e-8, agree with the closed form.

    Reflection keeps angles, so turns to the right and up become orthogonal axes of the image,
    rotated by one angle.
    """
    pose = {"depression": depression, "mirror_angle": mirror_angle, "azimuth": azimuth}
    turned = np.array(
        [
            (reflected(STEP, 0, **pose) - reflected(-STEP, 0, **pose)) / (2 * STEP),
            (reflected(0, STEP, **pose) - reflected(0, -STEP, **pose)) / (2 * STEP),
        ]
    )
    away, right = compass_directions(azimuth, -depression), compass_directions(azimuth + 90, 0)
    image = turned @ np.stack([right, np.cross(right, away)]).T
    angle = math.radians(mirror_rotation(depression, mirror_angle=mirror_angle))
    c, s = math.cos(angle), math.sin(angle)
    # An upright object, (0, 1), has s along the scan and c across it: clockwise by the angle.
    np.testing.assert_allclose(image, [[c, s], [-s, c]], atol=3e-8)


@given(mirror_angles)
def test_the_printed_form_is_the_limit_for_small_depressions(mirror_angle):
    """The exact tangent exceeds it by a share of gamma^2 / (2 (1 + cos 2 psi)), gamma = 0.01."""
    tangent = {
        form: math.tan(
            math.radians(mirror_rotation(math.degrees(0.01), mirror_angle=mirror_angle, form=form))
        )
        for form in ("exact", "printed")
    }
    bend = 0.01**2 / (2 * (1 + math.cos(math.radians(2 * mirror_angle))))
    assert tangent["exact"] / tangent["printed"] - 1 == pytest.approx(bend, rel=2 * bend + 1e-6)
