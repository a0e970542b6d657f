"""The passive-infrared imager: ships on its detector, their detection, images and silhouettes."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import features
from ncti import infrared as library
from ncti.evaluate import aspect_bins
from ncti.evaluate.answers import VIEW, add_bin_attribute
from ncti.features.log_polar import INTERPOLATIONS
from ncti.features.map_vector import INNER_RADIUS, INTERPOLATION
from ncti.features.map_vector import map_cells as cells
from ncti.features.segmentation import METHODS as SEGMENTATION_METHODS
from ncti.features.segmentation import largest_region
from ncti.infrared import DetectorView, Hits, Imager, LargestWindow
from ncti.infrared.detector_view import MAX_OFFSETS
from ncti.infrared.loops import IMAGES
from ncti.labels import labelled_dataset
from ncti.ladar import spread_place
from ncti.machine_code import CompiledLoops
from ncti.render import LineImage, RangeImage
from ncti.render.loops import MASK, engine_loops
from sweeps.engine.declare.display import Display, Figure
from sweeps.engine.declare.settings import Choices, Run, Setting, Settings, draws, number, word
from sweeps.engine.declare.stage import (
    SHARE,
    Group,
    Output,
    Table,
    coordinate,
    derived,
    in_memory,
    inner,
    stage,
)
from sweeps.engine.resolve.streams import cell_rng
from sweeps.stages import meshes, views
from sweeps.stages.arguments import restore
from sweeps.stages.refusals import refuse
from sweeps.stages.views import Arrays, Grid, Render, quantity, uses_sensor

if TYPE_CHECKING:
    import xarray as xr

    from ncti.render.mask import Mask

SENSOR = views.INFRARED
OPENGL = ("osmesa", "egl")  # engines whose hits `ncti.render.mask` has, too
IMPORTS = ("ncti.infrared.cells", "scipy.ndimage")
LOOK = ("range", "super_resolution", "frame_count")  # of its dimensions

PLACE = "{} place on the target, the ship origin within a pixel"
SEEN = ("range", "frame_count")  # axes of the sensor
OVER = (*VIEW, "phase")  # dimensions that tables of images average over

OF_SILHOUETTES = ("coverage_rule", "segmentation", "inner_radius", "interpolation")

Bytes = NDArray[np.uint8]

# Noise of one frame [K]. Averaging 10,000 frames and recombining shifted ones scales it by
# 0.5 / sqrt(10,000); the rest still exceeds the 1e-6 K that matched segmentation resolves.
MIN_NEDT = 1e-3

# Coverage is estimated by counting patches, so a pixel that the ship fills may by chance come out
# a patch or so below 1. A rule above this share would drop such pixels at random.
MAX_COVERAGE = 0.95


def _defaulting_to(grid: Setting, label: str = "") -> Setting:
    """Return an axis of the imager whose values default to the grid's."""
    return replace(grid, default=grid, label=label or grid.label, help=f"null: that of {grid.key}")


class Infrared(Settings, key="infrared"):
    """The passive-infrared imager: array, air, scene and image processing."""

    ifov = quantity(150, 1, 100e3, "urad", "field of view of a pixel")
    contrast_at_zero = quantity(
        library.CONTRAST_AT_ZERO, 0, 1000, "K", "contrast of ship to sea at zero range"
    )
    extinction = quantity(0.181, 0, 10, "dB km-1", "extinction in the air, one way")
    nedt = quantity(library.NEDT, MIN_NEDT, 1000, "K", "noise of one frame")
    target_spread = quantity(
        *(library.SPREAD, 0, 1000, "K", "spread of the ship's own temperatures"),
        help="assumed, and decisive at 100 km; per pixel of the detector, and not reduced by "
        "averaging frames (half pixels of shifted scenes have twice as much, which the detector "
        "averages out); with perfect per half pixel, as the article assumes",
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
        200, 1, 5000, "m", "length of the longest ship in images", not_swept=views.SHAPES
    )
    window_height = quantity(
        50, 1, 500, "m", "height of the highest ship in images", not_swept=views.SHAPES
    )
    range = _defaulting_to(Grid.range)
    frame_count = _defaulting_to(Grid.frame_count, "infrared frames averaged")
    super_resolution = word(
        list(library.SUPER_RESOLUTIONS),
        library.SUPER_RESOLUTIONS,
        label="super-resolution method",
        help="perfect: half pixels with the noise of whole ones, the article's assumption; "
        "shifted: recombined from frame_count frames at each of four places of the detector, so "
        "4 x frame_count in all",
        role="dimension",
    )
    coverage_rule = number(
        Imager.coverage_rule,
        low=0.01,
        high=MAX_COVERAGE,
        label="share of a pixel that a ship must fill to show",
        help="at most 0.95, since by counting patches even full pixels come out up to 4 % short "
        "at 25 km",
        role="coordinate",
    )
    segmentation = word(
        "matched",
        SEGMENTATION_METHODS,
        label="segmentation method of silhouettes",
        help="matched takes pixels as independent; neighbours in a shifted image share noise; the "
        "others need the extra segmentation",
        role="coordinate",
    )
    inner_radius = number(
        INNER_RADIUS,
        low=0.01,
        high=2,
        label="inner radius of the log-polar map, in sqrt(area / pi)",
        help="a compromise between scores and categories of the article's Table 5",
        role="coordinate",
    )
    interpolation = word(
        INTERPOLATION,
        INTERPOLATIONS,
        label="interpolation of the log-polar map",
        help="nearest: the plain map, as the article's; bilinear is the more invariant one and "
        "forms as many categories at a vigilance of 0.94 as the plain one at 0.87",
        role="coordinate",
    )
    training_range = quantity(
        25, 1, 1000, "km", "slant range of the noiseless training silhouettes"
    )
    vigilance = _defaulting_to(Grid.vigilance)
    subpixel_offsets = draws(
        4,
        MAX_OFFSETS,
        label="position of the ship on the detector's pixels, by number",
        dimension="phase",
        role="dimension",
    )
    orders = draws(
        4,
        label="order of presentation; 0 is the order of the grid",
        dimension="order",
        role="dimension",
    )


