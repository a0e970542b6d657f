"""Small flights: coarse pixels and few lines, in a tenth of a second each."""

from dataclasses import replace

from sweeping import command
from test_stages import plan_of

import ncti.ships
from sweeps.flight_course import shared_window
from sweeps.flight_schema import FlightConfig, FlightPlan
from sweeps.flight_variables import FLIGHT
from sweeps.flights import view_flights
from sweeps.stages import Ship, View, load_ship

SMALL = {"ifov": 500.0, "samples": 60, "line_rate": 60.0, "detectors": 3, "pulse_rate": 4000.0}
FEET = {"intensity", "range_image", "infrared_image"}  # variables on a window's own pixels
# The same as a sweep of the command line, of which one ship is only learned.
SWEEP = [
    "sensor=irar",
    "grid.ship=[roberts,duncan]",
    "grid.aspect=[172,175]",
    "grid.pulse_width=[30,50]",
    "irar.flown=roberts",
    "irar.range=3",
    "irar.cnr=[10,20]",
    "irar.errors.aircraft_speed=1",
    "classifier.name=[acn,correlation]",
    "render.pixel=0.5",
    "render.engine=embree",
    *(f"irar.{key}={value:g}" for key, value in SMALL.items()),
]


def flown(cache, *, ship="roberts", aspect=175.0, replicates=2, past=None, seed=0, **changes):
    """The variables of a view, and the plan."""
    plan = planned(cache, ship, aspect, replicates, past, seed, **changes)
    return view_flights(View(known(ship), aspect, plan)), plan.flights


def cell(found, plan, **values):
    """The values of one cell, by the values on the axes."""
    place = []
    for name in FLIGHT:
        axis = getattr(plan.grid, name)
        place.append(axis.index(values[name]) if name in values else 0)
    return {name: array[tuple(place)] for name, array in found.items()}


def known(ship):
    return Ship(ship, ship, ncti.ships.digest(ship))


def planned(cache, ship, aspect, replicates=2, past=None, seed=0, ladar=None, **changes):
    config = FlightConfig(**{"range": 3.0, **SMALL, **changes})
    named = known(ship)
    hull = load_ship(named.source, named.digest, cache).convex_hull
    grid = config.expand(tuple(range(replicates)))
    window = shared_window(config, [hull], (aspect,))
    flights = FlightPlan((ship,) if past is None else past, grid, config, window)
    plan = plan_of(
        cache, sensors=("irar",), code={"irar": "irar"}, flights=flights, pulse_width=(30.0, 50.0)
    )
    return replace(plan, seed=seed, **({} if ladar is None else {"ladar": ladar}))


def sweep(*overrides, folder, cache, workers=2):
    """The sweep as its users run it."""
    done = command(
        *SWEEP,
        f"cluster.workers={workers}",
        "store=s.zarr",
        *overrides,
        folder=folder,
        cache=cache,
    )
    assert done.returncode == 0, done.stderr
    return done
