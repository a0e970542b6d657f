"""Scenes with known closed forms, and flights past them."""

import numpy as np
import trimesh

from ncti.irar import Flight, Pass, Returns, ScanPlan, ship_heading

CLEAN = 1e8
"""A carrier-to-noise ratio beside which the noise is nothing."""


def flight(aspect=175.0, offset=5.0, slant_range=3900.0, **changes):
    """A pass of the study's kind, at an aspect."""
    heading = ship_heading(aspect=aspect, sight=offset + changes.get("aircraft_heading", 0.0))
    return Flight(slant_range=slant_range, ship_heading=heading, offset=offset, **changes)


def pole_on_box(length=120.0, beam=14.0, height=6.0, pole=30.0, width=1.6):
    """A hull with a slender upright pole on its middle, standing on the waterline."""
    hull = trimesh.creation.box((length, beam, height)).apply_translation((0, 0, height / 2))
    mast = trimesh.creation.box((width, width, pole)).apply_translation((0, 0, height + pole / 2))
    return trimesh.util.concatenate([hull, mast])


def wall(lines, samples, *, distance=None, **changes):
    """A scan of a wall that faces the line of sight and fills it all, at one distance [m]."""
    seen = flight(samples=samples, pulse_rate=1e6, **changes)
    plan = ScanPlan(seen, 0, lines)
    last = seen.detectors - 1
    shape = lines, samples + last
    count = lines * (samples + last)
    far = np.full(count * 9, seen.slant_range if distance is None else distance)
    returns = Returns(
        shape, np.repeat(np.arange(count), 9), np.tile(np.arange(9), count), far,
        np.full(count * 9, 1 / 9), 9,
    )  # fmt: skip
    return Pass(plan, returns)


def seen_from(flown, point, time):
    """Where the aircraft is from a point at some times, ship axes, straight from the speeds.

    (..., 3) extended precision: right, up and away in the snapshot's axes [m].
    """
    long = np.longdouble
    azimuth = np.radians(long(flown.aircraft_heading + flown.offset))
    down = np.radians(long(flown.depression))
    heading = np.radians(long(flown.ship_heading))
    track = flown.aircraft_heading if flown.aircraft_track is None else flown.aircraft_track
    track = np.radians(long(track))
    # East, north and up of the point from the ship's origin: x ahead, y to port.
    x, y, z = (np.asarray(part, long) for part in np.moveaxis(np.asarray(point), -1, 0))
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
