"""Flights past a ship: pass, raw and corrected images, profiles, landmarks and tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial, wraps
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ncti import irar as library
from ncti.checks import NothingSeenError
from ncti.irar import Chain, Flight, Pass, Scan, Snapshot
from ncti.irar import corrected as comparison
from ncti.irar.scene import plan_scan
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.errors import ConfigurationError
from sweeps.engine.declare.kinds import Value
from sweeps.engine.declare.settings import Choices, Run, Setting
from sweeps.engine.declare.stage import Output, coordinate, derived, in_memory, inner
from sweeps.stages import irar, meshes, views
from sweeps.stages.arguments import Keywords, keywords, settings_by_dimension
from sweeps.stages.irar import FLIGHTS, FLOWN, RECORDED, Error, Irar, flight_of
from sweeps.stages.ladar import BEAM, Ladar, profile_bins
from sweeps.stages.refusals import refuse, require, require_among
from sweeps.stages.ships import ShipName
from sweeps.stages.views import IRAR, Arrays, Grid, uses_sensor

if TYPE_CHECKING:
    import trimesh
    import xarray as xr

Result = TypeVar("Result")

SLOWEST, FASTEST = 0.25, 1.9  # limits of the estimated closing speed over the true one
EXACT_CHAIN_SETTINGS = (Irar.azimuth, Irar.mirror, Irar.range_filter)  # not of the article's chain


receivers = derived(reads=settings_by_dimension(RECORDED[1:]), name="receivers")(keywords)
flight_place = derived(
    reads={"ship": Grid.ship, "aspect": Grid.aspect, "seed": Run.seed}, name="flight_place"
)(keywords)


@derived(uses=(Irar, Grid), reads=settings_by_dimension(FLOWN))
def course(ship: ShipName, flown: tuple[str, ...] | None, **values: Any) -> Keywords | None:
    """Return the settings of a pass; None for a ship that is not flown past."""
    return None if flown is not None and ship not in flown else keywords(**values)


flight_draw = derived(uses=(Grid, Irar), name="flight_draw")(irar.draw_number)


def if_flown(function: Callable[..., Result]) -> Callable[..., Result | None]:
    """Return a function that returns None if any argument is None, as for a ship not flown past."""

    @wraps(function)
    def call_if_flown(*args: Any, **kwargs: Any) -> Result | None:
        absent = any(argument is None for argument in (*args, *kwargs.values()))
        return None if absent else function(*args, **kwargs)

    return call_if_flown


@in_memory(uses=(Ladar,))
@if_flown
def flown_pass(
    mesh: trimesh.Trimesh,
    course: Keywords,
    flight_place: Keywords,
    flight_draw: int,
    reflectance: str,
) -> Pass:
    """Return the simulated pass."""
    name: dict[str, Any] = {**dict(flight_place), "replicate": flight_draw}
    return irar.fly_past(mesh, dict(course), **name, reflectance=reflectance)


@in_memory(
    uses=(Grid,), reads={name: BEAM[name] for name in ("bin_width", "window", "reflectance")}
)
@if_flown
def truth(
    mesh: trimesh.Trimesh,
    course: Keywords,
    aspect: float,
    drawing_engine: str,
    reflectance: str,
    **bins: float,
) -> tuple[Snapshot, NDArray[np.float64]]:
    """Return the true snapshot in the window of the ship, and its (source, bin) profiles.

    The sources are noiseless, synthetic and point, for a carrier-to-noise ratio of 1.
    """
    flight, surface = flight_of(aspect, dict(course)), irar.surface(mesh, dict(course), reflectance)
    window = library.ship_window(mesh, flight)
    view = library.true_snapshot(mesh, flight, window, cells=comparison.CELLS_PER_PIXEL, **surface)
    engine = "auto" if drawing_engine == views.LINES else drawing_engine  # it needs pixels
    drawn: Any = {"engine": engine, "reflectance": reflectance, **bins}
    return view, comparison.model_profiles(mesh, view, flight, aspect=aspect, **drawn)


@in_memory(uses=(Grid,))
@if_flown
def scan(
    flown_pass: Pass,
    course: Keywords,
    receivers: Keywords,
    flight_place: Keywords,
    replicate: int,
) -> tuple[Scan, Scan]:
    """Return the raw images, and the same without noise."""
    conditions = {"replicate": replicate, **dict(receivers)}
    noisy = irar.record_scan(flown_pass, dict(course), conditions, **dict(flight_place))
    return noisy, irar.apply_receivers(flown_pass, dict(receivers)).noiseless()


@in_memory(uses=(Irar,), reads={"error": Irar.errors, "focused": Irar.autofocus})
@if_flown
def navigation(scan: tuple[Scan, Scan], error: Error, focused: bool) -> Flight:
    """Return the flight that the corrections assume."""
    noisy, _ = scan
    estimate = comparison.navigated_flight(noisy.flight, error)
    if focused:
        with suppress(NothingSeenError):  # no ship in the image: keep the estimate of navigation
            estimate = library.autofocus(noisy, estimate)
    return estimate


# Corrected images, compared with the truth, and their range profiles

NUMBERS = {
    "profile_correlation": "correlation of a simulated flight's profile with the noiseless one",
    "profile_correlation_without_hangar": "correlation of a simulated flight's profile with the "
    "noiseless one, without 4 m either side of the hangar, the highest peak",
    "closing_speed_error": "relative error of the closing speed used in the corrections",
    "looks": "mean number of samples in pixels that have any",
}
TILTS = {
    "mast_tilt": "tilt of masts in the corrected intensity and infrared images together",
    "waterline_tilt": "tilt of the waterline in the corrected intensity and infrared images "
    "together",
    "mast_tilt_error": "standard error of the tilt of masts, for a shear of a few degrees at most",
    "waterline_tilt_error": "standard error of the tilt of the waterline, likewise",
    "intensity_mast_tilt": "tilt of masts in the corrected intensity alone",
    "intensity_waterline_tilt": "tilt of the waterline in the corrected intensity alone",
    "infrared_mast_tilt": "tilt of masts in the corrected infrared image alone",
    "infrared_waterline_tilt": "tilt of the waterline in the corrected infrared image alone",
    "noiseless_mast_tilt": "tilt of masts in the corrected noiseless scan, from the share of ship "
    "in each pixel",
    "noiseless_waterline_tilt": "tilt of the waterline in the corrected noiseless scan, from the "
    "share of ship in each pixel",
}
IMAGES = {  # unit and label
    "intensity": ("1", "corrected, segmented intensity in noise powers, 0 without a return"),
    "range_image": ("m", "range relative to the ship origin, of the same pixels"),
    "infrared_image": ("K", "apparent temperature above the sea, of the same pixels"),
}

_place = partial(inner, dtype="i4", unit="pixel")


flight_chain = derived(uses=(Irar,), reads={"form": Irar.chain}, name="flight_chain")(Chain)


@FLIGHTS.stage(
    Output(
        "profile",
        ("source", "down_range"),
        label="range profile: intensity summed over pixels, in noise powers of one look",
    ),
    *(Output(name, label=label) for name, label in NUMBERS.items()),
    *(Output(name, label=label, unit="degree") for name, label in TILTS.items()),
    Output(
        "hangar_spike_offset",
        label="down-range of the hangar's spike in a simulated flight, over that without noise",
        unit="m",
    ),
    *(
        Output(name, ("source",), label=label, unit=unit)
        for name, (label, unit) in comparison.LANDMARKS.items()
    ),
    *(
        Output(name, ("row", "column"), label=label, unit=unit)
        for name, (unit, label) in IMAGES.items()
    ),
    _place("first_row", label="row of pixels, upwards from the ship origin"),
    _place("first_column", label="column of pixels, rightwards from the ship origin"),
    *(inner(f"pixel_{name}", ("pixel",), "f8") for name in ("row", "column", "intensity", "range")),
    *(inner(f"pixel_{name}", dtype="f8") for name in ("height", "width")),
    uses=(Grid, Irar, Ladar),
    reads={"error": Irar.errors},
)
def corrected(
    scan: tuple[Scan, Scan] | None,
    navigation: Flight | None,
    truth: tuple[Snapshot, NDArray[np.float64]] | None,
    mesh: trimesh.Trimesh,
    flight_chain: Chain,
    *,
    ship: ShipName,
    aspect: float,
    error: Error,
    bin_width: float,
    window: float,
) -> Arrays:
    """Return the corrected images of a flight, their tilts, their profiles and landmarks."""
    bins = profile_bins(window, bin_width)
    if scan is None or navigation is None or truth is None:
        return _empty_results(bins.size)
    (noisy, clean), (view, models) = scan, truth
    flight = noisy.flight
    pixels = flight_chain.window(mesh, flight, error)
    image = flight_chain.correct(noisy, navigation, pixels)
    fine = flight_chain.correct(noisy, navigation, pixels, overscanned=True)
    cut = partial(library.segmented, threshold=flight_chain.segmentation_threshold)
    segmented, fine = cut(image, navigation), cut(fine, navigation)
    visible = bool(np.count_nonzero(segmented.intensity) >= comparison.MIN_SHIP_PIXELS)
    measured = library.profile(fine, navigation, bins=bins.size, bin_width=bin_width)
    profiles = np.stack([measured, *(flight.cnr * models)])
    return {
        "profile": profiles,
        "closing_speed_error": np.array(navigation.closing_speed / flight.closing_speed - 1),
        "looks": segmented.looks.sum() / max(np.count_nonzero(segmented.looks), 1),
        "intensity": segmented.intensity,
        "range_image": segmented.range - flight.slant_range,
        "infrared_image": segmented.infrared,
        "first_row": np.array(pixels.bottom),
        "first_column": np.array(pixels.left),
        **comparison.measure_tilts(
            flight_chain, noisy, clean, image, view, navigation, shows_ship=visible
        ),
        **{f"pixel_{name}": array for name, array in vars(fine.ship_pixels).items()},
        **comparison.compare_profiles(profiles, bins, aspect=aspect, ship=ship),
    }


def _empty_results(bins: int) -> Arrays:
    """Return the empty results of a ship that is not flown past."""
    lengths = {"source": len(comparison.SOURCES), "down_range": bins}
    return {
        output.name: np.full([lengths.get(dim, 0) for dim in output.dims], output.fill_value)
        for output in corrected.outputs
    }


@FLIGHTS.stage(
    coordinate("source", ("source",), "U9", "source of a profile; measured: in a flight")
)
def profile_sources() -> NDArray[np.str_]:
    """Return the sources of the profiles of a flight."""
    return np.array(comparison.SOURCES)


flight_bins = replace(profile_bins, name="flight_bins", group=FLIGHTS)


# Checks


def check(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) impossible flights and impossible errors of navigation."""
    require_among(choices, Irar.flown, Grid.ship)
    printed = next((name for name in choices[Irar.chain] if name != comparison.EXACT), None)
    for setting in EXACT_CHAIN_SETTINGS if printed else ():
        reason = f"where irar.chain has {printed}, which has a way of its own"
        require(choices, setting, setting.default, reason)
    if not uses_sensor(IRAR)(choices):
        return
    for values in combinations(choices, (Irar.band_start, Irar.band_stop)):
        if not values["band_start"] < values["band_stop"]:
            stop = f"below {values['band_stop']:g}, irar.band_stop"
            refuse(Irar.band_start, values["band_start"], stop)
    views.check_beam(choices, Irar.profile_range, Ladar.ifov)
    hulls = {
        ship: meshes.read_mesh(meshes.mesh_source(ship)).convex_hull
        for ship in flown_ships(choices)
    }
    for values in combinations(choices, (Grid.ship, Grid.aspect, *FLOWN)):
        ship, aspect, place = values.pop("ship"), values.pop("aspect"), ""
        try:
            flight = flight_of(aspect, values)
            place = f" ({ship} at {aspect:g} deg)"
            plan = plan_scan(hulls[ship], flight) if ship in hulls else None
        except ValueError as problem:
            of_range = str(problem).startswith("slant_range")
            key = f"irar.range has {values['range']:g} km: " if of_range else "irar."
            raise ConfigurationError(f"{key}{problem}{place}") from problem
        for error in choices[Irar.errors]:
            _check_estimate(flight, error)
        if plan is not None and not plan.meets(hulls[ship]):
            missed = f"irar.offset: no sample meets {ship} at {aspect:g} deg"
            refuse(Irar.pointing, values["pointing"], f"nearer {values['offset']:g}, {missed}")


