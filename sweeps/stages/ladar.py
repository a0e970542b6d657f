"""The laser radar: range extents, expected and averaged range profiles, and their covariance."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti import ladar as library
from ncti.features.profile import EDGE, estimated_floor
from ncti.ladar import RangeExtent
from ncti.ladar.pulse import SPEED_OF_LIGHT, shortest_pulse
from ncti.ladar.receivers import RECEIVERS
from ncti.render import LineImage, RangeImage
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.settings import Choices, Settings, count, draws, number, word
from sweeps.engine.stage import Output, Stage, in_memory, plain, stage
from sweeps.stages import views
from sweeps.stages.places import Shift, place, shift
from sweeps.stages.views import (
    INFRARED,
    LINES,
    RANGE,
    SHAPES,
    STATUS,
    Grid,
    Render,
    Sweep,
    looks,
    quantity,
)

Arrays = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]
Profiles = NDArray[np.float32]
Signal = tuple[tuple[str, Any], ...]  # keywords of the library

SENSOR = RANGE
# Imported by stages when they are called, because it takes long.
IMPORTS = ("ncti.ladar.waveforms", "ncti.normals")
PROFILES = "range_profile"  # group, and name of the noise
VIEW = ("ship", "aspect", "pulse_width")
MOST_DRAWN = 10_000  # target-free IFOVs a frame where no short cut stands in for them
FULL = "full_profile"

WITH_MOMENTS = {"likelihood": {RANGE}, "fusion": {RANGE, INFRARED}}
"""Classifiers for which covariances are stored, and the sensors that each needs."""


class Ladar(Settings, key="ladar"):
    """The laser radar: its beam, its receiver, its noise."""

    ifov = quantity(150, 1, 100e3, "urad", "instantaneous field of view")
    bin_width = quantity(1, 0.05, 50, "m", "range bin", fixed=SHAPES)
    window = quantity(250, 20, 5000, "m", "range window centred on the ship", fixed=SHAPES)
    spread = quantity(
        *(0.5, 0, 1, "1", "share of a pixel's range extent that its area is spread over"),
        help="0: point sampling",
    )
    reflectance = word(
        "projected_area",
        ("projected_area", "lambertian"),
        label="model of the reflected power",
    )
    cnr = quantity(32, -100, 100, "dB", "carrier-to-noise ratio of a filled IFOV at cnr_range")
    cnr_range = quantity(100, 1, 1000, "km", "range at which cnr is stated")
    extinction = quantity(
        *(0, 0, 10, "dB km-1", "extinction of the air at 10.6 um, one way"),
        help="the source's 32 dB at 100 km includes extinction",
    )
    target_free_ifovs = count(
        4000, 0, 10**7, label="target-free IFOVs accumulated per frame", noted=True
    )
    receiver = word(
        FULL, RECEIVERS, label="receiver: the part of a returned waveform that it keeps", noted=True
    )
    false_alarm = number(1e-6, 1e-12, 0.5, label="probability of a false first pulse in one bin")
    phases = draws(
        1,
        label="position of the ship on the grid of IFOVs, by number",
        help="for averaged profiles, with independent noise; expected profiles have the first, the "
        "origin on a corner",
        dimension="ifov_phase",
        noted=True,
    )


def stores_moments(choices: Choices) -> bool:
    """Return whether covariances of range profiles are stored."""
    sensors = set(choices.one(Sweep.sensor))
    names = choices.values.get("classifier.name", ())
    return any(WITH_MOMENTS.get(name, {""}) <= sensors for name in names)


def by_lines(choices: Choices) -> bool:
    """Return whether views are sampled along lines, which estimate their error."""
    along = LINES in choices[Render.engine] or any(choices[Render.tolerance])
    return looks(RANGE)(choices) and along


_profile = partial(stage, uses=(Grid, Ladar), group=PROFILES, when=looks(RANGE), status=STATUS)
_bins = partial(stage, uses=(Grid, Ladar), group=PROFILES, coordinates=True)


@plain(uses=(Grid, Ladar))
def cnr_at_range(range: float, cnr: float, cnr_range: float, extinction: float) -> float:
    """Return the carrier-to-noise power ratio of a filled IFOV at a range [km]."""
    return library.carrier_to_noise(
        range * 1e3,
        reference=10 ** (cnr / 10),
        reference_range=cnr_range * 1e3,
        extinction=extinction * 1e-3,
    )


@plain(uses=(Grid, Ladar))
def seen_shift(phases: int, aspect: float, drawn_aspect: float) -> Shift:
    """Return the place of the ship origin in averages, mirrored where the other side is drawn."""
    right, up = place(phases)
    return (right if aspect == drawn_aspect else -right % 1), up


@stage(
    Output("fraction", ("ifov", "down_range"), "f8", label="share of an IFOV that the ship fills"),
    Output("down_range", ("down_range",), "f8", label="centres of the bins", unit="m"),
    Output("cell", ("ifov", "side"), "i8", label="column and row of each IFOV"),
    Output("strands", ("strand", "down_range"), "f8", label="by every sixteenth line, all IFOVs"),
    Output("line_count", dtype="i8", label="lines across the ship; 0 of an image of pixels"),
    Output("far_field_error", dtype="f8", label="bound on the error of drawing the far field"),
    uses=(Grid, Ladar),
    status=STATUS,
)
def extent(
    image: RangeImage | LineImage,
    range: float,
    ifov: float,
    bin_width: float,
    window: float,
    spread: float,
    reflectance: str,
    shift: Shift,
) -> Arrays:
    """Return the fractions of the IFOVs that see the ship, bin by range bin."""
    beam: Any = {"slant_range": range * 1e3, "ifov": ifov * 1e-6, "bin_width": bin_width}
    how: Any = {"window": window, "spread": spread, "reflectance": reflectance, "shift": shift}
    found = library.range_extent(image, **beam, **how)
    return {
        "fraction": found.fraction,
        "down_range": found.down_range,
        "cell": found.cell,
        "strands": found.fraction[:0] if found.strands is None else found.strands,
        "line_count": np.array(found.line_count),
        "far_field_error": np.array(found.far_field_error),
    }


@in_memory(uses=(Grid, Ladar))
def ifovs(
    extent: Arrays,
    aspect: float,
    drawn_aspect: float,
    range: float,
    ifov: float,
    bin_width: float,
    shift: Shift,
) -> RangeExtent:
    """Return the library's range extent, mirrored where the other side was drawn."""
    numbers = {name: extent[name].item() for name in ("line_count", "far_field_error")}
    strands = {"strands": extent["strands"] if len(extent["strands"]) else None}
    beam: Any = {"slant_range": range * 1e3, "ifov": ifov * 1e-6, "bin_width": bin_width}
    found = RangeExtent(**{**extent, **numbers, **strands}, **beam, shift=shift)
    return found if aspect == drawn_aspect else found.mirrored()


