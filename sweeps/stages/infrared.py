"""The passive-infrared imager: settings, and ships on its detector."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ncti import infrared as library
from ncti.features.log_polar import INTERPOLATIONS
from ncti.features.segmentation import METHODS as SEGMENTATION_METHODS
from sweeps.engine.errors import ConfigurationError
from sweeps.engine.kinds import Value
from sweeps.engine.settings import Choices, Run, Setting, Settings, count, draws, number, word
from sweeps.engine.stage import Output, Stage, in_memory, stage
from sweeps.stages import views
from sweeps.stages.infrared_look import Bits, Look, Patches, footprint_at, pack_hits
from sweeps.stages.views import INFRARED, MOST_FRAMES, SHAPES, Grid, looks, quantity

SENSOR = INFRARED
IMPORTS = ("ncti.infrared.cells",)  # by its stages, when they are called; takes long
IMAGES = "infrared"  # group
VIEW, LOOK = ("ship", "aspect"), ("range", "super_resolution", "frame_count")  # of its dimensions

# Of one frame [K]. What the most frames and the recombination of shifted ones leave of it,
# 0.5 / sqrt(10,000), is still no less than the 1e-6 K that matched segmentation can tell from 0.
LEAST_NEDT = 1e-3

# Patches of ship are counted, so a pixel that the ship fills may come out a patch or so short of
# 1, by chance: a rule above this share would drop such pixels at random.
MOST_COVERAGE = 0.95


def _as(grid: Setting) -> dict[str, Any]:
    """Return what is said of an axis whose values are the grid's unless others are given."""
    return {"fallback": grid, "help": f"null: that of {grid.key}", "shown": True}


class Infrared(Settings, key="infrared"):
    """The passive-infrared imager: its array, the air, the scene, and what is made of an image."""

    ifov = quantity(150, 1, 100e3, "urad", "field of view of a pixel")
    contrast_at_zero = quantity(
        library.CONTRAST_AT_ZERO, 0, 1000, "K", "contrast of ship to sea at zero range"
    )
    extinction = quantity(0.181, 0, 10, "dB km-1", "extinction in the air, one way")
    nedt = quantity(library.NEDT, LEAST_NEDT, 1000, "K", "noise of one frame")
    target_spread = quantity(
        *(library.SPREAD, 0, 1000, "K", "spread of the ship's own temperatures"),
        help="assumed, and decisive at 100 km; per pixel of the detector, and not reduced by "
        "averaging frames (half pixels of shifted scenes have twice as much, which the detector "
        "averages out); with perfect per half pixel, as the source assumes",
    )
    sea_spread = quantity(
        library.SPREAD,
        0,
        1000,
        "K",
        "spread of the sea's own temperatures",
        help="as target_spread",
    )
    false_alarm = number(
        1e-6, 1e-12, 0.5, label="false-alarm probability of one pixel of sea, for the detector"
    )
    window_length = quantity(
        200, 1, 5000, "m", "length of the longest ship in images", fixed=SHAPES
    )
    window_height = quantity(50, 1, 500, "m", "height of the highest ship in images", fixed=SHAPES)
    range = quantity(None, 1, 1000, "km", "slant range", **_as(Grid.range))
    frame_count = count(
        None, 1, MOST_FRAMES, label="infrared frames averaged", **_as(Grid.frame_count)
    )
    super_resolution = word(
        list(library.SUPER_RESOLUTIONS),
        library.SUPER_RESOLUTIONS,
        label="super-resolution method",
        help="perfect: half pixels with the noise of whole ones, the source's assumption; shifted: "
        "recombined from frame_count frames at each of four places of the detector, so "
        "4 x frame_count in all",
        shown=True,
    )
    coverage_rule = number(
        0.25,
        0.01,
        MOST_COVERAGE,
        label="share of a pixel that a ship must fill to show",
        help="at most 0.95, since by counting patches even full pixels come out up to 4 % short "
        "at 25 km",
        noted=True,
    )
    segmentation = word(
        "matched",
        SEGMENTATION_METHODS,
        label="segmentation method of silhouettes",
        help="takes pixels as independent; neighbours in a shifted image share noise",
        noted=True,
    )
    inner_radius = number(
        *(0.5, 0.01, 2),
        label="inner radius of the log-polar map, in sqrt(area / pi)",
        help="a compromise between scores and categories of the source's Table 5",
        noted=True,
    )
    interpolation = word(
        "nearest",
        INTERPOLATIONS,
        label="interpolation of the log-polar map",
        help="nearest: the plain map, as the source's; bilinear is the more invariant one and "
        "forms as many categories at a vigilance of 0.94 as the plain one at 0.87",
        noted=True,
    )
    training_range = quantity(
        25, 1, 1000, "km", "slant range of the noiseless training silhouettes"
    )
    vigilance = number(None, 0, 1, label="vigilance in training", **_as(Grid.vigilance))
    phases = draws(
        4,
        label="position of the ship on the detector's pixels, by number",
        dimension="phase",
        shown=True,
    )
    orders = draws(
        4,
        label="order of presentation; 0 is the order of the grid",
        dimension="order",
        shown=True,
    )


