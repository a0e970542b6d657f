"""A scan of the field of regard: the imager detects, the laser radar visits and identifies.

Ships of the grid and a decoy lie in it at random, at aspects that no template has.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.evaluate import wilson_interval
from ncti.labels import labelled_dataset
from ncti.ladar import RangeExtent, banded_frame_moments
from ncti.ladar.window import EDGE_SHARE
from studies.scan.field import Box, Field
from studies.scan.imager import Imager, observe
from studies.scan.schedule import Rates, max_pulse_rate
from studies.scan.targets import Survey, Target, box
from studies.scan.visits import (
    Laser,
    identify_visits,
    known_similarity,
    search_outcome,
    visit_templates,
)
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.settings import Choices, Settings, Unit, count, number, word
from sweeps.engine.declare.stage import Group, Output, Stream, coordinate, derived, in_memory, stage
from sweeps.stages import views
from sweeps.stages.classifier import check_receiver
from sweeps.stages.infrared import Infrared, check_window
from sweeps.stages.ladar import Ladar, check_profiles
from sweeps.stages.likelihood import Likelihood
from sweeps.stages.refusals import refuse, require
from sweeps.stages.views import Arrays, Grid, Render, Scene, quantity, uses_sensor

if TYPE_CHECKING:
    import trimesh
    import xarray as xr

SENSOR = "scan"
CONF = Path(__file__).with_name("conf")
IMPORTS = ("ncti.classify.likelihood",)
BARGE, NO_DECOY = "barge", "none"
DECOY = "decoy"  # name of the last target
DEGREE = Unit("degree", math.pi / 180)


class Scan(Settings, key="scan"):
    """The search of the field of regard.

    The article gives both fields (12 x 12 deg of the imager, 2 x 3 deg of the laser radar), the
    IFOV and the 2 x 2 detector. Rates, the imager's array and the decoy are assumptions.
    """

    width = quantity(3, 0.1, 60, DEGREE, "width of the field of regard")
    height = quantity(2, 0.1, 60, DEGREE, "height of the field of regard")
    detector = count(2, 1, 64, label="elements of the laser radar along a side of its detector")
    pulse_rate = quantity(
        *(1000, 1, 1e9, "Hz", "pulses of the laser radar a second, one a frame"),
        help="at most that of an unambiguous range",
    )
    imager_pixels = count(256, 1, 10**5, label="pixels along a side of the imager's array")
    imager_frames = count(16, 1, 10**4, label="frames averaged by the imager")
    frame_rate = quantity(30, 0.01, 1e6, "Hz", "frames of the imager a second")
    slew_time = quantity(0.1, 0, 100, "s", "time of a move to a visit, or of the imager's array")
    depth = number(0.05, 0, 0.5, label="share of the range by which targets are nearer or farther")
    decoy = word(
        BARGE,
        (BARGE, NO_DECOY),
        label="decoy among the ships",
        help="barge: a box as warm as the ships",
    )
    decoy_length = quantity(120, 1, 1000, "m", "length of the decoy")
    decoy_beam = quantity(20, 1, 1000, "m", "beam of the decoy")
    decoy_height = quantity(8, 0.1, 100, "m", "height of the decoy above the sea")
    known_views = count(64, 1, 10**4, label="views of each ship that set the rejection threshold")
    lost = number(0.05, 0, 0.99, label="share of known ships that the rejection threshold rejects")


USED = (Scan, Grid, Render, Ladar)
FIELD = Group(SENSOR, uses_sensor(SENSOR), USED, status=views.STATUS)


@FIELD.stage(
    coordinate("target", ("target",), "U64", label="target in the field"), gather=(Grid.ship,)
)
def scan_names(ship: tuple[str, ...], decoy: str) -> NDArray[np.str_]:
    """Return the names of all targets."""
    return np.array([*map(str, ship), *([DECOY] if decoy != NO_DECOY else [])])


@FIELD.stage(
    coordinate("edge", ("edge",), "U8", label="side of a box of pixels, the last two behind it")
)
def scan_edges() -> NDArray[np.str_]:
    """Return the names of a box's edges."""
    return np.array(Box._fields)


# Targets

field = derived(uses=(Scan, Ladar), name="field")(Field)
survey = derived(
    uses=(Scan, Grid, Ladar),
    reads={
        "slant_range": Grid.range,
        "length": Infrared.window_length,
        "height": Infrared.window_height,
    },
    name="survey",
)(Survey)

