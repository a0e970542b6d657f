"""The passive-infrared imager: ships on its detector, their detection, images and silhouettes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import features
from ncti import infrared as library
from ncti.evaluate import aspect_bins
from ncti.features.log_polar import INTERPOLATIONS
from ncti.features.segmentation import METHODS as SEGMENTATION_METHODS
from ncti.infrared import Imager, Silhouette
from ncti.infrared.super_resolution import enlarge
from ncti.render import LineImage, RangeImage
from ncti.render.image import Lattice
from ncti.render.loops import MASK
from sweeps.engine.display import Display, Figure
from sweeps.engine.seeds import cell_rng
from sweeps.engine.settings import (
    COORDINATE,
    DIMENSION,
    Choices,
    Run,
    Setting,
    Settings,
    count,
    draws,
    number,
    word,
)
from sweeps.engine.stage import (
    SHARE,
    Group,
    Output,
    Table,
    coordinate,
    in_memory,
    inner,
    plain,
    stage,
)
from sweeps.stages import views
from sweeps.stages.ladar import subpixel_offset
from sweeps.stages.scores import with_bins
from sweeps.stages.views import Arrays, Floats, Grid, data_set, looks, quantity

if TYPE_CHECKING:
    import xarray as xr

    from ncti.render.mask import Mask

SENSOR = views.INFRARED
OPENGL = ("osmesa", "egl")  # engines whose hits `ncti.render.mask` has, too
# By its stages, when they are called; takes long.
IMPORTS = ("ncti.infrared.cells", "skimage.filters")
VIEW, LOOK = ("ship", "aspect"), ("range", "super_resolution", "frame_count")  # of its dimensions

LEAST_CONTRAST = 1e-6  # K, below which the relative error of images is undefined
PLACE = "{} place on the target, the ship origin within a pixel"
SEEN = ("range", "frame_count")  # axes of the sensor
OVER = (*VIEW, "phase")  # what tables of images are means over

ANGLES, RADII = 64, 32  # cells of the log-polar map
STEPS = 255  # of a cell between empty and full

OF_SILHOUETTES = ("coverage_rule", "segmentation", "inner_radius", "interpolation")

MOST_OFFSETS = 1000  # of the ship on the pixels
MARGIN = 4  # pixels of sea around a ship

Bytes = NDArray[np.uint8]
SubpixelOffset = tuple[float, float]  # of the ship origin in a pixel, across and up [pixel]

HALVES = {"none": 2, "perfect": 1, "shifted": 1}
"""By way of super-resolution: how many half pixels of the detector a pixel is wide."""

WHOLE = HALVES["none"]  # of a pixel of the detector

# Of one frame [K]. What the most frames and the recombination of shifted ones leave of it,
# 0.5 / sqrt(10,000), is still no less than the 1e-6 K that matched segmentation can tell from 0.
LEAST_NEDT = 1e-3

# Patches of ship are counted, so a pixel that the ship fills may come out a patch or so short of
# 1, by chance: a rule above this share would drop such pixels at random.
MOST_COVERAGE = 0.95


def _as(grid: Setting) -> dict[str, Any]:
    """Return what is said of an axis whose values are the grid's unless others are given."""
    return {"fallback": grid, "help": f"null: that of {grid.key}", "single": DIMENSION}


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
        200, 1, 5000, "m", "length of the longest ship in images", fixed=views.SHAPES
    )
    window_height = quantity(
        50, 1, 500, "m", "height of the highest ship in images", fixed=views.SHAPES
    )
    range = quantity(None, 1, 1000, "km", "slant range", **_as(Grid.range))
    frame_count = count(
        None, 1, views.MOST_FRAMES, label="infrared frames averaged", **_as(Grid.frame_count)
    )
    super_resolution = word(
        list(library.SUPER_RESOLUTIONS),
        library.SUPER_RESOLUTIONS,
        label="super-resolution method",
        help="perfect: half pixels with the noise of whole ones, the source's assumption; shifted: "
        "recombined from frame_count frames at each of four places of the detector, so "
        "4 x frame_count in all",
        single=DIMENSION,
    )
    coverage_rule = number(
        *(0.25, 0.01, MOST_COVERAGE),
        label="share of a pixel that a ship must fill to show",
        help="at most 0.95, since by counting patches even full pixels come out up to 4 % short "
        "at 25 km",
        single=COORDINATE,
    )
    segmentation = word(
        "matched",
        SEGMENTATION_METHODS,
        label="segmentation method of silhouettes",
        help="takes pixels as independent; neighbours in a shifted image share noise",
        single=COORDINATE,
    )
    inner_radius = number(
        *(0.5, 0.01, 2),
        label="inner radius of the log-polar map, in sqrt(area / pi)",
        help="a compromise between scores and categories of the source's Table 5",
        single=COORDINATE,
    )
    interpolation = word(
        "nearest",
        INTERPOLATIONS,
        label="interpolation of the log-polar map",
        help="nearest: the plain map, as the source's; bilinear is the more invariant one and "
        "forms as many categories at a vigilance of 0.94 as the plain one at 0.87",
        single=COORDINATE,
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
        single=DIMENSION,
    )
    orders = draws(
        4,
        label="order of presentation; 0 is the order of the grid",
        dimension="order",
        single=DIMENSION,
    )


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
            line, span = hits["line"], hits["span"]
            if mirrored:
                span, roll = -span[:, ::-1], -roll
                order = np.lexsort((span[:, 0], line))  # pieces of a line are in order
                line, span = line[order], span[order]
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

    @cached_property
    def covered(self) -> Callable[[int], Silhouette]:
        """Coverage of half pixels by the ship at one of its places on the detector, by number."""
        covering = partial(self.patches.covering, self.footprint, subdivision=2)
        return cache(lambda offset: covering(self.place(offset)))

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


