"""Scans of flights corrected: their images, held against the truth, and their range profiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.irar import (
    Correction,
    Flight,
    Scan,
    Snapshot,
    Window,
    correct,
    correct_as_printed,
    profile,
    segmented,
    tilts,
)
from ncti.irar.chain import places
from sweeps.engine.stage import Output, Stage, stage
from sweeps.stages.flight_comparison import LANDMARKS, SOURCES, compared
from sweeps.stages.flight_geometry import widened, window_of_cell
from sweeps.stages.irar import EXACT, FLIGHT, RATES, Error, Irar
from sweeps.stages.ladar import Ladar, profile_bins
from sweeps.stages.views import IRAR, Grid, ShipName, looks

if TYPE_CHECKING:
    import trimesh

Arrays = dict[str, NDArray[Any]]
Floats = NDArray[np.float64]

GROUP = "validation"
STATUS = "status:view"
DIMS = ("ship", "aspect", *FLIGHT)
LEAST_SEEN = 20
"""Pixels above the threshold that are a ship and no false alarms."""


@dataclass(frozen=True)
class Way:
    """A way to correct scans.

    Attributes
    ----------
    rate : str or None
        What f is in the corrections as printed, as of `correct_as_printed`; None of the exact ones.
    correction : Correction
        Methods of the exact ones.
    belief : Flight
        What is taken for the flight.
    window : Window
        Pixels of the result.
    """

    rate: str | None
    correction: Correction
    belief: Flight
    window: Window

    def image(self, scan: Scan, *, overscanned: bool = False) -> Snapshot:
        """Return a scan corrected; rows as printed are a pixel apart."""
        where: dict[str, Any] = {"belief": self.belief, "window": self.window}
        if self.rate is not None:
            return correct_as_printed(scan, rate=self.rate, **where)
        return correct(scan, self.correction, overscanned=overscanned, **where)

    def places(self, scan: Scan) -> tuple[Floats, Floats] | None:
        """Return where an image has its samples; None as printed, which averages them before."""
        if self.rate is not None:
            return None
        row, column, _ = places(scan, self.correction, belief=self.belief)
        return row - self.window.bottom, column - self.window.left


def _degrees(name: str, label: str) -> Output:
    return Output(name, label=label, unit="degree")


def _image(name: str, label: str, unit: str = "1") -> Output:
    origin = {"row": "window_bottom", "column": "window_left"}
    return Output(name, ("row", "column"), label=label, unit=unit, origin=origin)


def _place(name: str, label: str) -> Output:
    return Output(name, (), "i4", label, "pixel", fill=0, stored=False)


def _of_image(name: str, dims: tuple[str, ...], dtype: str = "f8") -> Output:
    """Part of the overscanned image: where it shows the ship, and with what."""
    return Output(name, dims, dtype, stored=False)


@stage(
    Output(
        "profile",
        ("source", "down_range"),
        label="range profile: intensity summed over pixels, in noise powers of one look",
    ),
    Output(
        "profile_correlation", label="correlation of the measured profile with the noiseless one"
    ),
    Output(
        "profile_correlation_without_hangar",
        label="the same without 4 m either side of the hangar, the highest peak",
    ),
    _degrees("mast_tilt", "tilt of masts in the corrected images, intensity and infrared together"),
    _degrees(
        "waterline_tilt",
        "tilt of the waterline in the corrected images, intensity and infrared together",
    ),
    _degrees(
        "mast_tilt_error",
        "standard error of that of masts, where what is left is a shear of a few degrees at most",
    ),
    _degrees("waterline_tilt_error", "standard error of that of the waterline, likewise"),
    _degrees(
        "noiseless_mast_tilt",
        "tilt of masts in the corrected noiseless scan, by how much ship each pixel shows",
    ),
    _degrees(
        "noiseless_waterline_tilt",
        "tilt of the waterline in the corrected noiseless scan, likewise",
    ),
    Output(
        "hangar_spike_offset",
        label="down-range of the hangar's spike measured, over that without noise",
        unit="m",
    ),
    *(
        Output(name, ("source",), label=label, unit=unit)
        for name, (label, unit) in LANDMARKS.items()
    ),
    Output(
        "closing_speed_error",
        label="closing speed that images are corrected with over the true one, less 1",
    ),
    Output("looks", label="mean samples of the pixels that have some"),
    _image("intensity", "corrected, segmented intensity in noise powers, 0 where there is none"),
    _image("range_image", "range less that of the ship origin, of the same pixels", "m"),
    _image("infrared_image", "apparent temperature over the sea's, of the same pixels", "K"),
    _place("window_bottom", "row of pixels, upwards from the ship origin"),
    _place("window_left", "column of pixels, rightwards from the ship origin"),
    _of_image("fine_row", ("fine_row",)),
    _of_image("fine_column", ("fine_column",)),
    _of_image("ship_pixel", ("pixel", "place"), "i4"),
    _of_image("ship_value", ("pixel", "value")),
    uses=(Grid, Irar, Ladar),
    reads={"error": Irar.errors},
    group=GROUP,
    dims=DIMS,
    when=looks(IRAR),
    status=STATUS,
)
def corrected(
    scan: Scan | None,
    clean: Scan | None,
    belief: Flight | None,
    truth: Snapshot | None,
    models: Floats | None,
    mesh: trimesh.Trimesh,
    ship: ShipName,
    aspect: float,
    error: Error,
    chain: str,
    azimuth: str,
    mirror: str,
    range_filter: str,
    segmentation_threshold: float | None,
    bin_width: float,
    window: float,
) -> Arrays:
    """Return the corrected images of a flight, their tilts, their profiles and landmarks."""
    bins = profile_bins(window, bin_width)
    if scan is None or clean is None or belief is None or truth is None or models is None:
        return _nothing(bins.size)
    flight = scan.flight
    way = Way(
        rate=None if chain == EXACT else RATES[chain],
        correction=Correction(azimuth=azimuth, mirror=mirror, range_filter=range_filter),
        belief=belief,
        window=window_of_cell(mesh, flight, error, chain, azimuth, mirror),
    )
    whole = way.image(scan)
    image, fine = (
        segmented(one, belief, threshold=segmentation_threshold)
        for one in (whole, way.image(scan, overscanned=True))
    )
    seen = bool(np.count_nonzero(image.intensity) >= LEAST_SEEN)
    measured = profile(fine, belief, bins=bins.size, bin_width=bin_width)
    profiles = np.stack([measured, *(flight.cnr * models)])
    return {
        "profile": profiles,
        "closing_speed_error": np.array(belief.closing_speed / flight.closing_speed - 1),
        "looks": image.looks.sum() / max(np.count_nonzero(image.looks), 1),
        "intensity": image.intensity,
        "range_image": image.range - flight.slant_range,
        "infrared_image": image.infrared,
        "window_bottom": np.array(way.window.bottom),
        "window_left": np.array(way.window.left),
        **_tilts(way, scan, clean, truth, whole, seen),
        **_of_ship(fine),
        **compared(profiles, bins, aspect=aspect, ship=ship),
    }


def _nothing(bins: int) -> Arrays:
    """Return what there is of a ship that is not flown past: no pixel, and no number."""
    lengths = {"source": len(SOURCES), "down_range": bins, "place": 2, "value": 2}
    return {
        one.name: np.full([lengths.get(dim, 0) for dim in one.dims], one.empty)
        for one in corrected.outputs
    }


def _tilts(
    way: Way, scan: Scan, clean: Scan, truth: Snapshot, whole: Snapshot, seen: bool
) -> Arrays:
    """Return tilts of masts and waterline, of the uncut image if it shows a ship.

    A threshold eats into dim edges.
    """
    truths = [widened(truth, values, way.window) for values in (truth.intensity, truth.infrared)]
    lean = tilts([whole.intensity * seen, whole.infrared], truths, places=way.places(scan))
    without_noise = tilts(way.image(clean).infrared, truths[1], places=way.places(clean))
    return {
        "mast_tilt": np.array(lean.mast),
        "waterline_tilt": np.array(lean.waterline),
        "mast_tilt_error": np.array(lean.mast_error),
        "waterline_tilt_error": np.array(lean.waterline_error),
        "noiseless_mast_tilt": np.array(without_noise.mast),
        "noiseless_waterline_tilt": np.array(without_noise.waterline),
    }


def _of_ship(fine: Snapshot) -> Arrays:
    """Return the pixels of a segmented image that show the ship, as arrays; see `image_of`."""
    there = np.isfinite(fine.range) & (fine.intensity > 0)
    return {
        "fine_row": fine.row,
        "fine_column": fine.column,
        "ship_pixel": np.argwhere(there),
        "ship_value": np.stack([fine.intensity[there], fine.range[there]], axis=-1),
    }


def image_of(found: Arrays) -> Snapshot:
    """Return the overscanned image of a flight from the results of `corrected`.

    Intensity and range where it shows the ship; nothing elsewhere, and no infrared.
    """
    row, column = found["fine_row"], found["fine_column"]
    intensity, ranges = np.zeros((2, row.size, column.size))
    at = tuple(found["ship_pixel"].T)
    ranges[:] = np.nan
    intensity[at], ranges[at] = found["ship_value"].T
    pixels = Window(int(found["window_bottom"]), int(found["window_left"]), 0, column.size)
    nothing = np.zeros(intensity.shape)
    return Snapshot(pixels, row, column, intensity, ranges, nothing, nothing.astype(np.intp))


@stage(
    Output("source", ("source",), "U9", label="where a profile comes from"),
    group=GROUP,
    when=looks(IRAR),
    coordinates=True,
)
def profile_sources() -> NDArray[np.str_]:
    """Return where the profiles of a flight come from."""
    return np.array(SOURCES)


flight_bins = stage(
    *profile_bins.outputs,
    uses=(Ladar,),
    group=GROUP,
    when=looks(IRAR),
    coordinates=True,
    name="flight_bins",
)(profile_bins.function)


STAGES: tuple[Stage, ...] = (corrected, profile_sources, flight_bins)
