"""Helpers of the irar tests: flights, simple scenes, and exact geometry in extended precision."""

import numpy as np
import trimesh
from hypothesis import strategies as st

from ncti.irar import Flight, ship_heading

CLEAN = 1e8
"""A carrier-to-noise ratio at which the noise is negligible."""


def flight(aspect=175.0, offset=5.0, slant_range=3900.0, **changes):
    """Return a flight with the study's geometry that sees the ship at an aspect."""
    heading = ship_heading(aspect=aspect, sight=offset + changes.get("aircraft_heading", 0.0))
    return Flight(slant_range=slant_range, ship_heading=heading, offset=offset, **changes)


@st.composite
def flights(draw):
    """Draw passes of any heading, with leeway, that point up to 1 deg beside the ship."""
    offset, heading = draw(st.floats(-20, 20)), draw(st.floats(-180, 180))
    return flight(
        aspect=draw(st.floats(0, 360)),
        offset=offset,
        slant_range=draw(st.floats(1500, 30_000)),
        depression=draw(st.floats(2, 25)),
        aircraft_speed=draw(st.floats(60, 250)),
        ship_speed=draw(st.floats(0, 15)),
        aircraft_heading=heading,
        aircraft_track=draw(st.none() | st.floats(heading - 5, heading + 5)),
        pointing=offset + draw(st.floats(-1, 1)),
        mirror_angle=draw(st.floats(20, 60)),
        samples=160,
    )


def pole_on_box(length, beam, height, pole):
    """Return a box hull on the waterline with a slender upright pole amidships."""
    hull = trimesh.creation.box((length, beam, height)).apply_translation((0, 0, height / 2))
    mast = trimesh.creation.box((1.6, 1.6, pole)).apply_translation((0, 0, height + pole / 2))
    return trimesh.util.concatenate([hull, mast])


def seen_from(flown, point, time):
    """Return the vector from the aircraft to a point at some times, straight from the speeds.

    The result is (..., 3) in extended precision: right, up and away in the snapshot's axes [m].
    """
    long = np.longdouble
    azimuth = np.radians(long(flown.aircraft_heading + flown.offset))
    down = np.radians(long(flown.depression))
    heading = np.radians(long(flown.ship_heading))
    track = flown.aircraft_heading if flown.aircraft_track is None else flown.aircraft_track
    track = np.radians(long(track))
    # East, north and up of the point from the ship's origin: x ahead, y to port.
    x, y, z = (np.asarray(coordinate, long) for coordinate in np.moveaxis(np.asarray(point), -1, 0))
    east = x * np.sin(heading) - y * np.cos(heading)
    north = x * np.cos(heading) + y * np.sin(heading)
    time = np.asarray(time, long)
    east = east + flown.slant_range * np.cos(down) * np.sin(azimuth)
    east = east + time * (flown.ship_speed * np.sin(heading) - flown.aircraft_speed * np.sin(track))
    north = north + flown.slant_range * np.cos(down) * np.cos(azimuth)
    north = north + time * (
        flown.ship_speed * np.cos(heading) - flown.aircraft_speed * np.cos(track)
    )
    above = z - flown.slant_range * np.sin(down)
    ahead = east * np.sin(azimuth) + north * np.cos(azimuth)
    right = east * np.cos(azimuth) - north * np.sin(azimuth)
    up = above * np.cos(down) + ahead * np.sin(down)
    away = ahead * np.cos(down) - above * np.sin(down)
    return np.stack(np.broadcast_arrays(right, up, away), axis=-1)


def scanned_at(flown, point, time):
    """Return the scan angle of points at some times, and their angle above the scan plane.

    The result is (..., 2) in extended precision [rad]. The scanner's axes are those of the middle
    of the scan, turned about it by the mirror.
    """
    right, up, away = np.moveaxis(seen_from(flown, point, time), -1, 0)
    down = np.radians(np.longdouble(flown.depression))
    pointing = flown.offset if flown.pointing is None else flown.pointing
    aside = np.radians(np.longdouble(pointing - flown.offset))
    # About the vertical to where the scan points, then about the beam by the mirror.
    ahead, above = away * np.cos(down) + up * np.sin(down), up * np.cos(down) - away * np.sin(down)
    ahead, right = (
        ahead * np.cos(aside) + right * np.sin(aside),
        right * np.cos(aside) - ahead * np.sin(aside),
    )
    up, away = (
        above * np.cos(down) + ahead * np.sin(down),
        ahead * np.cos(down) - above * np.sin(down),
    )
    psi = np.radians(np.longdouble(flown.mirror_angle))
    lean = -np.arctan2(np.sin(down) * np.sin(2 * psi), np.cos(down) + np.cos(2 * psi))
    along = right * np.cos(lean) + up * np.sin(lean)
    across = up * np.cos(lean) - right * np.sin(lean)
    return np.stack([np.arctan2(along, away), np.arctan2(across, np.hypot(along, away))], axis=-1)


def crossing(flown, point, *, early=-60.0, late=60.0):
    """Return when lines of an endless scan meet points [s], by bisection to 1e-12 s."""
    early = np.full(np.shape(point)[:-1], early, np.longdouble)
    late = np.full_like(early, late)
    assert (scanned_at(flown, point, early)[..., 1] > 0).all()
    assert (scanned_at(flown, point, late)[..., 1] < 0).all()
    for _ in range(60):
        middle = (early + late) / 2
        above = scanned_at(flown, point, middle)[..., 1] > 0
        early, late = np.where(above, middle, early), np.where(above, late, middle)
    return late
