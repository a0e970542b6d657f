"""The laser radar: range extents, expected and averaged range profiles, and their covariance."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import ladar as library
from ncti.classify.loops import DENSITIES
from ncti.features.profile import estimated_floor
from ncti.ladar import RangeExtent
from ncti.ladar.budget import MAX_DECIBELS, faintest_ratio
from ncti.ladar.frames import averaged_frames
from ncti.ladar.loops import FRAMES
from ncti.ladar.places import IfovOffset
from ncti.ladar.pulse import shortest_pulse
from ncti.ladar.receivers import RECEIVERS
from ncti.ladar.window import window_requirement
from ncti.machine_code import CompiledLoops
from ncti.render import LineImage, RangeImage
from sweeps.engine.declare.settings import Choices, Run, Setting, Settings, count, number, word
from sweeps.engine.declare.stage import Group, Output, Stream, coordinate, derived, in_memory, stage
from sweeps.engine.resolve.streams import cell_rng
from sweeps.stages import meshes, views
from sweeps.stages.arguments import restore
from sweeps.stages.refusals import refuse
from sweeps.stages.views import (
    INFRARED,
    RANGE,
    STATUS,
    Arrays,
    Floats,
    Grid,
    Render,
    Sweep,
    quantity,
    uses_sensor,
)

if TYPE_CHECKING:
    from sweeps.engine.declare.stage import Stage

SENSOR = RANGE
IMPORTS = ("ncti.ladar.pixels", "ncti.ladar.waveforms", "ncti.normals")
PROFILE_GROUP = "range_profile"  # group, and name of the noise
VIEW = ("ship", "aspect", "pulse_width")
MAX_DRAWN = 10_000  # target-free IFOVs per frame of receivers for which each one is drawn
FULL = "full_profile"
ANYWHERE, CORNER = "random", "corner"  # places of the ship on the grid of IFOVs

MODELS = ("projected_area", "lambertian")  # of reflection

WITH_MOMENTS = {"likelihood": {RANGE}, "fusion": {RANGE, INFRARED}}
"""Classifiers for which covariances are stored, with the sensors that each of them needs.

