"""Flights past a ship: what the beam meets, what is recorded of it, and what the truth is."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.irar import Flight, Pass, Scan, Snapshot, autofocus, profile, ship_window, true_snapshot
from ncti.ladar import range_extent
from ncti.render import range_image
from sweeps.engine.settings import Run
from sweeps.engine.stage import Stage, in_memory, plain
from sweeps.stages.flight_geometry import (
    CELLS,
    believed,
    draw_number,
    flight_of,
    fly_past,
    received,
    recorded,
    surface,
)
from sweeps.stages.irar import Error, Irar
from sweeps.stages.ladar import Ladar, bin_centres
from sweeps.stages.views import Grid, ShipName

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]
Pairs = tuple[tuple[str, Any], ...]


@plain(uses=(Irar, Grid), reads={"flown_pulse_width": Irar.pulse_width})
def course(
    ship: ShipName,
    flown: tuple[str, ...] | None,
    range: float,
    depression: float,
    aircraft_speed: float,
    ship_speed: float,
    aircraft_heading: float,
    aircraft_track: float | None,
    offset: float,
    pointing: float | None,
    mirror_angle: float,
    ifov: float,
    line_rate: float,
    samples: int,
    pulse_rate: float,
    range_gate: float,
    detectors: int,
    jitter: float,
    jitter_time: float,
    transom_gain: float,
    mast_gain: float,
    flown_pulse_width: float,
) -> Pairs | None:
    """Return all that a pass depends on besides its ship and aspect; None of a ship not flown."""
    named = {**locals()}
    del named["ship"], named["flown"]
    return None if flown is not None and ship not in flown else tuple(named.items())


@plain(uses=(Irar,))
def receivers(cnr: float, range_sigma: float, threshold: float, nedt: float) -> Pairs:
    """Return the receivers of a flight."""
    return tuple(locals().items())


@plain(uses=(Grid, Irar))
def flight_draw(replicate: int, jitter: float) -> int:
    """Return which draw of its attitude a pass has."""
    return draw_number(replicate, jitter)


@in_memory(uses=(Grid, Ladar, Run))
def flown_pass(
    mesh: trimesh.Trimesh,
    course: Pairs | None,
    ship: ShipName,
    aspect: float,
    flight_draw: int,
    reflectance: str,
    seed: int,
) -> Pass | None:
    """Return what the beam meets; None of a ship that is not flown past, as all that follows."""
    if course is None:
        return None
    return fly_past(
        mesh,
        dict(course),
        ship=ship,
        aspect=aspect,
        replicate=flight_draw,
        seed=seed,
        reflectance=reflectance,
    )


@in_memory(uses=(Grid, Ladar))
def truth(
    mesh: trimesh.Trimesh, course: Pairs | None, aspect: float, reflectance: str
) -> Snapshot | None:
    """Return the view from the snapshot's place, on the ship's own window."""
    if course is None:
        return None
    flight = flight_of(aspect, {**dict(course), "cnr": 0.0})
    return true_snapshot(
        mesh,
        flight,
        ship_window(mesh, flight),
        cells=CELLS,
        **surface(mesh, dict(course), reflectance),
    )


@in_memory(uses=(Grid, Ladar))
def models(
    mesh: trimesh.Trimesh,
    truth: Snapshot | None,
    course: Pairs | None,
    aspect: float,
    drawing_engine: str,
    reflectance: str,
    bin_width: float,
    window: float,
) -> Floats | None:
    """(noiseless, synthetic, point; bin): profiles without noise, of carrier-to-noise ratio 1.

    The last two are of the whole view's range image at the sensor's pixel, of even reflectivity:
    each pixel's area spread over its range extent, or sampled at its middle. Rows of pixels that
    are level see a deck at distances far apart, so that only the whole extent closes the gaps
    between them.
    """
    if course is None or truth is None:
        return None
    flight = flight_of(aspect, {**dict(course), "cnr": 0.0})
    image = range_image(
        mesh,
        aspect=aspect,
        depression=flight.depression,
        pixel=flight.pixel,
        roll=0.0,
        slant_range=flight.slant_range,
        engine=drawing_engine,
    )
    drawn = [
        range_extent(
            image,
            slant_range=flight.slant_range,
            ifov=flight.ifov * (1 + 1e-9),  # no less than the pixel, whatever the rounding
            bin_width=bin_width,
            window=window,
            spread=spread,
            reflectance=reflectance,
        ).fraction.sum(axis=0)
        for spread in (1.0, 0.0)
    ]
    bins = bin_centres(window, bin_width).size
    return np.stack([profile(truth, flight, bins=bins, bin_width=bin_width), *drawn])


@in_memory(uses=(Grid, Run))
def scan(
    flown_pass: Pass | None,
    course: Pairs | None,
    receivers: Pairs,
    ship: ShipName,
    aspect: float,
    replicate: int,
    seed: int,
) -> Scan | None:
    """Return the raw images."""
    if flown_pass is None or course is None:
        return None
    met = {"replicate": replicate, **dict(receivers)}
    return recorded(flown_pass, dict(course), met, ship=ship, aspect=aspect, seed=seed)


@in_memory()
def clean(flown_pass: Pass | None, receivers: Pairs) -> Scan | None:
    """Return the raw images without noise."""
    return None if flown_pass is None else received(flown_pass, dict(receivers)).noiseless()


@in_memory(uses=(Irar,), reads={"error": Irar.errors, "focused": Irar.autofocus})
def belief(scan: Scan | None, error: Error, focused: bool) -> Flight | None:
    """Return what the corrections take for the flight."""
    if scan is None:
        return None
    found = believed(scan.flight, error)
    if focused:
        with suppress(ValueError):  # no ship in the image: navigation is all there is
            found = autofocus(scan, found)
    return found


STAGES: tuple[Stage, ...] = (
    *(course, receivers, flight_draw, flown_pass, truth, models, scan, clean, belief),
)
