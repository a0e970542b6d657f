"""Infrared images of ships: what they show, what they detect, and how good they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import infrared as library
from ncti.evaluate import aspect_bins
from ncti.infrared import enlarge
from sweeps.engine.settings import Choices
from sweeps.engine.stage import Output, Stage, Table, stage
from sweeps.stages.infrared import Infrared, looks_infrared
from sweeps.stages.infrared_look import HALVES, Look, whole_window
from sweeps.stages.scores import data_set

if TYPE_CHECKING:
    import xarray as xr

LEAST_CONTRAST = 1e-6  # K, below which images have no error worth the name
PLACE = "{} place on the target, the ship origin within a pixel"

WHOLE = HALVES["none"]  # half pixels that a pixel of the detector is wide
IMAGES = "infrared"  # group
VIEW, LOOK = ("ship", "aspect"), ("range", "super_resolution", "frame_count")
OVER = (*VIEW, "phase")  # what tables of images are means over


@stage(
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
    uses=(Infrared,),
    reads={"depression": "infrared_depression"},
    along=(Infrared.frame_count,),
    group=IMAGES,
    dims=(*VIEW, "coverage_rule", *LOOK),
    when=looks_infrared,
    status="status:view",
    name="thermal_image",
)
def thermal_image(
    look: Look,
    range: float,
    depression: float,
    ifov: float,
    window_length: float,
    window_height: float,
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
    whole = whole_window(
        range,
        depression,
        ifov=ifov,
        length=window_length,
        height=window_height,
        place=look.place(0),
    )
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


@stage(
    Output("vertical", ("row",), "f8", PLACE.format("vertical"), "m", pad=np.nan),
    Output("horizontal", ("col",), "f8", PLACE.format("horizontal"), "m", pad=np.nan),
    uses=(Infrared,),
    reads={"depression": "infrared_depression"},
    group=IMAGES,
    dims=("range", "super_resolution"),
    when=looks_infrared,
    coordinates=True,
)
def image_window(
    range: float,
    depression: float,
    ifov: float,
    window_length: float,
    window_height: float,
    super_resolution: str,
) -> dict[str, NDArray[Any]]:
    """Return where the rows and columns of images lie on the target [m]."""
    window = whole_window(range, depression, ifov=ifov, length=window_length, height=window_height)
    found = {}
    for axis, name in enumerate(("vertical", "horizontal")):
        halves = window.origin[1 - axis] + window.footprint * np.arange(window.coverage.shape[axis])
        found[name] = halves.reshape(-1, HALVES[super_resolution]).mean(axis=1)
    return found


@stage(
    Output(
        "detection_probability",
        label="probability that a pixel of the ship passes the detector's threshold",
    ),
    uses=(Infrared,),
    along=(Infrared.phases, Infrared.frame_count),
    group=IMAGES,
    dims=(*VIEW, "coverage_rule", "phase", "range", "frame_count"),
    when=looks_infrared,
    status="status:view",
)
def detection_probability(
    look: Look, false_alarm: float, phases: tuple[int, ...], frame_count: tuple[int, ...]
) -> NDArray[np.float64]:
    """(phase, frame_count): probability that a pixel of the ship passes the threshold."""
    sigmas = look.sigmas("none", frame_count)
    return np.array(
        [
            [
                library.detection_probability(
                    int(np.count_nonzero(look.shown(phase, WHOLE))),
                    contrast=look.contrast,
                    target_sigma=target_sigma,
                    sea_sigma=sea_sigma,
                    false_alarm=false_alarm,
                )
                for target_sigma, sea_sigma in zip(
                    sigmas["target_sigma"], sigmas["sea_sigma"], strict=True
                )
            ]
            for phase in phases
        ]
    )


@stage(
    Output(
        "reconstruction_error",
        label="rms difference from the noiseless image of half the pixel, over the contrast",
    ),
    uses=(Infrared,),
    along=(Infrared.phases, Infrared.frame_count),
    group=IMAGES,
    dims=(*VIEW, "coverage_rule", "phase", *LOOK),
    when=looks_infrared,
    status="status:view",
)
def reconstruction_error(
    look: Look, super_resolution: str, phases: tuple[int, ...], frame_count: tuple[int, ...]
) -> NDArray[np.float64]:
    """(phase, frame_count): what images lack, NaN where there is next to no contrast."""
    if look.contrast < LEAST_CONTRAST:  # nothing to be a fraction of
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
    """Return how often ships are found.

    Parameters
    ----------
    images : xarray.Dataset
        The store's infrared group.
    choices : Choices
        Of the sweep.

    Returns
    -------
    xarray.Dataset
        `probability` by aspect bin, mean over ships, aspects and phases; `lowest`, the least
        of all views. Views that are not there are left out; NaN where none is.
    """
    # Imported where it is used: xarray takes a third of a second.
    import xarray as xr

    images = _of_images(images, "detection_probability")
    found = images.detection_probability
    labels, index = aspect_bins(images.aspect.values)
    bins = [*(np.flatnonzero(index == k) for k in range(len(labels))), np.arange(len(index))]
    pooled = [found.isel(aspect=chosen) for chosen in bins]
    name = xr.Variable("aspect_bin", np.array([*labels, "overall"], dtype=object))
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
    """Return how good super-resolved images are.

    Parameters
    ----------
    images, choices
        As for `tabulate_detection`.

    Returns
    -------
    xarray.Dataset
        `error`, mean over ships, aspects and phases, and `error_spread`, over them. Views that
        are not there, and images without contrast, are left out; NaN where none is.
    """
    error = _of_images(images, "reconstruction_error").reconstruction_error
    return data_set(
        {
            "error": (
                error.mean(OVER),
                "rms difference from the noiseless fine image over contrast",
            ),
            "error_spread": (error.std(OVER), "standard deviation of that over views and phases"),
        },
        None,
    )


def _of_images(images: xr.Dataset, name: str) -> xr.Dataset:
    """One variable, without the coordinates of how silhouettes are cut out, mapped and learnt."""
    found = images[[name]].load()
    gone = [
        name for name, coord in found.coords.items() if not coord.dims and name != "coverage_rule"
    ]
    return found.drop_vars(gone)


STAGES: tuple[Stage, ...] = (
    *(thermal_image, image_window, detection_probability, reconstruction_error),
)
TABLES = (
    Table("tables/detection", (IMAGES,), tabulate_detection, looks_infrared),
    Table("tables/super_resolution", (IMAGES,), tabulate_reconstruction, looks_infrared),
)