# Arrays of a target, padded with empty IFOVs to the largest number that any ship has.
TARGET = (
    *(Output(name, dtype="f8") for name in ("true_aspect", "offset", "slant_range")),
    Output("fraction", ("ifov", "down_range")),
    Output("cell", ("ifov", "side"), "i4"),
)


@stage(*TARGET, uses=USED, gather=(Grid.aspect,), stream=Stream((Grid.ship, Grid.replicate)))
def scan_target(
    mesh: trimesh.Trimesh, survey: Survey, aspect: tuple[float, ...], rng: np.random.Generator
) -> Arrays:
    """Return the view of a ship in the field, at the same aspects and positions for every range."""
    return survey.arrays(survey.target(mesh, aspect, rng))


@stage(
    *TARGET,
    uses=USED,
    gather=(Grid.aspect,),
    stream=Stream((Grid.replicate,)),
)
def scan_decoy(
    survey: Survey,
    decoy: str,
    decoy_length: float,
    decoy_beam: float,
    decoy_height: float,
    aspect: tuple[float, ...],
    rng: np.random.Generator,
) -> Arrays:
    """Return the view of the decoy, empty if there is none."""
    barge = box(decoy_length, decoy_beam, decoy_height)
    arrays = survey.arrays(survey.target(barge, aspect, rng))
    return arrays if decoy != NO_DECOY else {**arrays, "fraction": 0 * arrays["fraction"]}


@in_memory(uses=(Scan,), gather=(Grid.ship,))
def targets(survey: Survey, scan_target: Arrays, scan_decoy: Arrays) -> list[Target]:
    """Return the ships of the field, and the decoy behind them if there is one."""
    ships = len(scan_target["fraction"])
    target_arrays = [{name: array[k] for name, array in scan_target.items()} for k in range(ships)]
    if scan_decoy["fraction"].any():
        target_arrays.append(scan_decoy)
    return [survey.restore(arrays) for arrays in target_arrays]


# Detections of the imager

scan_imager = derived(
    uses=(Infrared, Scan), reads={"frame_count": Scan.imager_frames}, name="scan_imager"
)(Imager)
_target_output = partial(Output, dims=("target",), dtype="i4")
_box_output = partial(Output, dims=("detection", "edge"), dtype="i4", pad=-1)
_ship_output = partial(Output, dims=("detection",), dtype="i4", pad=-2)

detected = FIELD.stage(
    _target_output("column", label="column of a target's origin in the field"),
    _target_output("row", label="row of a target's origin in the field"),
    _target_output("true_aspect", dtype="f4", label="aspect of a target", unit="degree"),
    _target_output("slant_range", dtype="f4", label="slant range of a target", unit="m"),
    _target_output("shown", label="pixels that show a target"),
    _target_output("hot", label="pixels of a target above the threshold"),
    _target_output(
        "detection_probability",
        dtype="f4",
        label="probability that a target is detected, in closed form",
    ),
    Output("alarms", dtype="i4", label="pixels of the sea above the threshold"),
    _ship_output("source", label="detected target; -1 for the sea"),
    _box_output("box", label="pixels of a detection"),
    _box_output("visit", label="pixels of the visit to a detection"),
    reads={"imager": "scan_imager"},
    stream=Stream((Grid.range, Grid.replicate), "scan_detected"),
    name="detected",
)(observe)


# Visits of the laser radar

DRAW = Grid.replicate.name

laser = derived(uses=(Grid, Ladar, Scan), name="laser")(Laser)
rates = derived(uses=(Scan,), name="rates")(Rates)


# Templates of known ships


@stage(
    Output("mean", ("down_range",), "f8"),
    Output("band", ("lag", "down_range"), "f8", pad=0),
    Output("ifovs", dtype="i8"),
    uses=USED,
)
def moments(ifovs: RangeExtent, pulse_width: float, cnr_at_range: float) -> Arrays:
    """Return mean and covariance of one frame of the IFOVs that see a ship, and their number."""
    mean, band = banded_frame_moments(
        ifovs, pulse_width=pulse_width, cnr=cnr_at_range, target_free_ifovs=0
    )
    return {"mean": mean, "band": band, "ifovs": np.array(len(ifovs.cell))}


templates = in_memory(
    uses=(Grid, Ladar, Likelihood),
    reads={"cnr": "cnr_at_range"},
    gather=(Grid.ship, Grid.aspect),
    name="templates",
)(visit_templates)