# Images

_map = partial(Output, dims=("angle", "radius"), dtype="u1", role=SHARE)

OF_VIEWS = Group(
    "infrared",
    looks(views.INFRARED),
    (Infrared,),
    (*VIEW, *OF_SILHOUETTES, "phase", *LOOK),
    views.STATUS,
)
WINDOW = {  # keywords of `whole_window`
    "slant_range": Infrared.range,
    "depression": "infrared_image_depression",
    "ifov": Infrared.ifov,
    "length": Infrared.window_length,
    "height": Infrared.window_height,
}


@OF_VIEWS.stage(
    Output(
        "image",
        ("row", "col"),
        label="frame-averaged image of the first position, contrast against the mean sea",
        unit="K",
        pad=np.nan,
    ),
    inner("first_row", dtype="i8", label="row of pixels, from the lowest"),
    inner("first_col", dtype="i8", label="column of pixels, from the left"),
    along=(Infrared.frame_count,),
    reads=WINDOW,
)
def thermal_image(
    look: Look, super_resolution: str, frame_count: tuple[int, ...], **window: float
) -> dict[str, NDArray[Any]]:
    """Return images of the first place on the detector, in the window of the largest ship.

    Returns
    -------
    dict of str to ndarray
        image : (frame_count, row, col) [K], NaN where nothing was synthesised; first_row,
        first_col : (frame_count,), where it begins.
    """
    (found,) = look.images(super_resolution, (0,), frame_count)
    whole = whole_window(**window, place=look.place(0))
    ours = look.covered(0).origin
    cells = HALVES[super_resolution]
    rows, cols = (n // cells for n in whole.coverage.shape)
    row, col = (
        round((ours[axis] - whole.origin[axis]) / whole.footprint) // cells for axis in (1, 0)
    )
    placed = np.full((len(frame_count), rows, cols), np.nan)
    # The ship's window may end with a pixel of sea that the whole one does not hold.
    found = found[:, : rows - row, : cols - col]
    placed[:, row : row + found.shape[1], col : col + found.shape[2]] = found
    begin = np.zeros(len(frame_count), dtype=np.int64)
    return {"image": placed, "first_row": begin, "first_col": begin}


@OF_VIEWS.stage(
    coordinate("vertical", ("row",), "f8", PLACE.format("vertical"), "m", pad=np.nan),
    coordinate("horizontal", ("col",), "f8", PLACE.format("horizontal"), "m", pad=np.nan),
    reads=WINDOW,
)
def image_window(super_resolution: str, **window: float) -> dict[str, NDArray[Any]]:
    """Return where the rows and columns of images lie on the target [m]."""
    whole = whole_window(**window)
    found = {}
    for axis, name in enumerate(("vertical", "horizontal")):
        halves = whole.origin[1 - axis] + whole.footprint * np.arange(whole.coverage.shape[axis])
        found[name] = halves.reshape(-1, HALVES[super_resolution]).mean(axis=1)
    return found


@OF_VIEWS.stage(
    Output("detection_probability", label="probability that a pixel of the ship is detected"),
    along=(Infrared.subpixel_offsets, Infrared.frame_count),
)
def detection_probability(
    look: Look, false_alarm: float, subpixel_offsets: tuple[int, ...], frame_count: tuple[int, ...]
) -> Floats:
    """Return the (offset, frame_count) probability that a ship pixel exceeds the threshold."""
    pixels = [np.count_nonzero(look.shown(offset, WHOLE)) for offset in subpixel_offsets]
    detected = np.vectorize(library.detection_probability)
    return detected(
        np.array(pixels)[:, None],
        contrast=look.contrast,
        false_alarm=false_alarm,
        **look.imager.sigmas(np.array(frame_count)),
    )


@OF_VIEWS.stage(
    Output(
        "reconstruction_error",
        label="rms difference from the noiseless image of half the pixel, over the contrast",
    ),
    along=(Infrared.subpixel_offsets, Infrared.frame_count),
)
def reconstruction_error(
    look: Look,
    super_resolution: str,
    subpixel_offsets: tuple[int, ...],
    frame_count: tuple[int, ...],
) -> Floats:
    """Return the (offset, frame_count) error of images, NaN for negligible contrast."""
    if look.contrast < LEAST_CONTRAST:  # no contrast to divide by
        return np.full((len(subpixel_offsets), len(frame_count)), np.nan)
    shown = look.images(super_resolution, subpixel_offsets, frame_count)
    finer = enlarge(shown) if HALVES[super_resolution] == WHOLE else shown
    return np.array(
        [
            library.reconstruction_error(image, look.shown(offset, 1), contrast=look.contrast)
            for offset, image in zip(subpixel_offsets, finer, strict=True)
        ]
    )


# Silhouettes


@OF_VIEWS.stage(
    coordinate(
        "angle", ("angle",), "f8", "angle about the centroid, from the right upwards", "degree"
    ),
    coordinate("radius", ("radius",), "f8", "place between inner (0) and outer (1) log radius"),
)
def map_cells() -> dict[str, NDArray[Any]]:
    """Return the angles and radii of the cells of log-polar maps."""
    return {
        "angle": 360 / ANGLES * (np.arange(ANGLES) + 0.5),
        "radius": (np.arange(RADII) + 0.5) / RADII,
    }


@stage(
    Output("silhouettes", ("row", "byte"), "u1"),
    uses=(Infrared,),
    along=(Infrared.subpixel_offsets, Infrared.frame_count),
)
def silhouettes(
    look: Look,
    super_resolution: str,
    segmentation: str,
    subpixel_offsets: tuple[int, ...],
    frame_count: tuple[int, ...],
) -> Bytes:
    """Return (offset, frame_count, row, byte) masks of images, one bit per pixel."""
    shown = look.images(super_resolution, subpixel_offsets, frame_count)
    known: Any = look.imager.sigmas(np.array(frame_count), super_resolution)
    masks = features.segment(shown, method=segmentation, contrast=look.contrast, **known)
    return np.packbits(masks, axis=-1)


@OF_VIEWS.stage(
    _map("log_polar", label="log-polar map of the segmented silhouette"),
    along=(Infrared.subpixel_offsets, Infrared.frame_count),
)
def log_polar(silhouettes: Bytes, inner_radius: float, interpolation: str) -> Bytes:
    """Return (offset, frame_count, angle, radius) maps."""
    # Padding bits beyond the last column are sea, which does not change the map.
    return maps_of(np.unpackbits(silhouettes, axis=-1).astype(bool), inner_radius, interpolation)


@OF_VIEWS.stage(
    _map("template_log_polar", label="log-polar map of the noiseless training silhouette"),
    uses=(Infrared, Grid),
    reads={"hits": "training_hits"},
    along=(Infrared.subpixel_offsets,),
)
def template_log_polar(
    hits: Arrays,
    aspect: float,
    drawn_aspect: float,
    training_range: float,
    ifov: float,
    coverage_rule: float,
    *,
    inner_radius: float,
    interpolation: str,
    subpixel_offsets: tuple[int, ...],
) -> Bytes:
    """Return (offset, angle, radius) noiseless maps."""
    patches = Patches.of(hits, mirrored=aspect != drawn_aspect)
    side = library.footprint(training_range, ifov)
    shown = [
        patches.covering(side, subpixel_offset(offset), subdivision=1).target(coverage_rule)
        for offset in subpixel_offsets
    ]
    # Without noise every segmentation gives the same mask.
    return maps_of(features.segment(shown, method="otsu"), inner_radius, interpolation)


def maps_of(masks: NDArray[np.bool_], inner_radius: float, interpolation: str) -> Bytes:
    """Return (..., angle, radius) maps of (..., row, col) masks.

    In 255ths of a cell: half a step is nothing beside what a pixel's noise does.
    """
    how: Any = {"inner_radius": inner_radius, "interpolation": interpolation}
    cells = features.log_polar(masks, **how, angles=ANGLES, radii=RADII)
    return np.rint(STEPS * cells).astype(np.uint8)


# Checks


def check(choices: Choices) -> Choices:
    """Refuse (`ConfigurationError`) ranges and ships that the imager does not resolve or hold."""
    if not looks(views.INFRARED)(choices):
        return choices
    same = choices[Infrared.range] == choices[Grid.range]
    named = Grid.range if same else Infrared.range
    for setting in (named, Infrared.training_range):
        views.check_ranges(choices, setting, Infrared.ifov, part=0.5)
    check_window(choices)
    return choices


def check_window(choices: Choices) -> None:
    """Refuse ships that images do not hold."""
    length, height = Infrared.window_length, Infrared.window_height
    for ship in choices[Grid.ship]:
        vertices = views.description(views.hull(ship)).vertices
        longest = 2 * float(np.hypot(vertices[:, 0], vertices[:, 1]).max())
        for setting, needed in ((length, longest), (height, float(vertices[:, 2].max()))):
            if needed > (allowed := choices.one(setting)):
                hold = f"at least {math.ceil(needed)} m to hold {ship}{views.hint(ship)}"
                views.refuse(setting, allowed, hold)


# Tables


def tabulate_detection(images: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the detection probability of ships, from the store's infrared group.

    `probability` by aspect bin, mean over ships, aspects and offsets; `lowest`, the least of all
    views. Views that are not there are left out; NaN where none is.
    """
    import xarray as xr

    found = _measured(images, "detection_probability")
    labels, index = aspect_bins(images.aspect.values)
    bins = [*(np.flatnonzero(index == k) for k in range(len(labels))), np.arange(len(index))]
    name = xr.Variable("aspect_bin", [*labels, "overall"])
    mean, least = (
        xr.concat([reduce(found.isel(aspect=pooled), OVER) for pooled in bins], name)
        for reduce in (xr.DataArray.mean, xr.DataArray.min)
    )
    columns = {
        "probability": (mean, "mean probability that some pixel of the ship passes the threshold"),
        "lowest": (least, "least probability of a view"),
    }
    return with_bins(data_set(columns), images.aspect)


def tabulate_reconstruction(images: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the errors of super-resolved images, from the store's infrared group.

    `error`, mean over ships, aspects and offsets, and `error_spread`, over them. Views that are not
    there, and images without contrast, are left out; NaN where none is.
    """
    error = _measured(images, "reconstruction_error")
    columns = {
        "error": (error.mean(OVER), "rms difference from the noiseless fine image over contrast"),
        "error_spread": (error.std(OVER), "standard deviation of that over views and positions"),
    }
    return data_set(columns)


def tabulate_sensor(images: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return attenuation, contrast and signal-to-noise ratio of a ship by range and frames."""
    import xarray as xr

    axes = {
        name: images[name].drop_vars(set(images.coords) - {name}, errors="ignore") for name in SEEN
    }
    for one in (Infrared.extinction, Infrared.contrast_at_zero, Infrared.nedt):
        swept = one.name in images.dims
        axes[one.name] = images[one.name] if swept else xr.DataArray(choices.one(one))
    whole = dict(zip(axes, xr.broadcast(*axes.values()), strict=True))
    given: dict[str, Any] = {name: one.values for name, one in whole.items()}
    metres = given.pop("range") * 1e3
    air = {"extinction": given.pop("extinction") * 1e-3}
    seen = air | {"contrast_at_zero": given.pop("contrast_at_zero")}
    figures = {
        "attenuation": (library.attenuation(metres, **air), "loss in the air, one way", "dB"),
        "contrast": (library.contrast(metres, **seen), "contrast of ship to sea", "K"),
        "snr": (library.snr(metres, **given, **seen), "signal-to-noise ratio of a pixel"),
    }
    return data_set(
        {
            name: (whole["range"].copy(data=values), *label)
            for name, (values, *label) in figures.items()
        }
    )


def _measured(images: xr.Dataset, name: str) -> xr.DataArray:
    """Return one variable, without the coordinates of how silhouettes are cut out and mapped."""
    found = images[name].load()
    single = [key for key, coord in found.coords.items() if not coord.dims]
    return found.drop_vars([key for key in single if key != "coverage_rule"])


def _table(name: str, tabulate: Any, title: str, figures: tuple[Figure, ...], **how: Any) -> Table:
    """Return a table of images, with one row for each range and number of frames."""
    display = Display(f"infrared_{name}", title, figures, rows=SEEN, **how)
    return OF_VIEWS.table(name, tabulate, display)


TABLES = (
    _table(
        "sensor",
        tabulate_sensor,
        "Passive-infrared sensor",
        (
            Figure("attenuation", digits=3, format=".2f"),
            Figure("contrast", digits=4, format=".3f"),
            Figure("snr", digits=3, format=".1f"),
        ),
        source="sensor",
    ),
    _table(
        "detection",
        tabulate_detection,
        "Probability that the imager detects a ship",
        (
            Figure("probability", format=".1%"),
            Figure("lowest", "lowest_of_views", format=".1%", listed=False),
        ),
        columns="aspect_bin",
    ),
    _table(
        "super_resolution",
        tabulate_reconstruction,
        "Error of infrared images against the noiseless one of half the pixel",
        (Figure("error", beside={"spread": "error_spread"}, digits=4, format=".3f"),),
        columns="super_resolution",
        notes=("Root mean square over the contrast of the ship.",),
    ),
)
