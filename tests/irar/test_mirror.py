"""The scanning mirror: its lean by finite differences, its sign, the printed form's limit."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ncti.irar import mirror_rotation
from ncti.irar.mirror import beam, compass

depressions = st.floats(0.1, 60)
mirror_angles = st.floats(2, 80)
STEP = 1e-4


def image(depression, mirror_angle, *, azimuth=0.0):
    """(axis of the scanner, axis of the image): what turns to the right and up become."""

    def directions(along, across):
        return beam(
            np.array(along),
            np.array(across),
            azimuth=azimuth,
            depression=depression,
            mirror_angle=mirror_angle,
        )

    away, right = compass(azimuth, -depression), compass(azimuth + 90, 0)
    axes = np.stack([right, np.cross(right, away)])
    turned = [
        (directions(STEP, 0.0) - directions(-STEP, 0.0)) / (2 * STEP),
        (directions(0.0, STEP) - directions(0.0, -STEP)) / (2 * STEP),
    ]
    return np.array(turned) @ axes.T


@given(depressions, mirror_angles, st.floats(-360, 360))
def test_the_undeflected_beam_goes_where_it_points(depression, mirror_angle, azimuth):
    middle = np.zeros(())
    found = beam(middle, middle, azimuth=azimuth, depression=depression, mirror_angle=mirror_angle)
    np.testing.assert_allclose(found, compass(azimuth, -depression), atol=1e-14)


@given(depressions, mirror_angles, st.floats(-360, 360))
def test_the_image_is_turned_by_the_exact_angle(depression, mirror_angle, azimuth):
    """Central differences of the reflection, true to STEP^2 = 1e-8, against the closed form.

    Reflection keeps angles: turns to the right and up become orthogonal axes of the image, turned
    together. A beam that turns right on the ship leaves the scanner turned right.
    """
    turned = image(depression, mirror_angle, azimuth=azimuth)
    angle = math.radians(mirror_rotation(depression, mirror_angle=mirror_angle))
    c, s = math.cos(angle), math.sin(angle)
    # An object upright on the ship lies along (s, c) in scanner axes: clockwise by the angle.
    np.testing.assert_allclose(turned, [[c, s], [-s, c]], atol=3e-8)
    np.testing.assert_allclose(np.array([0.0, 1.0]) @ turned.T, [s, c], atol=3e-8)


@given(depressions, mirror_angles)
def test_a_turn_keeps_its_size(depression, mirror_angle):
    """Rigid: an angle before the mirror is the same angle behind it."""
    along = np.array([-0.02, 0.0, 0.03])
    found = beam(along, np.zeros(3), azimuth=30, depression=depression, mirror_angle=mirror_angle)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-14)
    apart = 2 * np.arcsin(np.linalg.norm(np.diff(found, axis=0), axis=-1) / 2)
    np.testing.assert_allclose(apart, np.diff(along), rtol=0, atol=1e-14)


@given(depressions)
def test_a_lateral_beam_turns_the_image_by_the_depression(depression):
    assert mirror_rotation(depression) == pytest.approx(-depression, rel=1e-12)


def test_an_upright_object_leans_to_the_left():
    """The article corrects by a clockwise rotation: its theta_v, and ours, are negative."""
    right, up = np.linalg.solve(image(6.7, 45.0).T, [0.0, 1.0])
    assert right < 0 < up
    assert mirror_rotation(6.7) < 0 and mirror_rotation(6.7, form="printed") < 0
    assert mirror_rotation(0.0) == 0


@given(mirror_angles)
def test_the_printed_form_is_the_limit_for_small_depressions(mirror_angle):
    """tan theta differs by a relative gamma^2 (1 / (2 (1 + cos 2 psi))) (1 + O(gamma^2)).

    With cos(gamma) = 1 - gamma^2 / 2 in the denominator of the exact form.
    """
    bend = 1 / (2 * (1 + math.cos(math.radians(2 * mirror_angle))))
    for gamma in (0.01, 0.02, 0.04):
        exact, printed = (
            math.tan(
                math.radians(
                    mirror_rotation(math.degrees(gamma), mirror_angle=mirror_angle, form=form)
                )
            )
            for form in ("exact", "printed")
        )
        assert exact / printed - 1 == pytest.approx(bend * gamma**2, rel=2 * bend * gamma**2 + 1e-9)


@pytest.mark.parametrize(("depression", "off", "digit"), [(6.7, 0.05, 0.01), (20, 1.1, 0.1)])
def test_the_printed_form_is_off_by_what_its_docstring_says(depression, off, digit):
    exact, printed = mirror_rotation(depression), mirror_rotation(depression, form="printed")
    assert printed == pytest.approx(-math.degrees(math.atan(math.sin(math.radians(depression)))))
    assert printed - exact == pytest.approx(off, abs=digit / 2)


def test_compass_points():
    np.testing.assert_allclose(
        compass([0, 90, 180, 270, 0], [0, 0, 0, 0, 90]),
        [[0, 1, 0], [1, 0, 0], [0, -1, 0], [-1, 0, 0], [0, 0, 1]],
        atol=1e-15,
    )


@pytest.mark.parametrize(
    ("given_", "message"),
    [
        ({"depression": -1}, "depression is -1, but must be .* at least 0"),
        ({"depression": 90}, "depression is 90, but must be .* below 90"),
        ({"depression": math.nan}, "depression is nan"),
        ({"mirror_angle": 0}, "mirror_angle is 0, but must be .* above 0"),
        ({"mirror_angle": 90}, "mirror_angle is 90"),
        ({"form": "plain"}, "form is 'plain', but must be one of exact, printed"),
    ],
)
def test_bad_parameters_are_named(given_, message):
    arguments = {"depression": 6.7} | given_
    with pytest.raises(ValueError, match=message):
        mirror_rotation(arguments.pop("depression"), **arguments)