known = stage(
    Output("similarity", ("view",), "f8"),
    uses=USED,
    along=(Grid.frame_count,),
    gather=(Grid.aspect,),
    stream=Stream((Grid.ship, Grid.range), "scan_known"),
    name="known",
)(known_similarity)

visited = FIELD.stage(
    _ship_output("named", label="ship predicted by a visit"),
    Output(
        "similarity", ("detection",), pad=np.nan, label="cosine similarity to the nearest profile"
    ),
    along=(Grid.frame_count,),
    stream=Stream((Grid.range, Grid.replicate), "scan_visited"),
    name="visited",
)(identify_visits)

COUNTS = {
    "detected": "ships detected",
    "right": "ships detected and identified correctly",
    "wrong": "ships detected and misidentified",
    "turned_away": "ships detected and rejected",
    "decoys": "decoys in the field",
    "decoys_detected": "decoys detected",
    "decoys_rejected": "decoys detected and rejected",
    "false": "detections of the sea",
    "false_rejected": "detections of the sea that are rejected",
}
TIMES = {
    "imaging": "time of the imager",
    "slewing": "time of moves to visits",
    "dwelling": "time of visits",
    "total": "time of the search",
    "exhaustive": "time of the laser radar over the whole field",
}

outcome = FIELD.stage(
    Output("threshold", label="rejection threshold of the similarity"),
    Output("accepted", ("detection",), "i1", pad=-1, label="1 where a visit is accepted as a ship"),
    *(Output(name, dtype="i4", label=label) for name, label in COUNTS.items()),
    *(Output(name, dtype="f8", unit="s", label=label) for name, label in TIMES.items()),
    gather=(Grid.ship,),
    name="outcome",
)(search_outcome)


# Checks


def check(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) fields, ranges and rates that cannot be searched."""
    if not uses_sensor(SENSOR)(choices):
        return
    check_profiles(choices)
    check_receiver(choices, "likelihood")
    if {*choices[Ladar.ifov], *choices[Infrared.ifov]} != {choices[Ladar.ifov][0]}:
        reason = f"with the sensor {SENSOR}: both sensors look through one aperture"
        refuse(Infrared.ifov, max(choices[Infrared.ifov]), f"one number, of ladar.ifov, {reason}")
    require(choices, Render.tolerance, None, f"with the sensor {SENSOR}")
    require(choices, Ladar.reflectance, "projected_area", f"with the sensor {SENSOR}")
    far = Grid.range.in_si(max(choices[Grid.range])) * (1 + max(choices[Scan.depth]))
    max_rate, pulse_rate = max_pulse_rate(far), max(choices[Scan.pulse_rate])
    if pulse_rate > max_rate:
        reason = f"for pulses to be back from {far * 1e-3:g} km before the next ones leave"
        refuse(Scan.pulse_rate, pulse_rate, f"at most {max_rate:.0f} Hz {reason}")
    check_window(choices)
    _check_decoy(choices)
    views.check_ranges(choices, Grid.range, Ladar.ifov)
    for slant_range in choices[Grid.range]:
        _check_field(choices, slant_range)


def _check_decoy(choices: Choices) -> None:
    """Refuse a decoy larger than the largest allowed ship."""
    across = math.hypot(max(choices[Scan.decoy_length]), max(choices[Scan.decoy_beam]))
    for setting, needed, limit in (
        (Scan.decoy_length, across, Infrared.window_length),
        (Scan.decoy_height, max(choices[Scan.decoy_height]), Infrared.window_height),
        (Scan.decoy_length, across / (1 - 2 * EDGE_SHARE), Ladar.window),
    ):
        most = choices.value(limit)
        if needed > most:
            reason = f"for the decoy to be within {limit.key}, {most:g} m"
            refuse(setting, max(choices[setting]), f"less {reason}")


def _check_field(choices: Choices, slant_range: float) -> None:
    """Refuse ranges [km] at which the field is too narrow or too low for its targets."""
    targets = len(choices[Grid.ship]) + (BARGE in choices[Scan.decoy])
    width, longest = min(choices[Scan.width]), choices.value(Infrared.window_length)
    nearest = 2e-3 * longest * targets / math.radians(width)
    if slant_range < nearest:
        side_by_side = f"for {targets} targets to lie side by side in a field of {width:g} deg"
        refuse(Grid.range, slant_range, f"at least {nearest:.3g} km {side_by_side}")
    # On a flat sea the nearest target is lowest in the field.
    deep, height = max(choices[Scan.depth]), min(choices[Scan.height])
    for depression in depressions(choices, slant_range):
        steep = math.sin(math.radians(depression)) / (1 - deep)
        low = math.degrees(math.asin(steep)) - depression if steep < 1 else math.inf
        if low > height / 2:
            reason = f"for targets at {slant_range:g} km to lie in a field {height:g} deg high"
            refuse(Scan.depth, deep, f"less {reason}")


def depressions(choices: Choices, slant_range: float) -> set[float]:
    """Return the depressions [deg] of the field's middle, in every geometry."""
    scenes = (Scene.geometry, Scene.depression, Scene.altitude, Scene.earth_radius)
    combinations = product(*(choices[scene] for scene in scenes))
    return {views.depression(Grid.range.in_si(slant_range), *scene) for scene in combinations}