The module of a user's classifier may add an entry.
"""


class Ladar(Settings, key="ladar"):
    """The laser radar: its beam, its receiver, its noise."""

    ifov = quantity(150, 1, 100e3, "urad", "instantaneous field of view")
    bin_width = quantity(1, 0.05, 50, "m", "range bin", not_swept=views.SHAPES)
    window = quantity(
        250, 20, 5000, "m", "range window centred on the ship", not_swept=views.SHAPES
    )
    spread = quantity(
        0.5,
        0,
        1,
        "1",
        "share of a pixel's range extent that its area is spread over",
        help="0: point sampling",
    )
    reflectance = word(MODELS[0], MODELS, label="model of the reflected power")
    cnr = quantity(32, -100, 100, "dB", "carrier-to-noise ratio of a filled IFOV at cnr_range")
    cnr_range = quantity(100, 1, 1000, "km", "range at which cnr is stated")
    extinction = quantity(
        *(0, 0, 10, "dB km-1", "extinction of the air at 10.6 um, one way"),
        help="the article's 32 dB at 100 km includes extinction",
    )
    target_free_ifovs = count(
        4000, 0, 10**7, label="target-free IFOVs accumulated per frame", role="coordinate"
    )
    receiver = word(
        FULL,
        RECEIVERS,
        label="receiver: the part of a returned waveform that it keeps",
        role="coordinate",
    )
    false_alarm = number(1e-6, 1e-12, 0.5, label="probability of a false first pulse in one bin")
    place = word(
        ANYWHERE,
        (ANYWHERE, CORNER),
        label="place of the ship on the grid of IFOVs in averaged profiles",
        help="random: another one for each view, range and draw of the noise; corner: the origin "
        "on the corner of four IFOVs, as in the article and in expected profiles",
        role="coordinate",
    )


def stores_moments(choices: Choices) -> bool:
    """Return whether covariances of range profiles are stored."""
    sensors = set(choices.value(Sweep.sensor))
    names = choices.values.get("classifier.name", ())
    return any(name in names and needed <= sensors for name, needed in WITH_MOMENTS.items())


def has_tolerance(choices: Choices) -> bool:
    """Return whether range profiles must meet a tolerance."""
    return uses_sensor(RANGE)(choices) and any(choices[Render.tolerance])


PROFILE = Group(
    PROFILE_GROUP,
    uses_sensor(RANGE),
    (Grid, Ladar),
    (*VIEW, "replicate", "place", "frame_count", "range", "target_free_ifovs"),
    STATUS,
)
MOMENTS = replace(PROFILE, when=stores_moments)

# Keywords of functions of `ncti.ladar`: settings, or names of stages.
BEAM = {
    "slant_range": Grid.range,
    "ifov": Ladar.ifov,
    "bin_width": Ladar.bin_width,
    "window": Ladar.window,
    "spread": Ladar.spread,
    "reflectance": Ladar.reflectance,
}
RECEIVED = {
    "cnr": "cnr_at_range",
    "target_free_ifovs": Ladar.target_free_ifovs,
    "receiver": Ladar.receiver,
    "false_alarm": Ladar.false_alarm,
}
SIGNAL = {name: RECEIVED[name] for name in ("cnr", "target_free_ifovs")}  # of any receiver
SIGNAL["pulse_width"] = Grid.pulse_width
EXTENT = (  # arrays of a packed `RangeExtent`
    Output("fraction", ("ifov", "bin"), "f8"),
    Output("cell", ("ifov", "side"), "i8"),
    Output("down_range", ("down_range",), "f8"),
    Output("strands", ("strand", "bin"), "f8"),
    Output("begin", dtype="i8"),
    Output("shift", ("side",), "f8"),
    Output("line_count", dtype="i8"),
    *(Output(name, dtype="f8") for name in ("bin_width", "ifov", "slant_range")),
    Output("far_field_error", dtype="f8"),
)


@derived()
def corner_offset() -> IfovOffset:
    """Return the place of the ship origin in expected profiles: the corner of an IFOV."""
    return 0.0, 0.0


@derived(uses=(Grid, Ladar))
def cnr_at_range(range: float, cnr: float, cnr_range: float, extinction: float) -> float:
    """Return the carrier-to-noise power ratio of a filled IFOV at a range [m]."""
    return library.carrier_to_noise(
        range, reference=10 ** (cnr / 10), reference_range=cnr_range, extinction=extinction
    )


@derived(uses=(Grid, Ladar, Run))
def ifov_offset(
    ship: str,
    aspect: float,
    range: float,
    replicate: int,
    place: str,
    seed: int,
    drawn_aspect: float,
) -> IfovOffset:
    """Return the place of the ship origin in averages, mirrored if the other side is drawn."""
    if place == CORNER:
        return 0.0, 0.0
    view = {"ship": str(ship), "aspect": aspect, "range": range, "replicate": replicate}
    right, up = cell_rng(seed, stage="place", **view).random(2).tolist()
    return mirror_offset((right, up), aspect, drawn_aspect)


def mirror_offset(place: IfovOffset, aspect: float, drawn_aspect: float) -> IfovOffset:
    """Return a place, mirrored if the other side of the ship is drawn.

    Add no whole IFOV, so that IFOVs keep their numbers, and thus their noise, on either side.
    """
    right, up = place
    return (right if aspect == drawn_aspect else 0.0 - right), up


@stage(*EXTENT, reads={"image": "image", "shift": "corner_offset", **BEAM})
def extent(image: RangeImage | LineImage, **beam: Any) -> Arrays:
    """Return the fractions of the IFOVs that see the ship, bin by range bin."""
    return library.range_extent(image, **beam).packed()


@in_memory(uses=(Grid,))
def ifovs(extent: Arrays, aspect: float, drawn_aspect: float) -> RangeExtent:
    """Return the library's range extent, mirrored if the other side was drawn."""
    drawn = restore(RangeExtent.unpacked, extent)
    return drawn if aspect == drawn_aspect else drawn.mirrored()


def extent_stages(name: str, **reads: Setting | str) -> tuple[Stage, Stage]:
    """Return the stages of range extents with other inputs, as arrays and as objects.

    Extents with equal inputs share one result, for example with a ship at the corner of an IFOV.
    """
    other = replace(extent, name=f"{name}_extent", reads=extent.reads | reads)
    return other, replace(ifovs, name=f"{name}_ifovs", reads={"extent": other.name})


offset_extents = extent_stages("offset", shift="ifov_offset")


@derived(uses=(Grid, Ladar, Render), gather=(Grid.pulse_width, Ladar.bin_width))
def fineness(
    pulse_width: tuple[float, ...], bin_width: tuple[float, ...], tolerance: float | None
) -> tuple[float, ...]:
    """Return a tolerance and the shortest pulse [s] and bin [m] at which it holds, or nothing."""
    return () if tolerance is None else (tolerance, min(pulse_width), min(bin_width))


