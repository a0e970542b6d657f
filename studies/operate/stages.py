"""Sufficient sensors: percent identified at random aspects by the settings of both sensors.

Profile, silhouette and both, of one view, are matched with dense templates of all ships by
likelihood, the gain unknown. Both sensors have one aperture: their IFOVs are the same, and so are
their numbers of frames.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.infrared import footprint
from studies.operate import tables
from studies.operate.fleets import MIN_SHIPS
from studies.operate.identify import (
    CHANNELS,
    Trial,
    identify,
    match_silhouettes,
    packed,
    planned_views,
)
from studies.operate.profiles import signatures
from studies.operate.silhouettes import silhouettes
from studies.operate.survey import ViewExtents, draw_views, seen_views
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.settings import Choices, Settings, count
from sweeps.engine.declare.stage import Group, Output, Stream, coordinate, derived, in_memory, stage
from sweeps.stages import views
from sweeps.stages.arguments import restore
from sweeps.stages.infrared import Infrared, check_window
from sweeps.stages.ladar import BEAM, FULL, Ladar, check_profiles, cnr_at_range
from sweeps.stages.likelihood import Likelihood
from sweeps.stages.refusals import refuse, require
from sweeps.stages.views import Arrays, Grid, Render, uses_sensor

if TYPE_CHECKING:
    import trimesh
    import xarray as xr

    from ncti.render import LineImage

SENSOR = "operate"
CONF = Path(__file__).with_name("conf")
IMPORTS = ("scipy.sparse", "scipy.linalg")


class Operate(Settings, key="operate"):
    """Operating points of the sensors."""

    fleet = count(
        [4, 6],
        MIN_SHIPS,
        1000,
        label="ships told apart, the first of grid.ship",
        help="nominal ships come first, then variants by number",
        role="dimension",
    )
    tests = count(
        192, 4, 10**5, label="views identified of any number of ships", not_swept=views.SHAPES
    )
    resamples = count(100, 2, 1000, label="resamples of these views", not_swept=views.SHAPES)


USED = (Operate, Grid, Ladar, Likelihood, Infrared)
OPERATED = Group(
    SENSOR,
    uses_sensor(SENSOR),
    USED,
    ("range", "ifov", "cnr", "pulse_width", "frame_count", "fleet"),
)

# Views of a ship

operate_views = stage(
    Output("aspects", ("view",), "f8"),
    Output("places", ("view", "side"), "f8"),
    uses=USED,
    gather=(Grid.aspect,),
    stream=Stream((Grid.ship,)),
    name="operate_views",
)(planned_views)


@in_memory(uses=(Render,))
def operate_lines(
    mesh: trimesh.Trimesh, operate_views: Arrays, depression: float, pixel: float
) -> list[LineImage]:
    """Return the visible pieces of all views of a ship."""
    return draw_views(mesh, operate_views["aspects"], depression=depression, spacing=pixel)


@derived(uses=(Ladar,), reads={"slant_range": Grid.range})
def operate_footprint(slant_range: float, ifov: float) -> float:
    """Return the side of an IFOV on the target [m]; equal ones share range extents."""
    return round(footprint(slant_range, ifov), 9)


BINS = {name: BEAM[name] for name in ("bin_width", "window", "reflectance")}


@stage(  # arrays of a `ViewExtents`
    Output("fraction", ("sample",)),
    Output("range_bin", ("sample",), "i2"),
    Output("samples", ("seen",), "i4"),
    Output("cell", ("seen", "side"), "i2"),
    Output("ifovs", ("view",), "i4"),
    uses=USED,
    reads={"footprint": "operate_footprint", **BINS},
)
def operate_seen(operate_lines: list[LineImage], operate_views: Arrays, **beam: Any) -> Arrays:
    """Return the range extents of a ship in all views."""
    return vars(seen_views(operate_lines, operate_views["places"], **beam))


# Profiles and silhouettes


@stage(
    Output("excess", ("view", "down_range")),
    Output("power", ("row", "down_range")),
    Output("ifovs", ("test",), "i4"),
    uses=USED,
    along=(Ladar.cnr, Grid.pulse_width),
    gather=(Grid.aspect,),
)
def operate_signatures(
    operate_seen: Arrays,
    cnr: tuple[float, ...],
    pulse_width: tuple[float, ...],
    aspect: tuple[float, ...],
    range: float,
    cnr_range: float,
    extinction: float,
    bin_width: float,
    window: float,
) -> Arrays:
    """Return expected profiles of a ship above the floor, and the power of its tests."""
    return signatures(
        restore(ViewExtents, operate_seen),
        pulse_width=pulse_width,
        cnr=[cnr_at_range.function(range, decibels, cnr_range, extinction) for decibels in cnr],
        bin_width=bin_width,
        bins=round(window / bin_width),
        learned=len(aspect),
    )


@stage(
    Output("shown", ("view", "byte"), "u1"),
    Output("shape", ("side",), "i4"),
    uses=USED,
    reads={
        "footprint": "operate_footprint",
        "depression": "depression",
        "coverage_rule": Infrared.coverage_rule,
        "length": Infrared.window_length,
        "height": Infrared.window_height,
    },
)
def operate_shown(operate_seen: Arrays, **window: Any) -> Arrays:
    """Return the pixels that show a ship."""
    return packed(silhouettes(restore(ViewExtents, operate_seen), **window))


operate_silhouettes = in_memory(
    uses=USED,
    gather=(Grid.ship, Grid.aspect),
    reads={"shown": "operate_shown"},
    stream=Stream(()),
    keep=3,
    name="operate_silhouettes",
)(match_silhouettes)


# Answers

operate_trial = derived(uses=USED, name="operate_trial")(Trial)
identified = OPERATED.stage(
    Output("share", ("channel",), label="share of views identified"),
    Output("resampled", ("channel", "resample"), label="share of views, drawn anew from them"),
    along=(Grid.pulse_width, Grid.frame_count, Operate.fleet),
    gather=(Grid.ship, Grid.aspect),
    stream=Stream(()),
    reads={
        "signatures": "operate_signatures",
        "silhouettes": "operate_silhouettes",
        "trial": "operate_trial",
        "cnr": "cnr_at_range",
        "slant_range": Grid.range,
    },
    name="identified",
)(identify)


@OPERATED.stage(coordinate("channel", ("channel",), "U10", label="sensor that identifies the ship"))
def operate_channels() -> NDArray[np.str_]:
    """Return the names of the channels."""
    return np.array(CHANNELS)


# Tables


def expand_single_values(operated: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return shares over all settings of the laser radar, those with a single value included."""
    of_ladar = (Ladar.ifov, Ladar.cnr, Grid.pulse_width)
    absent = [setting for setting in of_ladar if setting.name not in operated.dims]
    return operated.expand_dims({setting.name: [choices.value(setting)] for setting in absent})


