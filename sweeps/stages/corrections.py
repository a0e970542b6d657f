"""Corrected images of flights, compared with the truth, and their range profiles."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti import irar as library
from ncti.checks import NothingSeenError
from ncti.irar import Correction, Flight, Landmarks, Scan, Snapshot, Tilt, Window
from ncti.irar.chain import places
from ncti.irar.mirror import MIRROR_FORMS, mirror_rotation
from sweeps.engine.stage import Output, Stage, stage
from sweeps.stages import irar
from sweeps.stages.irar import CELLS, DIMS, EXACT, NO_ERROR, Arrays, Error, Irar
from sweeps.stages.ladar import Ladar, profile_bins
from sweeps.stages.ships import ShipName
from sweeps.stages.views import IRAR, STATUS, Grid, looks

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]

LEAST_SEEN = 20
"""Number of pixels above the threshold from which they are a ship, not false alarms."""

SOURCES = ("measured", "noiseless", "synthetic", "point")
STERN, NEAR_STERN = 180.0, 15.0  # deg: landmarks are measured within this of it
HANGAR = 4.0  # m either side of its spike, without which profiles are correlated, too
HANGAR_REACH = 8.0  # m either side of where a spike must be to be the hangar's

HANGARS = {"connole": (-40.0, -20.0)}
"""Down-range [m] of the hangar in near-stern profiles where it is not the highest peak: the stack
returns more."""

PERRY = ("duncan", "roberts")
"""Ships with masts and a bridge at the places of the landmarks; others have none."""

ENDS = {"measured": 0.02, "noiseless": 0.02, "synthetic": 0.05, "point": 0.05}
"""Share of the highest peak at which a ship begins. A bare deck, all that returns where the transom
is dark, reaches 0.02; pixels of a level lattice spread as much beyond a sloping stern."""

LANDMARKS = {  # label and unit
    "stern_to_hangar": ("distance from the stern end to the hangar's spike", "m"),
    "stern_to_bridge": ("distance from the stern end to the front of the forward structure", "m"),
    "transom_ratio": ("highest peak within 5 m of the stern, relative to the hangar's", "1"),
    "mast_position": ("distance of the main mast past the hangar", "m"),
    "mast_ratio": ("peak of the main mast, relative to the hangar's", "1"),
    "forward_position": ("distance of the forward block's peak past the hangar", "m"),
    "forward_ratio": ("peak of the forward block, relative to the hangar's", "1"),
    "transom_energy": ("returns within 1.5 m of the transom's peak, relative to the hangar's", "1"),
    "mast_energy": ("returns within 1.5 m of the main mast's peak, relative to the hangar's", "1"),
    "forward_energy": ("returns within 1.5 m of the forward peak, relative to the hangar's", "1"),
    "deck_spikes": ("number of peaks between the transom and the hangar", "1"),
}


NUMBERS = {
    "profile_correlation": "correlation of a simulated flight's profile with the noiseless one",
    "profile_correlation_without_hangar": "correlation of a simulated flight's profile with the "
    "noiseless one, without 4 m either side of the hangar, the highest peak",
    "closing_speed_error": "relative error of the closing speed used in the corrections",
    "looks": "mean number of samples in pixels that have any",
}
TILTS = {
    "mast_tilt": "tilt of masts in the corrected images, intensity and infrared together",
    "waterline_tilt": "tilt of the waterline in the corrected images, intensity and infrared "
    "together",
    "mast_tilt_error": "standard error of the tilt of masts, for a shear of a few degrees at most",
    "waterline_tilt_error": "standard error of the tilt of the waterline, likewise",
    "intensity_mast_tilt": "tilt of masts in the corrected intensity alone",
    "intensity_waterline_tilt": "tilt of the waterline in the corrected intensity alone",
    "infrared_mast_tilt": "tilt of masts in the corrected infrared image alone",
    "infrared_waterline_tilt": "tilt of the waterline in the corrected infrared image alone",
    "noiseless_mast_tilt": "tilt of masts in the corrected noiseless scan, from the share of "
    "ship in each pixel",
    "noiseless_waterline_tilt": "tilt of the waterline in the corrected noiseless scan, likewise",
}
IMAGES = {  # unit and label
    "intensity": ("1", "corrected, segmented intensity in noise powers, 0 without a return"),
    "range_image": ("m", "range relative to the ship origin, of the same pixels"),
    "infrared_image": ("K", "apparent temperature above the sea, of the same pixels"),
}
ORIGIN = {"row": "window_bottom", "column": "window_left"}

_place = partial(Output, dtype="i4", unit="pixel", fill=0, stored=False)
# Parts of the overscanned image that show the ship.
_part = partial(Output, dtype="f8", stored=False)


@stage(
    Output(
        "profile",
        ("source", "down_range"),
        label="range profile: intensity summed over pixels, in noise powers of one look",
    ),
    *(Output(name, label=label) for name, label in NUMBERS.items()),
    *(Output(name, label=label, unit="degree") for name, label in TILTS.items()),
    Output(
        "hangar_spike_offset",
        label="down-range of the hangar's spike in a simulated flight, over that without noise",
        unit="m",
    ),
    *(
        Output(name, ("source",), label=label, unit=unit)
        for name, (label, unit) in LANDMARKS.items()
    ),
    *(
        Output(name, ("row", "column"), label=label, unit=unit, origin=ORIGIN)
        for name, (unit, label) in IMAGES.items()
    ),
    _place("window_bottom", label="row of pixels, upwards from the ship origin"),
    _place("window_left", label="column of pixels, rightwards from the ship origin"),
    _part("fine_row", ("fine_row",)),
    _part("fine_column", ("fine_column",)),
    _part("ship_pixel", ("pixel", "place"), dtype="i4"),
    _part("ship_value", ("pixel", "value")),
    uses=(Grid, Irar, Ladar),
    reads={"error": Irar.errors},
    group=irar.GROUP,
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
    pixels = window_of_cell(mesh, flight, error, chain, azimuth, mirror)
    correction = Correction(azimuth=azimuth, mirror=mirror, range_filter=range_filter)

    def image(scan: Scan, *, overscanned: bool = False) -> Snapshot:
        where: dict[str, Any] = {"belief": belief, "window": pixels}
        if chain != EXACT:  # rows as printed are a pixel apart
            return library.correct_as_printed(scan, rate=irar.RATES[chain], **where)
        return library.correct(scan, correction, overscanned=overscanned, **where)

    def tilt(scan: Scan, images: Any, truths: Any) -> Tilt:
        spots = None  # as printed, which averages samples before
        if chain == EXACT:
            row, column, _ = places(scan, correction, belief=belief)
            spots = row - pixels.bottom, column - pixels.left
        return library.tilts(images, truths, places=spots)

    whole = image(scan)
    shown, fine = (
        library.segmented(one, belief, threshold=segmentation_threshold)
        for one in (whole, image(scan, overscanned=True))
    )
    # Tilts are of the uncut image if it shows a ship: a threshold eats into dim edges.
    seen = bool(np.count_nonzero(shown.intensity) >= LEAST_SEEN)
    truths = [widened(truth, values, pixels) for values in (truth.intensity, truth.infrared)]
    images = [whole.intensity * seen, whole.infrared]
    lean = tilt(scan, images, truths)
    active, passive = (tilt(scan, *pair) for pair in zip(images, truths, strict=True))
    noiseless = tilt(clean, image(clean).infrared, truths[1])
    measured = library.profile(fine, belief, bins=bins.size, bin_width=bin_width)
    profiles = np.stack([measured, *(flight.cnr * models)])
    return {
        "profile": profiles,
        "closing_speed_error": np.array(belief.closing_speed / flight.closing_speed - 1),
        "looks": shown.looks.sum() / max(np.count_nonzero(shown.looks), 1),
        "intensity": shown.intensity,
        "range_image": shown.range - flight.slant_range,
        "infrared_image": shown.infrared,
        "window_bottom": np.array(pixels.bottom),
        "window_left": np.array(pixels.left),
        "mast_tilt": np.array(lean.mast),
        "waterline_tilt": np.array(lean.waterline),
        "mast_tilt_error": np.array(lean.mast_error),
        "waterline_tilt_error": np.array(lean.waterline_error),
        "intensity_mast_tilt": np.array(active.mast),
        "intensity_waterline_tilt": np.array(active.waterline),
        "infrared_mast_tilt": np.array(passive.mast),
        "infrared_waterline_tilt": np.array(passive.waterline),
        "noiseless_mast_tilt": np.array(noiseless.mast),
        "noiseless_waterline_tilt": np.array(noiseless.waterline),
        **irar.ship_pixels(fine),
        **compared(profiles, bins, aspect=aspect, ship=ship),
    }


def _nothing(bins: int) -> Arrays:
    """Return the empty results of a ship that is not flown past."""
    lengths = {"source": len(SOURCES), "down_range": bins, "place": 2, "value": 2}
    return {
        one.name: np.full([lengths.get(dim, 0) for dim in one.dims], one.empty)
        for one in corrected.outputs
    }


def window_of_cell(
    mesh: trimesh.Trimesh, flight: Flight, error: Error, chain: str, azimuth: str, mirror: str
) -> Window:
    """Return the pixels of a corrected image: about the ship, wider where it may lean or stretch.

    With an error of the pointing they are where the ship appears in the image.
    """
    window = library.ship_window(mesh, flight)
    if error != NO_ERROR or chain != EXACT or azimuth != "pixel" or mirror not in MIRROR_FORMS:
        # Uncorrected lines rise by the mirror's angle, and rows follow one another with the drift.
        turn = mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle)
        drift, steep = abs(flight.drift / flight.climb), math.tan(abs(math.radians(turn)))
        # As printed, rows that such lines climb more slowly, or faster, keep their distance.
        tall = 1.0 if chain == EXACT else 1.0 / max(1.0 - drift * steep, 0.1)
        longest = max(window.rows, window.columns)
        above = math.ceil(longest * max(1 / 8, 1.1 * steep) + window.rows * 0.6 * (tall - 1.0))
        aside = math.ceil(window.rows * max(1.0, drift + steep) * tall)
        window = Window(
            bottom=window.bottom - above,
            left=window.left - aside,
            rows=window.rows + 2 * above,
            columns=window.columns + 2 * aside,
        )
    if error[0] == "pointing":
        moved = math.radians(error[1]) * math.cos(math.radians(flight.depression)) / flight.ifov
        window = replace(window, left=window.left + round(moved))
    return window


def widened(truth: Snapshot, values: Floats, window: Window) -> Floats:
    """Return values of a truth on its own window, on a larger one whose middle pixels they are."""
    above = (window.rows - truth.window.rows) // 2 * CELLS
    aside = (window.columns - truth.window.columns) // 2 * CELLS
    return np.pad(values, ((above, above), (aside, aside)))


def compared(profiles: Floats, down_range: Floats, *, aspect: float, ship: str = "") -> Arrays:
    """Return correlations of (source, bin) profiles at an aspect [deg], and their landmarks.

    Returns
    -------
    dict of str to ndarray
        profile_correlation, profile_correlation_without_hangar, hangar_spike_offset : ();
        landmarks : (source,), NaN where the view is not near the stern or has none.

    Notes
    -----
    The hangar's spike is the highest of the synthetic profile, in which nothing glints, or the
    highest where `HANGARS` has it, and in the others what is highest close to it. Masts and bridge
    are searched where the Perry class has them, and reported for its ships only.
    """
    measured, noiseless, synthetic = profiles[:3]
    astern = abs(aspect - STERN) <= NEAR_STERN
    if astern and ship in HANGARS:
        first, last = HANGARS[ship]
        synthetic = np.where((down_range >= first) & (down_range <= last), synthetic, 0)
    spike = float(down_range[synthetic.argmax()])
    found: list[Landmarks | None] = [None] * len(SOURCES)
    if astern:
        near = (spike - HANGAR_REACH, spike + HANGAR_REACH)
        for k, line in enumerate(profiles):
            with suppress(NothingSeenError):
                end = ENDS[SOURCES[k]]
                found[k] = library.landmarks(line, down_range, hangar=near, end=end)
    figures = [_figures(marks, ship in PERRY) for marks in found]
    alike = partial(library.profile_correlation, measured, noiseless)
    near_spike = np.abs(down_range - spike) <= HANGAR
    return {
        "profile_correlation": np.array(alike()),
        "profile_correlation_without_hangar": np.array(alike(exclude=near_spike)),
        "hangar_spike_offset": np.array(
            figures[0].get("hangar", math.nan) - figures[1].get("hangar", math.nan)
        ),
        **{name: np.array([one.get(name, math.nan) for one in figures]) for name in LANDMARKS},
    }


def _figures(marks: Landmarks | None, perry: bool) -> dict[str, float]:
    """Return the landmarks of one profile by name, and its hangar."""
    if marks is None:
        return {}
    figures = {
        "hangar": marks.hangar,
        "stern_to_hangar": marks.stern,
        "stern_to_bridge": marks.stern_to_bridge,
        "deck_spikes": float(len(marks.deck_spikes)),
    }
    peaks = {"transom": marks.transom}
    peaks |= {"mast": marks.mast, "forward": marks.forward} if perry else {}
    for name, peak in peaks.items():
        figures[f"{name}_position"] = peak.offset
        figures[f"{name}_ratio"] = peak.height
        figures[f"{name}_energy"] = peak.energy
    return figures


@stage(
    Output(
        "source", ("source",), "U9", label="source of a profile; measured: in a simulated flight"
    ),
    group=irar.GROUP,
    when=looks(IRAR),
    coordinates=True,
)
def profile_sources() -> NDArray[np.str_]:
    """Return the sources of the profiles of a flight."""
    return np.array(SOURCES)


flight_bins = replace(profile_bins, name="flight_bins", group=irar.GROUP, when=looks(IRAR))

STAGES: tuple[Stage, ...] = (corrected, profile_sources, flight_bins)