@PROFILE.stage(
    Output("profile_error", label="estimated error after the pulse, sum |p - q| over sum q"),
)
def profile_error(ifovs: RangeExtent, pulse_width: float) -> Floats:
    """Return the error estimated from the samples of a view, by pixels or lines."""
    return np.array(ifovs.error_after(pulse_width))


@replace(PROFILE, when=has_tolerance).stage(
    Output("within_tolerance", dtype="i1", label="1 where the error is within render.tolerance"),
)
def within_tolerance(profile_error: Floats, fineness: tuple[float, ...]) -> NDArray[np.bool_]:
    """Return whether the estimated error is within the tolerance."""
    return np.asarray(profile_error <= fineness[0])


# Equation C of the article for the full profile: the sum of the receiver's reports over IFOVs.
expected = PROFILE.stage(
    Output("expected", ("down_range",), label="expected range profile, noise floor included"),
    reads={"extent": "ifovs", **RECEIVED},
    name="expected",
)(library.expected_profile)


@PROFILE.stage(
    Output("noise_floor", label="noise floor of range profiles"),
    Output("floor_removed", ("down_range",), label="expected range profile above the noise floor"),
)
def above_floor(expected: views.Profiles) -> Arrays:
    """Return the noise floor, estimated at both ends of the window, and the profile above it."""
    floor = estimated_floor(expected)
    return {"noise_floor": floor[0], "floor_removed": expected - floor}


@PROFILE.stage(
    Output("averaged", ("down_range",), label="frame-averaged range profile, noise floor included"),
    reads={"ifovs": "offset_ifovs", **RECEIVED},
    along=(Grid.frame_count,),
    stream=Stream(
        (Grid.ship, Grid.aspect, Grid.pulse_width, Grid.range, Ladar.target_free_ifovs),
        PROFILE_GROUP,
        (Grid.replicate,),  # a sweep without it draws the first
    ),
)
def averaged(
    ifovs: RangeExtent,
    pulse_width: float,
    frame_count: tuple[int, ...],
    rng: np.random.Generator,
    **signal: Any,
) -> Floats:
    """Return averages over the first frames of a run, for several lengths of the run."""
    return averaged_frames(ifovs, frame_count, pulse_width=pulse_width, rng=rng, **signal)


@MOMENTS.stage(
    Output("covariance", ("lag", "down_range"), pad=0, label="covariance of a frame, by lag"),
    reads=SIGNAL,
)
def covariance(ifovs: RangeExtent, **signal: Any) -> Floats:
    """Return the covariance of one frame, as a lower band, of the full profile."""
    return library.banded_frame_moments(ifovs, **signal)[1]


profile_bins = PROFILE.stage(
    coordinate("down_range", ("down_range",), "f8", "down-range from the ship origin", "m"),
    name="profile_bins",
)(library.bin_centres)

_CNR_INPUTS = {  # inputs of the carrier-to-noise ratio
    name: getattr(Grid if hasattr(Grid, name) else Ladar, name) for name in cnr_at_range.arguments
}


@MOMENTS.stage(
    coordinate("lag", ("lag",), "f8", label="lag of a covariance, down-range", unit="m"),
    reads=_CNR_INPUTS,
    gather=(Grid.pulse_width, *_CNR_INPUTS.values()),
)
def lags(
    pulse_width: tuple[float, ...], window: float, bin_width: float, **sight: tuple[float, ...]
) -> Floats:
    """Return the lags at which profiles are correlated, for the widest reach of the pulses.

    The reach is the same without a ship, and grows with the carrier-to-noise ratio.
    """
    sights = (dict(zip(sight, values, strict=True)) for values in product(*sight.values()))
    strongest = max(cnr_at_range(**values) for values in sights)
    sea = library.no_return(window, bin_width)
    bands = [
        library.banded_frame_moments(sea, pulse_width=width, cnr=strongest)[1]
        for width in pulse_width
    ]
    return bin_width * np.arange(max(map(len, bands)), dtype=np.float64)