# At phase 0 these cells are those of the training views.
seen_extent = replace(extent, name="seen_extent", reads={"shift": "seen_shift"})
seen_ifovs = replace(
    ifovs, name="seen_ifovs", reads={"extent": "seen_extent", "shift": "seen_shift"}
)


@stage(uses=(Grid, Ladar, Render), gather=(Grid.pulse_width, Ladar.bin_width), plain=True)
def fineness(
    pulse_width: tuple[float, ...], bin_width: tuple[float, ...], tolerance: float | None
) -> tuple[float, ...]:
    """Return a tolerance, the shortest pulse [ns] and bin [m] in which it holds; or nothing."""
    return () if tolerance is None else (tolerance, min(pulse_width), min(bin_width))


@_profile(
    Output(
        "profile_error",
        label="estimated error of the range extent after the pulse, sum |p - q| over sum q",
    ),
    Output("within_tolerance", dtype="i1", label="1 where the error is within render.tolerance"),
    dims=(*VIEW, "range"),
    when=by_lines,
)
def profile_error(ifovs: RangeExtent, pulse_width: float, fineness: tuple[float, ...]) -> Arrays:
    """Return the error estimated from lines: NaN for other engines, -1 without a tolerance."""
    error = ifovs.error_after(pulse_width * 1e-9)
    return {
        "profile_error": np.array(error),
        "within_tolerance": np.array(error <= fineness[0] if fineness else -1),
    }


