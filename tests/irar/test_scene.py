"""The scene finds the hits of all rays while skipping sea samples; plans cover the whole ship."""

import numpy as np
import pytest
import trimesh
from flown import flight, pole_on_box, scanned_at
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ncti.irar.scene import RAYS, plan_scan, scan_scene
from ncti.render import cast_rays

BOX = trimesh.creation.box((60.0, 9.0, 5.0)).apply_translation((0, 0, 2.5))


def every_ray(mesh, plan, *, leading=0, attitude=None):
    """Cast all rays of a scan at once, and return their hits, origins and directions."""
    flown = plan.flight
    columns = np.arange(-leading, flown.samples)
    time = plan.time(columns)[..., None]
    off = np.zeros((plan.lines, 2)) if attitude is None else attitude
    angles = (np.arange(RAYS) - (RAYS - 1) / 2) * flown.ifov / RAYS
    along = flown.scan_angles(columns)[:, None] + np.tile(angles, RAYS) + off[:, :1, None]
    across = np.broadcast_to(np.repeat(angles, RAYS) + off[:, 1:, None], along.shape)
    way = flown.directions(along, across)
    origin = np.broadcast_to(flown.position(time), way.shape)
    hits = cast_rays(mesh, origin.reshape(-1, 3), way.reshape(-1, 3))
    return hits, origin.reshape(-1, 3), way.reshape(-1, 3)


@pytest.mark.parametrize("jitter", [False, True])
@pytest.mark.parametrize("aspect", [175.0, 100.0])
def test_skipping_sea_samples_loses_no_hits(aspect, jitter):
    """The hits equal those of casting every ray of the scan, in the same order."""
    mesh = pole_on_box(60, 9, 5, 20)
    plan = plan_scan(mesh, flight(aspect, samples=150, line_rate=40))
    rng = np.random.default_rng(3)
    attitude = rng.normal(scale=3e-4, size=(plan.lines, 2)) if jitter else None
    scene = scan_scene(mesh, plan, leading=11, attitude=attitude)
    hits, _, _ = every_ray(mesh, plan, leading=11, attitude=attitude)
    np.testing.assert_array_equal(scene.place * RAYS**2 + scene.ray, hits.ray)
    # Sums of products in blocks of other sizes are rounded in another order.
    np.testing.assert_allclose(scene.distance, hits.distance, rtol=0, atol=5e-12)
    assert (np.diff(scene.place) >= 0).all() and len(scene.place) > 1000
    assert scene.shape == (plan.lines, 161)
    np.testing.assert_array_equal(scene.power, np.full(len(hits.ray), 1 / RAYS**2))


@settings(deadline=None, max_examples=40)
@given(
    aspect=st.floats(0, 360),
    offset=st.floats(-25, 25),
    slant_range=st.floats(1500, 30_000),
    depression=st.floats(2, 25),
    aircraft_speed=st.floats(40, 250),
    ship_speed=st.floats(0, 15),
    mirror_angle=st.floats(20, 60),
    length=st.floats(20, 180),
    mast=st.floats(5, 50),
)
def test_a_plan_sees_the_whole_ship(aspect, offset, length, mast, **given_):
    """Every corner lies above the first line and below the last.

    The plan leaves a margin of three pixels at the pace of the slowest corner below and above; as
    the pace changes a little within it, the test requires two and a half.
    """
    mesh = pole_on_box(length, length / 9, length / 25, mast)
    flown = flight(aspect, offset, samples=9000, pulse_rate=1e9, range_gate=5000.0, **given_)
    try:
        plan = plan_scan(mesh, flown)
    except ValueError as refusal:
        assert str(refusal).split()[0] in ("slant_range", "offset")
        assume(False)
    flown = plan.flight
    corners = np.asarray(mesh.vertices)
    times = plan.time(np.array([0, flown.samples - 1]))
    first = scanned_at(flown, corners, times[0, 1])[:, 1] / flown.ifov
    last = scanned_at(flown, corners, times[-1, 0])[:, 1] / flown.ifov
    assert first.min() > 2.5
    assert last.max() < -2.5


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"samples": 60}, r"^samples is 60, .* at least \d+"),
        ({"range_gate": 40.0}, r"^range_gate is 40 m, .* at least 53"),
        ({"slant_range": 100.0}, r"^slant_range is 100 m, .* at least \d+ m, twice"),
        ({"line_rate": 50_000.0, "pulse_rate": 1e8}, r"^line_rate is 50000, .* at most"),
        ({"depression": 0.01}, r"^slant_range is 3900 m, .* at least \d+ m, twice"),
        ({"pointing": 60.0}, r"^pointing is 60, .* nearer 5"),
        ({"offset": 60.0}, r"^offset is 60, .* nearer 0"),
    ],
)
def test_infeasible_pass_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        plan_scan(BOX, flight(**({"aspect": 140.0} | changes)))


def test_invalid_reflectivity_is_refused():
    plan = plan_scan(BOX, flight(140.0))
    with pytest.raises(ValueError, match=r"reflectivity has shape \(5,\), but must be \(12,\)"):
        scan_scene(BOX, plan, reflectivity=np.ones(5))
    with pytest.raises(ValueError, match=r"reflectivity is -0\.1, but must be .* at least 0"):
        scan_scene(BOX, plan, reflectivity=np.full(12, -0.1))