def check(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) inconsistent settings of the laser radar."""
    window, bin_width = choices.value(Ladar.window), choices.value(Ladar.bin_width)
    if window < 10 * bin_width:
        refuse(Ladar.window, window, f"at least 10 bins of ladar.bin_width {bin_width:g} m")
    max_ifovs = max(choices[Ladar.target_free_ifovs])
    for receiver in choices[Ladar.receiver]:
        if receiver != FULL and max_ifovs > MAX_DRAWN:
            allowed = f"at most {MAX_DRAWN} with the {receiver} receiver, which draws each of them"
            refuse(Ladar.target_free_ifovs, max_ifovs, allowed)
    if {RANGE, views.IRAR} & {*choices.value(Sweep.sensor)}:  # flights also make profiles
        check_profiles(choices)
    if uses_sensor(RANGE)(choices):
        views.check_ranges(choices, Grid.range, Ladar.ifov)
        _compute_ratios(choices, min(choices[Grid.range]))  # without extinction it is higher
        if FULL in choices[Ladar.receiver]:
            _check_cnr(choices)


def check_profiles(choices: Choices) -> None:
    """Refuse pulses too short for the range bins, or a window too short for a ship.

    Every sensor with range profiles calls it in its check.
    """
    check_pulses(choices, Ladar.bin_width)
    if FULL in choices[Ladar.receiver]:
        _check_window(choices)


def check_pulses(choices: Choices, bins: Setting) -> None:
    """Refuse pulses that are too short for some range bins."""
    shortest, widest = min(choices[Grid.pulse_width]), max(choices[bins])
    min_width = shortest_pulse(widest) * 1e9
    if shortest < min_width:
        refuse(Grid.pulse_width, shortest, f"at least {min_width:.3g} for {bins.key} {widest:g} m")


def _check_window(choices: Choices) -> None:
    """Refuse a range window that does not hold every ship with both its ends free."""
    window = choices.value(Ladar.window)
    longest = Grid.pulse_width.in_si(max(choices[Grid.pulse_width]))
    for ship in choices[Grid.ship]:
        reach = meshes.reach(meshes.mesh_source(ship))
        if allowed := window_requirement(window, ship=ship, reach=reach, pulse_width=longest):
            refuse(Ladar.window, window, f"{allowed}{meshes.fault_hint(ship)}")


def _compute_ratios(choices: Choices, slant_range: float) -> list[tuple[float, float]]:
    """Return each `ladar.cnr` with its ratio at a range [km]; refuse ratios over MAX_DECIBELS."""
    pairs, settings = [], (Ladar.cnr, Ladar.cnr_range, Ladar.extinction)
    for cnr, cnr_range, extinction in product(*(choices[setting] for setting in settings)):
        in_si = Ladar.cnr_range.in_si(cnr_range), Ladar.extinction.in_si(extinction)
        try:
            ratio = cnr_at_range(Grid.range.in_si(slant_range), cnr, *in_si)
        except ValueError:
            limit = f"a carrier-to-noise ratio of at most {MAX_DECIBELS:g} dB at {slant_range:g} km"
            refuse(Ladar.extinction, extinction, f"lower, for {limit}")
        pairs.append((cnr, ratio))
    return pairs


def _check_cnr(choices: Choices) -> None:
    """Refuse carrier-to-noise ratios at which single precision loses a ship in the noise floor."""
    farthest, max_ifovs = max(choices[Grid.range]), max(choices[Ladar.target_free_ifovs])
    signals = _compute_ratios(choices, farthest)
    for ship in choices[Grid.ship]:
        min_ratio = faintest_ratio(
            np.ptp(meshes.vertices(ship), axis=0),
            slant_range=Grid.range.in_si(farthest),
            ifov=Ladar.ifov.in_si(max(choices[Ladar.ifov])),
            target_free_ifovs=max_ifovs,
        )
        for cnr, ratio in signals:
            if ratio < min_ratio:
                needed = cnr + 10 * math.log10(min_ratio / max(ratio, 1e-300))
                reason = f"for single precision to hold the profile of {ship} at {farthest:g} km"
                floor = f"over the floor of {max_ifovs} target-free IFOVs"
                refuse(Ladar.cnr, cnr, f"at least {needed:.1f} dB {reason} {floor}")


def loops(choices: Choices) -> list[CompiledLoops]:
    """Return the loops that frames and their densities take."""
    return [FRAMES] * uses_sensor(RANGE)(choices) + [DENSITIES] * stores_moments(choices)


STAGES = (
    corner_offset,
    cnr_at_range,
    ifov_offset,
    extent,
    ifovs,
    offset_extents,
    fineness,
    profile_error,
    within_tolerance,
    expected,
    above_floor,
    averaged,
    covariance,
    profile_bins,
    lags,
)