# Stages


@derived()
def silhouette_engine(drawing_engine: str) -> str:
    """Return the engine of silhouettes: a mask in place of OpenGL, since they need no depth."""
    return MASK if drawing_engine in OPENGL else drawing_engine


infrared_images = views.image_stages(
    "infrared_image", range=Infrared.range, engine="silhouette_engine"
)
training_images = views.image_stages(
    "training_image", range=Infrared.training_range, engine="silhouette_engine"
)


@stage(
    Output("bits", ("byte",), "u1"),
    Output("columns", dtype="i8"),
    Output("lattice", ("part",), "f8"),
    Output("line", ("piece",), "i4"),
    Output("span", ("piece", "end"), "f8"),
    reads={"image": "infrared_image"},
)
def hits(image: RangeImage | LineImage | Mask) -> Arrays:
    """Return the pixels or spans of lines at which a view hits the ship."""
    return vars(Hits.of(image))


training_hits = replace(hits, name="training_hits", reads={"image": "training_image"})
imager = derived(uses=(Infrared,), name="imager")(Imager)


@in_memory(uses=(Infrared, Grid, Run))
def detector_view(
    hits: Arrays,
    imager: Imager,
    ship: str,
    aspect: float,
    drawn_aspect: float,
    range: float,
    ifov: float,
    seed: int,
) -> DetectorView:
    """Return a ship on the detector."""
    stream = partial(cell_rng, seed, ship=str(ship), aspect=aspect, range=range / views.SI["km"])
    patches = restore(Hits, hits).patches(mirrored=aspect != drawn_aspect)
    side = library.footprint(range, ifov)
    return DetectorView(patches, side, imager.contrast(range), imager, stream)


# Images

_map = partial(Output, dims=("angle", "radius"), dtype="u1", role=SHARE)

OF_VIEWS = Group(
    "infrared",
    uses_sensor(views.INFRARED),
    (Infrared,),
    (*VIEW, *OF_SILHOUETTES, "phase", *LOOK),
    views.STATUS,
)
DETECTOR_READS = {"self": "detector_view"}  # reads of the methods of `DetectorView`
BY_PLACE: dict[str, Any] = {"along": (Infrared.subpixel_offsets, Infrared.frame_count)}
infrared_window = derived(
    uses=(Infrared,),
    reads={
        "slant_range": Infrared.range,
        "depression": "infrared_image_depression",
        "length": Infrared.window_length,
        "height": Infrared.window_height,
    },
    name="infrared_window",
)(LargestWindow)


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
)
def thermal_image(
    detector_view: DetectorView,
    infrared_window: LargestWindow,
    super_resolution: str,
    frame_count: tuple[int, ...],
) -> Arrays:
    """Return images [K] in the window of the largest ship, and its first row and column."""
    begin = np.zeros(len(frame_count), dtype=np.int64)
    image = detector_view.image_in(infrared_window, super_resolution, frame_count)
    return {"image": image, "first_row": begin, "first_col": begin}