def flown_ships(choices: Choices) -> tuple[Value, ...]:
    """Return the ships that are flown past."""
    past = choices.value(Irar.flown)
    return tuple(ship for ship in choices[Grid.ship] if past is None or ship in past)


def combinations(choices: Choices, settings: tuple[Setting, ...]) -> Iterator[dict[str, Value]]:
    """Yield values of some settings, by dimension, for every combination of a sweep's axes."""
    for point in choices.points([setting.key for setting in settings]):
        yield {setting.name: value for setting, value in zip(settings, point, strict=True)}


def _check_estimate(flight: Flight, error: Error) -> None:
    """Refuse an error that changes the closing speed too much."""
    parameter, value = error
    wrong = f"irar.errors.{parameter} has {value:g}, with which"
    try:
        speed = comparison.navigated_flight(flight, error).closing_speed
    except ValueError as problem:
        raise ConfigurationError(f"{wrong} {problem}") from problem
    min_speed, max_speed = (share * flight.closing_speed for share in (SLOWEST, FASTEST))
    if not min_speed <= speed <= max_speed:
        raise ConfigurationError(
            f"{wrong} the ship comes closer at {speed:.3g} m/s, but must be such that it does at "
            f"{min_speed:.3g} to {max_speed:.3g}"
        )


# Tables of flights