@plain(uses=(Ladar,))
def signal(
    cnr_at_range: float, target_free_ifovs: int, receiver: str, false_alarm: float
) -> Signal:
    """Return the keywords of the library that describe signal and receiver."""
    return (
        *(("cnr", cnr_at_range), ("target_free_ifovs", target_free_ifovs)),
        *(("receiver", receiver), ("false_alarm", false_alarm)),
    )


@_profile(
    Output("expected", ("down_range",), label="expected range profile, noise floor included"),
    dims=(*VIEW, "range", "target_free_ifovs"),
)
def expected(ifovs: RangeExtent, pulse_width: float, signal: Signal) -> Profiles:
    """Return the expected range profile: the sum of the receiver's reports over IFOVs.

    Equation C of the article for the full profile.
    """
    pulse = pulse_width * 1e-9
    return library.expected_profile(ifovs, pulse_width=pulse, **dict(signal)).astype(np.float32)


@_profile(
    Output("noise_floor", label="noise floor of range profiles"),
    Output("floor_removed", ("down_range",), label="expected range profile above the noise floor"),
    dims=(*VIEW, "range", "target_free_ifovs"),
)
def above_floor(expected: Profiles) -> Arrays:
    """Return the noise floor, read off both ends of the window, and the profile above it."""
    floor = estimated_floor(expected)
    return {"noise_floor": floor[0], "floor_removed": expected - floor}


@_profile(
    Output("averaged", ("down_range",), label="frame-averaged range profile, noise floor included"),
    dims=(*VIEW, "replicate", "ifov_phase", "frame_count", "range", "target_free_ifovs"),
    reads={"ifovs": "seen_ifovs"},
    along=(Grid.frame_count,),
    noise=PROFILES,
    stream=(
        *(Grid.ship, Grid.aspect, Grid.pulse_width, Grid.range),
        *(Ladar.target_free_ifovs, Grid.replicate, Ladar.phases),
    ),
    # A sweep without these settings draws the first value of each.
    optional=(Grid.replicate, Ladar.phases),
)
def averaged(
    ifovs: RangeExtent,
    pulse_width: float,
    frame_count: tuple[int, ...],
    signal: Signal,
    rng: np.random.Generator,
) -> Profiles:
    """Return averages over the first frames of a run, for several lengths of the run."""
    run: dict[str, Any] = {"frame_count": max(frame_count), "rng": rng, **dict(signal)}
    frames = library.frame_blocks(ifovs, pulse_width=pulse_width * 1e-9, **run)
    return library.cumulative_average(frames, frame_count).astype(np.float32)


@_profile(
    Output("covariance", ("lag", "down_range"), pad=0, label="covariance of a frame, by lag"),
    dims=(*VIEW, "range", "target_free_ifovs"),
    when=stores_moments,
)
def covariance(
    ifovs: RangeExtent, pulse_width: float, cnr_at_range: float, target_free_ifovs: int
) -> Profiles:
    """Return the covariance of one frame, as a lower band, of the full profile."""
    _, band = library.banded_frame_moments(
        ifovs,
        pulse_width=pulse_width * 1e-9,
        cnr=cnr_at_range,
        target_free_ifovs=target_free_ifovs,
    )
    return band.astype(np.float32)


@_bins(
    Output("down_range", ("down_range",), "f8", label="down-range from the ship origin", unit="m"),
    when=looks(RANGE),
)
def profile_bins(window: float, bin_width: float) -> Floats:
    """Return the (bin,) down-range positions [m] of profiles in a range window [m]."""
    bins = round(window / bin_width)
    return bin_width * (np.arange(bins, dtype=np.float64) - (bins - 1) / 2)