image_window = OF_VIEWS.stage(
    coordinate("vertical", ("row",), "f8", PLACE.format("vertical"), "m", pad=np.nan),
    coordinate("horizontal", ("col",), "f8", PLACE.format("horizontal"), "m", pad=np.nan),
    reads={"self": "infrared_window"},
    name="image_window",
)(LargestWindow.axes)

detection_probability = OF_VIEWS.stage(
    Output("detection_probability", label="probability that a pixel of the ship is detected"),
    reads=DETECTOR_READS,
    **BY_PLACE,
)(DetectorView.detection_probability)

reconstruction_error = OF_VIEWS.stage(
    Output(
        "reconstruction_error",
        label="rms difference from the noiseless image of half the pixel, over the contrast",
    ),
    reads=DETECTOR_READS,
    **BY_PLACE,
)(DetectorView.reconstruction_error)


# Silhouettes


@OF_VIEWS.stage(
    coordinate(
        "angle", ("angle",), "f8", "angle about the centroid, from the right upwards", "degree"
    ),
    coordinate("radius", ("radius",), "f8", "place between inner (0) and outer (1) log radius"),
)
def map_cells() -> dict[str, NDArray[Any]]:
    """Return the angles and radii of the cells of log-polar maps."""
    return dict(zip(("angle", "radius"), cells(), strict=True))


@stage(Output("silhouettes", ("row", "byte"), "u1"), uses=(Infrared,), **BY_PLACE)
def silhouettes(
    detector_view: DetectorView,
    super_resolution: str,
    segmentation: str,
    subpixel_offsets: tuple[int, ...],
    frame_count: tuple[int, ...],
) -> Bytes:
    """Return (offset, frame_count, row, byte) masks of images, one bit per pixel."""
    images = detector_view.images(super_resolution, subpixel_offsets, frame_count)
    known: Any = detector_view.imager.sigmas(np.array(frame_count), super_resolution)
    known["contrast"] = detector_view.contrast
    masks = features.segment(images, method=segmentation, **known)
    return np.packbits(masks, axis=-1)


@OF_VIEWS.stage(_map("log_polar", label="log-polar map of the segmented silhouette"), **BY_PLACE)
def log_polar(silhouettes: Bytes, inner_radius: float, interpolation: str) -> Bytes:
    """Return (offset, frame_count, angle, radius) maps."""
    # Padding bits beyond the last column are sea, which does not change the map.
    masks = np.unpackbits(silhouettes, axis=-1).astype(bool)
    return features.silhouette_map(masks, inner_radius=inner_radius, interpolation=interpolation)


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
    patches = restore(Hits, hits).patches(mirrored=aspect != drawn_aspect)
    side = library.footprint(training_range, ifov)
    targets = [
        patches.covering(side, spread_place(offset)).target(coverage_rule)
        for offset in subpixel_offsets
    ]
    masks = largest_region(targets)  # as every segmentation gives without noise
    return features.silhouette_map(masks, inner_radius=inner_radius, interpolation=interpolation)


# Checks


def check(choices: Choices) -> None:
    """Refuse (`ConfigurationError`) ranges that pixels do not resolve, and ships too large."""
    if not uses_sensor(views.INFRARED)(choices):
        return
    same_ranges = choices[Infrared.range] == choices[Grid.range]
    range_setting = Grid.range if same_ranges else Infrared.range
    for setting in (range_setting, Infrared.training_range):
        views.check_ranges(choices, setting, Infrared.ifov, part=0.5)
    check_window(choices)
    for method in choices[Infrared.segmentation]:
        if method != "matched" and find_spec("skimage") is None:
            allowed = "matched without scikit-image: pip install 'ncti-sweep[segmentation]'"
            refuse(Infrared.segmentation, method, allowed)


def check_window(choices: Choices) -> None:
    """Refuse ships larger than the window of images."""
    length, height = Infrared.window_length, Infrared.window_height
    for ship in choices[Grid.ship]:
        vertices = meshes.vertices(ship)
        longest = 2 * float(np.hypot(vertices[:, 0], vertices[:, 1]).max())
        for setting, extent in ((length, longest), (height, float(vertices[:, 2].max()))):
            if extent > (window := choices.value(setting)):
                allowed = f"at least {math.ceil(extent)} m to hold {ship}{meshes.fault_hint(ship)}"
                refuse(setting, window, allowed)


# Tables