# The table

SHARES = {  # numerator and denominator of each share
    "detected": ("detected", "ships"),
    "right": ("right", "detected"),
    "wrong": ("wrong", "detected"),
    "away": ("turned_away", "detected"),
    "identified": ("right", "ships"),
    "decoys": ("decoys_detected", "decoys"),
    "rejected": ("decoys_rejected", "decoys_detected"),
    "false_rejected": ("false_rejected", "false"),
}
LISTED = {"detected", "right", "rejected", "false_rejected"}  # of them, on the screen
MEANS = {"false_a_field": "false", "alarms_a_field": "alarms"} | {name: name for name in TIMES}


def tabulate(scan: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return shares over all draws with 95 % Wilson intervals, and means of counts and times.

    A share without trials is NaN, and its interval runs from 0 to 1.
    """
    import xarray as xr

    if DRAW not in scan.dims:
        scan = scan.expand_dims(DRAW)
    ships = len(choices[Grid.ship])
    whole_field = xr.full_like(scan.detected, ships).assign_attrs(long_name="all ships")
    complete = scan.detected >= 0  # -1: the cell failed
    scan = scan.assign(ships=whole_field).drop_dims("detection").where(complete)
    totals, detectable = scan[[*COUNTS, "ships"]].sum(DRAW), scan.detection_probability
    detected = detectable.isel(target=slice(ships)).mean("target").mean(DRAW)
    arrays: dict[str, tuple[Any, ...]] = {
        "draws": (complete.sum(DRAW), "draws of the field"),
        "detection_probability": (detected, "share of ships detected, in closed form"),
    }
    for name, parts in SHARES.items():
        hits, trials = xr.broadcast(*(totals[part] for part in parts))
        low, high = wilson_interval(hits, trials)
        label = ", as a share of ".join(scan[part].long_name for part in parts)
        arrays |= {
            f"share_{name}": (hits / trials.where(trials > 0), label),
            f"share_{name}_low": (hits.copy(data=low), "low end of its 95 % Wilson interval"),
            f"share_{name}_high": (hits.copy(data=high), "high end of its 95 % Wilson interval"),
            f"share_{name}_of": (trials, "number of trials of the share"),
        }
    for name, figure in MEANS.items():
        mean = scan[figure].mean(DRAW)
        arrays[name] = (mean, f"{scan[figure].long_name}, mean of draws", scan[figure].units)
    ratio = arrays["exhaustive"][0] / arrays["total"][0]
    arrays["gain"] = (ratio, "time of the laser radar over the whole field over the search's")
    return labelled_dataset(arrays)


_percent = partial(Figure, percent=True, format=".0f")
_shown = partial(Figure, format=".1f")
DISPLAY = Display(
    "scan",
    "Scan of the field of regard",
    (
        *(_percent(f"share_{name}", f"percent_{name}", listed=name in LISTED) for name in SHARES),
        _percent("detection_probability", "percent_detected_in_closed_form"),
        *(_shown(name, listed=name in ("total", "exhaustive", "false_a_field")) for name in MEANS),
        _shown("gain"),
        Figure("draws", listed=False),
    ),
    rows=("range", "frame_count"),
    notes=(
        "With 95 % Wilson intervals. Ships are at aspects without a template. Right: of the ships "
        "detected, the most probable ship is the true one, and its similarity exceeds the "
        "rejection threshold. Frames are those of the laser radar; in an exhaustive search it "
        "takes as many at every place of the field.",
    ),
)
STAGES = (
    scan_names,
    scan_edges,
    field,
    survey,
    scan_target,
    scan_decoy,
    targets,
    scan_imager,
    detected,
    laser,
    rates,
    moments,
    templates,
    known,
    visited,
    outcome,
)
TABLES = (FIELD.table("scan", tabulate, DISPLAY),)
