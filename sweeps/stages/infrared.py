"""The passive-infrared imager: settings, and ships on its detector."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import infrared as library
from ncti.features.log_polar import INTERPOLATIONS
from ncti.features.segmentation import METHODS as SEGMENTATION_METHODS
from ncti.infrared import Imager, Silhouette
from ncti.render import LineImage, RangeImage
from ncti.render.image import Lattice
from ncti.render.loops import MASK
from sweeps.engine.kinds import Value
from sweeps.engine.seeds import cell_rng
from sweeps.engine.settings import Choices, Run, Setting, Settings, count, draws, number, word
from sweeps.engine.stage import Output, in_memory, plain, stage
from sweeps.stages import views
from sweeps.stages.views import INFRARED, MOST_FRAMES, SHAPES, Arrays, Floats, Grid, looks, quantity

if TYPE_CHECKING:
    from ncti.render.mask import Mask

SENSOR = INFRARED
OPENGL = ("osmesa", "egl")  # engines whose hits `ncti.render.mask` has, too
IMPORTS = ("ncti.infrared.cells",)  # by its stages, when they are called; takes long
IMAGES = "infrared"  # group
VIEW, LOOK = ("ship", "aspect"), ("range", "super_resolution", "frame_count")  # of its dimensions

MOST_OFFSETS = 1000  # of the ship on the pixels
MARGIN = 4  # pixels of sea around a ship

SubpixelOffset = tuple[float, float]  # of the ship origin in a pixel, across and up [pixel]

HALVES = {"none": 2, "perfect": 1, "shifted": 1}
"""By way of super-resolution: how many half pixels of the detector a pixel is wide."""

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
        *(0.25, 0.01, MOST_COVERAGE),
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
    subpixel_offsets = draws(
        4,
        MOST_OFFSETS,
        label="position of the ship on the detector's pixels, by number",
        dimension="phase",
        shown=True,
    )
    orders = draws(
        4, label="order of presentation; 0 is the order of the grid", dimension="order", shown=True
    )


looks_infrared = looks(INFRARED)


# A ship on the detector: its positions on the pixels, and its images


def pack_hits(image: RangeImage | LineImage | Mask) -> Arrays:
    """Return where a range image, lines or a mask show the ship.

    Returns
    -------
    dict of str to ndarray
        lattice : (4,) float64, pixel, origin across and up, and roll; of lines their spacing, 0,
        phase and roll. bits : (byte,) uint8, a bit a pixel; columns : (), of the image, 0 of lines.
        line : (piece,) int32 and span : (piece, 2) float64, begin and end of what lines see.
    """
    if isinstance(image, LineImage):
        lattice = np.array([image.spacing, 0.0, image.phase, image.roll])
        pieces: Arrays = {"line": image.line, "span": image.piece[:, :2]}
        return {"bits": np.zeros(0, np.uint8), "columns": np.array(0), "lattice": lattice, **pieces}
    lattice = np.array([image.pixel, *image.origin, image.roll])
    pixels: Arrays = {"bits": np.packbits(image.hit), "columns": np.array(image.hit.shape[1])}
    return {"line": np.zeros(0, np.int32), "span": np.zeros((0, 2)), "lattice": lattice, **pixels}


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of a ship: (point,) cross-ranges [m], and the area of one [m^2].

    Of lines, points are the corners of their bounding box, and `lines` has what lies between.
    """

    horizontal: Floats
    vertical: Floats
    area: float
    lines: LineImage | None = None

    @classmethod
    def of(cls, hits: Arrays, *, mirrored: bool = False) -> Patches:
        """Patches of a stage `hits`, with left and right swapped or not."""
        pixel, left, bottom, roll = hits["lattice"].tolist()
        if not hits["columns"]:
            span = hits["span"]
            if mirrored:
                span, roll = -span[:, ::-1], -roll
            line = hits["line"]
            # Only the place across the line of sight counts.
            flat = np.concatenate([span, np.zeros_like(span)], axis=1), np.zeros_like(line)
            lines = LineImage(line, *flat, np.zeros((1, 3)), pixel, bottom, 0.0, 0.0, roll)
            return cls(*lines.bounds, pixel**2, lines)
        from ncti.infrared.cells import places_of_bits  # numba takes long to import

        lattice = pixel, (left, bottom), Lattice(pixel, (left, bottom), roll).turn
        horizontal, vertical = places_of_bits(hits["bits"], int(hits["columns"]), *lattice)
        return cls(-horizontal if mirrored else horizontal, vertical, pixel**2)

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """The bounding box, for windows of one shape at all places on the detector."""
        (left, right), (bottom, top) = (
            (float(line.min()), float(line.max())) for line in (self.horizontal, self.vertical)
        )
        return left, right, bottom, top

    def covering(self, footprint: float, place: SubpixelOffset, *, subdivision: int) -> Silhouette:
        """Coverage of a detector's pixels with this footprint [m], or of parts of them."""
        window: dict[str, Any] = {"footprint": footprint, "phase": place, "margin": MARGIN}
        window |= {"extent": self.extent, "subdivision": subdivision}
        if self.lines is not None:
            return library.silhouette(self.lines, **window)
        return library.coverage_of(self.horizontal, self.vertical, area=self.area, **window)


