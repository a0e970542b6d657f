"""Infrared images of ships: their detection, their errors, and silhouettes in log-polar maps."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import features
from ncti import infrared as library
from ncti.evaluate import aspect_bins
from ncti.infrared.super_resolution import enlarge
from sweeps.engine.display import Display, Figure
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Group, Output, Table, coordinate, inner, stage
from sweeps.stages import infrared
from sweeps.stages.infrared import HALVES, VIEW, Infrared, Look, looks_infrared, whole_window
from sweeps.stages.ladar import subpixel_offset
from sweeps.stages.scores import with_bins
from sweeps.stages.views import STATUS, Arrays, Floats, Grid, data_set

if TYPE_CHECKING:
    import xarray as xr

LEAST_CONTRAST = 1e-6  # K, below which the relative error of images is undefined
PLACE = "{} place on the target, the ship origin within a pixel"
WHOLE = HALVES["none"]  # half pixels that a pixel of the detector is wide
SEEN = ("range", "frame_count")  # axes of the sensor
OVER = (*VIEW, "phase")  # what tables of images are means over

ANGLES, RADII = 64, 32  # cells of the log-polar map
IMPORTS = ("skimage.filters",)  # by its stages, when they are called; takes long
STEPS = 255  # of a cell between empty and full

OF_SILHOUETTES = ("coverage_rule", "segmentation", "inner_radius", "interpolation")

Bytes = NDArray[np.uint8]

_shares = {"scale_factor": 1 / STEPS}  # of which xarray makes numbers from 0 to 1
_map = partial(Output, dims=("angle", "radius"), dtype="u1", fill=0, attrs=_shares)

OF_VIEWS = Group(
    infrared.IMAGES,
    looks_infrared,
    (Infrared,),
    (*VIEW, *OF_SILHOUETTES, "phase", *infrared.LOOK),
    STATUS,
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
        origin={"row": "first_row", "col": "first_col"},
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
    sigmas = look.imager.sigmas(np.array(frame_count))
    pixels = [int(np.count_nonzero(look.shown(offset, WHOLE))) for offset in subpixel_offsets]
    known = {"contrast": look.contrast, "false_alarm": false_alarm}
    return np.array(
        [
            [
                library.detection_probability(n, **known, target_sigma=target, sea_sigma=sea)
                for target, sea in zip(sigmas["target_sigma"], sigmas["sea_sigma"], strict=True)
            ]
            for n in pixels
        ]
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
    patches = infrared.Patches.of(hits, mirrored=aspect != drawn_aspect)
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