looks_infrared = looks(INFRARED)

infrared_depression = replace(
    views.depression, name="infrared_depression", reads={"range": Infrared.range}
)
training_depression = replace(
    views.depression, name="training_depression", reads={"range": Infrared.training_range}
)
infrared_images = views.image_stages(
    "infrared_image", range=Infrared.range, depression="infrared_depression"
)
training_images = views.image_stages(
    "training_image", range=Infrared.training_range, depression="training_depression"
)

hits = stage(
    Output("bits", ("byte",), "u1"),
    Output("columns", dtype="i8"),
    Output("lattice", ("part",), "f8"),
    Output("line", ("piece",), "i4"),
    Output("span", ("piece", "end"), "f8"),
    reads={"image": "infrared_image"},
    name="hits",
)(pack_hits)
training_hits = replace(hits, name="training_hits", reads={"image": "training_image"})


@in_memory(uses=(Infrared, Grid, Run))
def look(
    hits: Bits,
    ship: str,
    aspect: float,
    drawn_aspect: float,
    range: float,
    ifov: float,
    coverage_rule: float,
    contrast_at_zero: float,
    extinction: float,
    nedt: float,
    target_spread: float,
    sea_spread: float,
    seed: int,
) -> Look:
    """Return a ship on the detector."""
    contrast = library.contrast(
        range * 1e3, contrast_at_zero=contrast_at_zero, extinction=extinction * 1e-3
    )
    name = {"ship": str(ship), "aspect": aspect, "range": range}
    noise = (nedt, target_spread, sea_spread, seed)
    patches = Patches.of(hits, mirrored=aspect != drawn_aspect)
    return Look(patches, footprint_at(range, ifov), coverage_rule, contrast, *noise, name)


def check(choices: Choices) -> Choices:
    """Refuse (`ConfigurationError`) ranges and ships that the imager does not resolve or hold."""
    if not looks_infrared(choices):
        return choices
    same = choices[Infrared.range] == choices[Grid.range]
    named = Grid.range if same else Infrared.range
    narrowest = min(choices[Infrared.ifov]) / 2
    for setting in (named, Infrared.training_range):
        for where in choices[setting]:
            views.check_range(
                choices, setting.key, where, narrowest=narrowest, beam="half infrared.ifov"
            )
    for ship in choices[Grid.ship]:
        check_window(choices, ship)
    return choices


def check_window(choices: Choices, ship: Value) -> None:
    """Refuse a ship that images do not hold."""
    vertices = views.description(views.hull(ship)).vertices
    longest = 2 * float(np.hypot(vertices[:, 0], vertices[:, 1]).max())
    highest = float(vertices[:, 2].max())
    for setting, needed in ((Infrared.window_length, longest), (Infrared.window_height, highest)):
        allowed = choices.one(setting)
        if needed > allowed:
            raise ConfigurationError(
                f"{setting.key} is {allowed:g} m, but must be at least {math.ceil(needed)} m to "
                f"hold {ship}{views.hint(ship)}"
            )


SETTINGS: tuple[type[Settings], ...] = (Infrared,)
STAGES: tuple[Stage, ...] = (
    *(infrared_depression, training_depression, *infrared_images, *training_images),
    *(hits, training_hits, look),
)