_NOTES = (
    f"The fewest frames by which {tables.LEVEL:.0%} of views at random aspects are identified, "
    "with 95 % intervals over resampled views.",
)
FRAMES = Display(
    "operate",
    "Frames that suffice",
    (Figure("frames", format=".0f", digits=1),),
    rows=("range", "fleet"),
    columns="channel",
    notes=_NOTES,
)
CHEAPEST = Display(
    "operate_cheapest",
    "Cheapest setting that suffices",
    (
        Figure("cost", format=".2g", digits=3),
        Figure("frames", format=".0f", digits=1),
        *(Figure(f"best_{name}") for name in tables.OVER),
        Figure("chosen", percent=True, format=".0f", listed=False),
    ),
    rows=("range", "fleet", "channel"),
    notes=(
        "Cost: energy on the box of a ship times the area of the aperture, over those of 16 "
        "frames at 32 dB and 150 urad. Pulse width and imager cost nothing. Beyond the grid: no "
        "setting of the sweep suffices.",
    ),
)
STAGES = (
    operate_views,
    operate_lines,
    operate_footprint,
    operate_seen,
    operate_signatures,
    operate_shown,
    operate_silhouettes,
    operate_trial,
    identified,
    operate_channels,
)
TABLES = (
    OPERATED.table(
        "operate", lambda *inputs: tables.tabulate_frames(expand_single_values(*inputs)), FRAMES
    ),
    OPERATED.table(
        "operate_cheapest",
        lambda *inputs: tables.tabulate_cheapest(expand_single_values(*inputs)),
        CHEAPEST,
    ),
)


def check_first(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) fleets larger than the grid, before building any ship."""
    if uses_sensor(SENSOR)(choices):
        ships, largest = len(choices[Grid.ship]), max(choices[Operate.fleet])
        if largest > ships:
            refuse(Operate.fleet, largest, f"at most {ships}, the number of ships of grid.ship")


def check(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) settings that the sensor `operate` does not support."""
    if not uses_sensor(SENSOR)(choices):
        return
    check_profiles(choices)
    require(choices, Ladar.receiver, FULL, f"with the sensor {SENSOR}")
    for spread in choices[Infrared.sea_spread]:
        if {spread} != {*choices[Infrared.target_spread]}:
            reason = f"infrared.target_spread with the sensor {SENSOR}"
            refuse(Infrared.sea_spread, spread, f"equal to {reason}")
    if len(choices[Grid.aspect]) < 2:
        reason = "two values or more: views to identify lie at random between its ends"
        refuse(Grid.aspect, choices[Grid.aspect][0], reason)
    check_window(choices)
    views.check_ranges(choices, Grid.range, Ladar.ifov)
