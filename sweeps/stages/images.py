"""Infrared images of ships, their detections and their errors."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import infrared as library
from ncti.evaluate import aspect_bins
from ncti.infrared.super_resolution import enlarge
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, Table, plain, stage
from sweeps.stages.infrared import IMAGES, LOOK, VIEW, Infrared, looks_infrared
from sweeps.stages.infrared_look import HALVES, Look, whole_window
from sweeps.stages.scores import data_set
from sweeps.stages.views import STATUS

if TYPE_CHECKING:
    import xarray as xr

LEAST_CONTRAST = 1e-6  # K, below which the relative error of images is undefined
PLACE = "{} place on the target, the ship origin within a pixel"
WHOLE = HALVES["none"]  # half pixels that a pixel of the detector is wide
OVER = (*VIEW, "phase")  # what tables of images are means over

Floats = NDArray[np.float64]

_of_images = partial(stage, uses=(Infrared,), group=IMAGES, when=looks_infrared)


@plain(uses=(Infrared,), reads={"depression": "infrared_depression"})
def largest_window(
    range: float, depression: float, ifov: float, window_length: float, window_height: float
) -> tuple[float, ...]:
    """Return the arguments of `whole_window`."""
    return tuple(locals().values())


@_of_images(
    Output(
        "image",
        ("row", "col"),
        label="frame-averaged image of the first phase, contrast against the mean sea",
        unit="K",
        pad=np.nan,
        origin={"row": "first_row", "col": "first_col"},
    ),
    Output("first_row", dtype="i8", label="row of pixels, from the lowest", stored=False),
    Output("first_col", dtype="i8", label="column of pixels, from the left", stored=False),
    along=(Infrared.frame_count,),
    dims=(*VIEW, "coverage_rule", *LOOK),
    status=STATUS,
)
def thermal_image(
    look: Look,
    largest_window: tuple[float, ...],
    super_resolution: str,
    frame_count: tuple[int, ...],
) -> dict[str, NDArray[Any]]:
    """Return images of the first place on the detector, in the window of the largest ship.

    Returns
    -------
    dict of str to ndarray
        image : (frame_count, row, col) [K], NaN where nothing was synthesised; first_row,
        first_col : (frame_count,), where it begins.
    """
    (found,) = look.images(super_resolution, (0,), frame_count)
    whole = whole_window(*largest_window, place=look.place(0))
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


@_of_images(
    Output("vertical", ("row",), "f8", PLACE.format("vertical"), "m", pad=np.nan),
    Output("horizontal", ("col",), "f8", PLACE.format("horizontal"), "m", pad=np.nan),
    dims=("range", "super_resolution"),
    coordinates=True,
)
def image_window(
    largest_window: tuple[float, ...], super_resolution: str
) -> dict[str, NDArray[Any]]:
    """Return where the rows and columns of images lie on the target [m]."""
    window = whole_window(*largest_window)
    found = {}
    for axis, name in enumerate(("vertical", "horizontal")):
        halves = window.origin[1 - axis] + window.footprint * np.arange(window.coverage.shape[axis])
        found[name] = halves.reshape(-1, HALVES[super_resolution]).mean(axis=1)
    return found


@_of_images(
    Output(
        "detection_probability",
        label="probability that a pixel of the ship passes the detector's threshold",
    ),
    along=(Infrared.phases, Infrared.frame_count),
    dims=(*VIEW, "coverage_rule", "phase", "range", "frame_count"),
    status=STATUS,
)
def detection_probability(
    look: Look, false_alarm: float, phases: tuple[int, ...], frame_count: tuple[int, ...]
) -> Floats:
    """Return the (phase, frame_count) probability that a ship pixel exceeds the threshold."""
    sigmas = look.sigmas("none", frame_count)
    pixels = [int(np.count_nonzero(look.shown(phase, WHOLE))) for phase in phases]
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


@_of_images(
    Output(
        "reconstruction_error",
        label="rms difference from the noiseless image of half the pixel, over the contrast",
    ),
    along=(Infrared.phases, Infrared.frame_count),
    dims=(*VIEW, "coverage_rule", "phase", *LOOK),
    status=STATUS,
)
def reconstruction_error(
    look: Look, super_resolution: str, phases: tuple[int, ...], frame_count: tuple[int, ...]
) -> Floats:
    """Return the (phase, frame_count) error of images, NaN for negligible contrast."""
    if look.contrast < LEAST_CONTRAST:  # no contrast to divide by
        return np.full((len(phases), len(frame_count)), np.nan)
    shown = look.images(super_resolution, phases, frame_count)
    finer = enlarge(shown) if HALVES[super_resolution] == WHOLE else shown
    return np.array(
        [
            library.reconstruction_error(image, look.shown(phase, 1), contrast=look.contrast)
            for phase, image in zip(phases, finer, strict=True)
        ]
    )


def tabulate_detection(images: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the detection probability of ships, from the store's infrared group.

    `probability` by aspect bin, mean over ships, aspects and phases; `lowest`, the least of all
    views. Views that are not there are left out; NaN where none is.
    """
    # Imported here because xarray takes a third of a second.
    import xarray as xr

    found = _alone(images, "detection_probability")
    labels, index = aspect_bins(images.aspect.values)
    bins = [*(np.flatnonzero(index == k) for k in range(len(labels))), np.arange(len(index))]
    pooled = [found.isel(aspect=chosen) for chosen in bins]
    name = xr.Variable("aspect_bin", [*labels, "overall"])
    return data_set(
        {
            "probability": (
                xr.concat([part.mean(OVER) for part in pooled], name),
                "mean probability that some pixel of the ship passes the threshold",
            ),
            "lowest": (
                xr.concat([part.min(OVER) for part in pooled], name),
                "least probability of a view",
            ),
        },
        images.aspect,
    )


def tabulate_reconstruction(images: xr.Dataset, choices: Choices) -> xr.Dataset:
    """Return the errors of super-resolved images, from the store's infrared group.

    `error`, mean over ships, aspects and phases, and `error_spread`, over them. Views that are not
    there, and images without contrast, are left out; NaN where none is.
    """
    error = _alone(images, "reconstruction_error")
    mean = (error.mean(OVER), "rms difference from the noiseless fine image over contrast")
    spread = (error.std(OVER), "standard deviation of that over views and phases")
    return data_set({"error": mean, "error_spread": spread}, None)


def _alone(images: xr.Dataset, name: str) -> xr.DataArray:
    """One variable, without the coordinates of how silhouettes are cut out, mapped and learnt."""
    found = images[name].load()
    return found.drop_vars(
        [key for key, coord in found.coords.items() if not coord.dims and key != "coverage_rule"]
    )


STAGES: tuple[Stage, ...] = (
    *(largest_window, thermal_image, image_window, detection_probability, reconstruction_error),
)
TABLES = (
    Table("tables/detection", (IMAGES,), tabulate_detection, looks_infrared),
    Table("tables/super_resolution", (IMAGES,), tabulate_reconstruction, looks_infrared),
)