@dataclass(frozen=True, eq=False)
class Look:
    """A ship at one aspect and range on one detector, imaged on request.

    Only the ship and a margin of sea around it are synthesised: sea farther off does not
    affect the ship.
    """

    patches: Patches
    footprint: float  # side of a pixel on the target [m]
    contrast: float  # ship above sea, after the air [K]
    imager: Imager
    seed: int
    name: dict[str, Any]  # ship, aspect and range, which name the noise
    _covered: dict[int, Silhouette] = field(default_factory=dict)
    _drawn: dict[tuple[str, tuple[int, ...]], tuple[np.random.Generator, list[Floats]]] = field(
        default_factory=dict
    )

    @cached_property
    def _places(self) -> list[list[float]]:
        # One stream for all, so that a place does not depend on their number.
        rng = cell_rng(self.seed, stage="infrared_place", **self.name)
        return rng.random((MOST_OFFSETS, 2)).tolist()

    def place(self, offset: int) -> SubpixelOffset:
        """Return the position of the ship origin in a pixel, by its number."""
        across, up = self._places[offset]
        return across, up

    def covered(self, offset: int) -> Silhouette:
        """Coverage of half pixels by the ship at one of its places on the detector."""
        if offset not in self._covered:
            place = self.place(offset)
            self._covered[offset] = self.patches.covering(self.footprint, place, subdivision=2)
        return self._covered[offset]

    def shown(self, offset: int, halves: int) -> NDArray[np.bool_]:
        """(row, col): pixels of 1 or 2 half pixels' width that show the ship."""
        pixels = self.covered(offset).coverage
        if halves > 1:
            rows, cols = (size // halves for size in pixels.shape)
            pixels = pixels.reshape(rows, halves, cols, halves).mean(axis=(1, 3))
        return pixels >= self.imager.coverage_rule

    def images(self, way: str, offsets: tuple[int, ...], frame_counts: tuple[int, ...]) -> Floats:
        """Return (offset, frame_count, row, col) images [K] of one super-resolution method.

        All places are drawn from one stream in turn, so those before the last one wanted, too.
        """
        draw = library.shifted_images if way == "shifted" else library.thermal_images
        if (way, frame_counts) not in self._drawn:
            rng = cell_rng(self.seed, stage="infrared", super_resolution=way, **self.name)
            self._drawn[way, frame_counts] = rng, []
        rng, drawn = self._drawn[way, frame_counts]
        for offset in range(len(drawn), max(offsets) + 1):
            images = draw(
                self.shown(offset, HALVES[way]),
                contrast=self.contrast,
                frame_counts=frame_counts,
                rng=rng,
                nedt=self.imager.nedt,
                target_spread=self.imager.target_spread,
                sea_spread=self.imager.sea_spread,
            )
            drawn.append(images)
        return np.array([drawn[offset] for offset in offsets])


@lru_cache(maxsize=8)  # all ways of super-resolution at one place have it
def whole_window(
    *,
    slant_range: float,
    depression: float,
    ifov: float,
    length: float,
    height: float,
    place: SubpixelOffset = (0.0, 0.0),
) -> Silhouette:
    """Return half pixels of a window for the largest ship, all of them sea.

    At a slant range [m] and depression [deg], of an IFOV [rad]; length and height are the ship's
    [m], and its origin is at a place in a pixel.
    """
    half, down = length / 2, np.radians(depression)
    bottom = -half * np.sin(down)
    top = half * np.sin(down) + height * np.cos(down)
    # The nearest part of the ship looks this much larger than at the range of the ship origin.
    nearest = half * np.cos(down) + height * np.sin(down)
    larger = 1.0 / (1.0 - min(nearest / slant_range, 0.5))
    sides = (-half * larger, half * larger, bottom * larger, top * larger)
    frame: dict[str, Any] = {"extent": sides, "margin": MARGIN}
    pixel = library.footprint(slant_range, ifov)
    sea = np.zeros(0)
    return library.coverage_of(
        sea, sea, area=1.0, footprint=pixel, phase=place, **frame, subdivision=2
    )


# Stages


@plain()
def silhouette_engine(drawing_engine: str) -> str:
    """Return the engine of silhouettes, which need no depth where OpenGL would draw it."""
    return MASK if drawing_engine in OPENGL else drawing_engine


infrared_images = views.image_stages(
    "infrared_image", range=Infrared.range, engine="silhouette_engine"
)
training_images = views.image_stages(
    "training_image", range=Infrared.training_range, engine="silhouette_engine"
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


imager = plain(uses=(Infrared,), name="imager")(Imager)


@in_memory(uses=(Infrared, Grid, Run))
def look(
    hits: Arrays,
    imager: Imager,
    ship: str,
    aspect: float,
    drawn_aspect: float,
    range: float,
    ifov: float,
    seed: int,
) -> Look:
    """Return a ship on the detector."""
    name = {"ship": str(ship), "aspect": aspect, "range": range / views.SI["km"]}
    patches = Patches.of(hits, mirrored=aspect != drawn_aspect)
    contrast = imager.contrast(range)
    return Look(patches, library.footprint(range, ifov), contrast, imager, seed, name)


def check(choices: Choices) -> Choices:
    """Refuse (`ConfigurationError`) ranges and ships that the imager does not resolve or hold."""
    if not looks_infrared(choices):
        return choices
    same = choices[Infrared.range] == choices[Grid.range]
    named = Grid.range if same else Infrared.range
    for setting in (named, Infrared.training_range):
        views.check_ranges(choices, setting, Infrared.ifov, part=0.5)
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
            hold = f"at least {math.ceil(needed)} m to hold {ship}{views.hint(ship)}"
            views.refuse(setting, allowed, hold)