def tabulate(flights: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the mean of every figure of flights over draws of the noise, and its spread."""
    figures = flights[[*FLIGHT_FIGURES, *OF_PROFILES]].load()
    draws = figures.sizes.get(DRAW, 1)
    table = figures.mean(DRAW, keep_attrs=True) if DRAW in figures.dims else figures
    if draws > 1:
        for name, array in figures.std(DRAW, ddof=1, keep_attrs=True).items():
            label = f"standard deviation over draws of the {array.attrs['long_name']}"
            table[f"{name}_spread"] = array.assign_attrs(long_name=label)
    return table.assign(draws=((), draws, {"units": "1", "long_name": "draws of the noise"}))


def _flight_figures(names: tuple[str, ...]) -> tuple[Figure, ...]:
    """Return figures of flights with their spread; those without a format are in files only."""
    figures = [
        Figure(name, digits=5, format=LISTED.get(name, ".4g"), listed=name in LISTED)
        for name in names
    ]
    return (*figures, Figure("draws", listed=False))


DRAW = "replicate"
FLIGHT_FIGURES = tuple(
    output.name for output in corrected.outputs if output.is_stored and not output.dims
)
OF_PROFILES = tuple(comparison.LANDMARKS)
LISTED = {
    "profile_correlation": ".3f",
    "profile_correlation_without_hangar": ".3f",
    **dict.fromkeys(("mast_tilt", "waterline_tilt", "hangar_spike_offset"), ".2f"),
    **{"looks": ".1f", "stern_to_hangar": ".1f", "stern_to_bridge": ".1f", "deck_spikes": ".0f"},
    **{"transom_ratio": ".2f", "mast_position": ".1f", "mast_ratio": ".2f"},
    **{"forward_position": ".1f", "forward_ratio": ".2f"},
}
STAGES = (
    receivers,
    flight_place,
    course,
    flight_draw,
    flown_pass,
    truth,
    scan,
    navigation,
    flight_chain,
    corrected,
    profile_sources,
    flight_bins,
)
TABLES = (
    FLIGHTS.table(
        "flights",
        tabulate,
        Display(
            "flights",
            "Simulated flights: corrected images and profiles against the noiseless truth",
            _flight_figures(FLIGHT_FIGURES),
            rows=("ship", "error_parameter", "error_value"),
            notes=(
                "Means over draws of the noise, with the standard deviation of one. Tilt of masts "
                "to the right, and of the waterline rising to it; offset of the hangar's peak.",
            ),
        ),
        Display(
            "landmarks",
            "Simulated flights near the stern: landmarks of profiles",
            _flight_figures(OF_PROFILES),
            rows=("ship", "source"),
            notes=(
                "measured: flown; the others are noiseless, synthetic and of single points. "
                "Gains of transom and masts are assumed inputs, not results.",
            ),
        ),
    ),
)