def tabulate_detection(images: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the detection probability of ships, from the store's infrared group.

    `probability`, by aspect bin, is the mean over ships, aspects and offsets; `lowest` is the
    minimum over views. Missing views are left out; NaN if all are missing.
    """
    import xarray as xr

    probability = _drop_scalars(images, "detection_probability")
    labels, index = aspect_bins(images.aspect.values)
    bins = [*(np.flatnonzero(index == k) for k in range(len(labels))), np.arange(len(index))]
    name = xr.Variable("aspect_bin", [*labels, "overall"])
    mean, minimum = (
        xr.concat([reduce(probability.isel(aspect=pooled), OVER) for pooled in bins], name)
        for reduce in (xr.DataArray.mean, xr.DataArray.min)
    )
    columns = {
        "probability": (mean, "mean probability that some pixel of the ship passes the threshold"),
        "lowest": (minimum, "lowest probability of a view"),
    }
    return add_bin_attribute(labelled_dataset(columns), images.aspect)


def tabulate_reconstruction(images: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the errors of super-resolved images, from the store's infrared group.

    `error` is the mean over ships, aspects and offsets, and `error_spread` the standard deviation.
    Missing views, and images without contrast, are left out; NaN if none remains.
    """
    error = _drop_scalars(images, "reconstruction_error")
    columns = {
        "error": (error.mean(OVER), "rms difference from the noiseless fine image over contrast"),
        "error_spread": (error.std(OVER), "standard deviation of that over views and positions"),
    }
    return labelled_dataset(columns)


def tabulate_sensor(images: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return attenuation, contrast and signal-to-noise ratio of a ship by range and frames."""
    import xarray as xr

    axes = {
        name: images[name].drop_vars(set(images.coords) - {name}, errors="ignore") for name in SEEN
    }
    for setting in (Infrared.extinction, Infrared.contrast_at_zero, Infrared.nedt):
        swept = setting.name in images.dims
        axes[setting.name] = images[setting.name] if swept else xr.DataArray(choices.value(setting))
    broadcast = dict(zip(axes, xr.broadcast(*axes.values()), strict=True))
    parameters: dict[str, Any] = {name: array.values for name, array in broadcast.items()}
    metres = Infrared.range.in_si(parameters.pop("range"))
    air = {"extinction": Infrared.extinction.in_si(parameters.pop("extinction"))}
    scene = air | {"contrast_at_zero": parameters.pop("contrast_at_zero")}
    figures = {
        "attenuation": (library.attenuation(metres, **air), "loss in the air, one way", "dB"),
        "contrast": (library.contrast(metres, **scene), "contrast of ship to sea", "K"),
        "snr": (
            library.snr(metres, **parameters, **scene),
            "signal-to-noise ratio of a pixel, of powers",
        ),
    }
    return labelled_dataset(
        {
            name: (broadcast["range"].copy(data=values), *label)
            for name, (values, *label) in figures.items()
        }
    )


def _drop_scalars(images: xr.Dataset, name: str) -> xr.DataArray:
    """Return one variable without the scalar coordinates of segmentation and mapping."""
    variable = images[name].load()
    single = [key for key, coord in variable.coords.items() if not coord.dims]
    return variable.drop_vars([key for key in single if key != "coverage_rule"])


def _image_table(
    name: str, tabulate: Any, title: str, figures: tuple[Figure, ...], **options: Any
) -> Table:
    """Return a table of images, with one row for each range and number of frames."""
    display = Display(f"infrared_{name}", title, figures, rows=SEEN, **options)
    return OF_VIEWS.table(name, tabulate, display)


def loops(choices: Choices) -> list[CompiledLoops]:
    """Return the compiled loops that images and silhouettes need."""
    if not uses_sensor(views.INFRARED)(choices):
        return []
    masked = MASK in map(silhouette_engine.function, choices[Render.engine])
    return [IMAGES] + [engine_loops(MASK)] * masked


STAGES = (
    silhouette_engine,
    infrared_images,
    training_images,
    hits,
    training_hits,
    imager,
    detector_view,
    infrared_window,
    thermal_image,
    image_window,
    detection_probability,
    reconstruction_error,
    map_cells,
    silhouettes,
    log_polar,
    template_log_polar,
)
TABLES = (
    _image_table(
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
    _image_table(
        "detection",
        tabulate_detection,
        "Probability that the imager detects a ship",
        (
            Figure("probability", format=".1%"),
            Figure("lowest", "lowest_of_views", format=".1%", listed=False),
        ),
        columns="aspect_bin",
    ),
    _image_table(
        "super_resolution",
        tabulate_reconstruction,
        "Error of infrared images against the noiseless one of half the pixel",
        (Figure("error", extra_columns={"spread": "error_spread"}, digits=4, format=".3f"),),
        columns="super_resolution",
        notes=(
            "Root mean square over the contrast of the ship.",
            "Shifted images average the frame count at each of four places of the detector.",
        ),
    ),
)