@_bins(
    Output("lag", ("lag",), "f8", label="lag of a covariance, down-range", unit="m"),
    when=stores_moments,
    gather=(Grid.pulse_width, Grid.range, Ladar.cnr, Ladar.cnr_range, Ladar.extinction),
)
def lags(
    pulse_width: tuple[float, ...],
    range: tuple[float, ...],
    cnr: tuple[float, ...],
    cnr_range: tuple[float, ...],
    extinction: tuple[float, ...],
    window: float,
    bin_width: float,
) -> Floats:
    """Return the lags at which profiles are correlated, for the widest reach of the pulses.

    They reach as far with no ship there, and the farther the larger the carrier-to-noise ratio is.
    """
    sights = product(range, cnr, cnr_range, extinction)
    strongest = max(cnr_at_range(*sight) for sight in sights)
    bands = [
        library.banded_frame_moments(
            nowhere(window, bin_width), pulse_width=width * 1e-9, cnr=strongest
        )[1]
        for width in pulse_width
    ]
    return bin_width * np.arange(max(map(len, bands)), dtype=np.float64)


def nowhere(window: float, bin_width: float) -> RangeExtent:
    """Return a range extent without a ship."""
    bins = profile_bins(window, bin_width)
    nothing, cell = np.zeros((0, bins.size)), np.zeros((0, 2), dtype=np.int64)
    return RangeExtent(nothing, bins, bin_width, cell, ifov=1.0, slant_range=1.0)


def check(choices: Choices) -> Choices:
    """Refuse (`ConfigurationError`) inconsistent settings of the laser radar."""
    _check_receivers(choices)
    if set(choices.one(Sweep.sensor)) - {INFRARED}:  # flights make profiles, too
        bin_width, given = choices.one(Ladar.bin_width), min(choices[Grid.pulse_width])
        shortest = shortest_pulse(bin_width) * 1e9
        if given < shortest:
            raise ConfigurationError(
                f"grid.pulse_width has {given:g}, but must be at least {shortest:.3g} for "
                f"ladar.bin_width {bin_width:g} m"
            )
        if FULL in choices[Ladar.receiver]:
            _check_window(choices)
    for where in choices[Grid.range] if looks(RANGE)(choices) else ():
        narrowest = min(choices[Ladar.ifov])
        views.check_range(choices, "grid.range", where, narrowest=narrowest, beam="ladar.ifov")
    return choices


def _check_receivers(choices: Choices) -> None:
    """Refuse too few bins, and more target-free IFOVs than a receiver can have drawn."""
    window, bin_width = choices.one(Ladar.window), choices.one(Ladar.bin_width)
    if window < 10 * bin_width:
        raise ConfigurationError(
            f"ladar.window is {window:g} m, but must hold at least 10 bins of "
            f"ladar.bin_width {bin_width:g} m"
        )
    most = max(choices[Ladar.target_free_ifovs])
    for receiver in choices[Ladar.receiver]:
        if receiver != FULL and most > MOST_DRAWN:
            raise ConfigurationError(
                f"ladar.target_free_ifovs has {most}, but must be at most {MOST_DRAWN} with "
                f"the {receiver} receiver, which needs each of them drawn"
            )


def _check_window(choices: Choices) -> None:
    """Refuse a range window that does not hold every ship, both its ends free."""
    window = choices.one(Ladar.window)
    longest = max(choices[Grid.pulse_width]) * 1e-9 * SPEED_OF_LIGHT
    for ship in choices[Grid.ship]:
        reach = float(np.linalg.norm(views.description(views.hull(ship)).vertices, axis=1).max())
        # The returned pulse reaches beyond the ship, and both ends of the window must stay free
        # of it for the noise floor to be read there.
        needed = (2 * reach + longest / math.sqrt(2)) / (1 - 2 * EDGE)
        if needed > window:
            raise ConfigurationError(
                f"ladar.window is {window:g} m, but must be at least {needed:.0f} m to hold {ship} "
                f"and leave {EDGE:.0%} free at each end{views.hint(ship)}"
            )


SETTINGS: tuple[type[Settings], ...] = (Ladar,)
STAGES: tuple[Stage, ...] = (
    *(fineness, cnr_at_range, signal, shift, seen_shift, extent, ifovs, seen_extent, seen_ifovs),
    *(profile_error, expected, above_floor, averaged, covariance, profile_bins, lags),
)
