"""Corrected images and profiles of a flight, measured and compared with the truth."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import NothingSeenError
from ncti.irar.chain import Correction, correct, places, profile
from ncti.irar.flight import Flight
from ncti.irar.landmarks import Landmarks, landmarks, profile_correlation
from ncti.irar.mirror import MIRROR_FORMS, mirror_rotation
from ncti.irar.printed import correct_as_printed
from ncti.irar.scan import Scan
from ncti.irar.snapshot import Snapshot, Window, ship_window
from ncti.irar.tilt import Tilt, tilts
from ncti.ladar import range_extent
from ncti.render import range_image

if TYPE_CHECKING:
    import trimesh

EXACT = "exact"
RATES = {"printed": "line", "printed_pulse_rate": "pulse"}
"""Meaning of f in the article's printed corrections: the line rate, or the pulse-repetition
frequency, as the article states."""

CELLS_PER_PIXEL = 8
"""Cells of the truth along a pixel; 4 or 10 change tilts of noiseless ships by 0.1 deg."""

NO_ERROR = ("none", 0.0)
MIN_SHIP_PIXELS = 20
"""Least number of pixels above the threshold that count as a ship, not as false alarms."""

STERN, NEAR_STERN = 180.0, 15.0  # deg: landmarks are measured within this of it
HANGAR = 4.0  # m either side of its spike that the second correlation excludes
HANGAR_REACH = 8.0  # m either side of the expected place in which the hangar's spike must lie

HANGARS = {"connole": (-40.0, -20.0)}
"""Down-range [m] of the hangar in near-stern profiles where it is not the highest peak: the stack
returns more."""

PERRY = ("duncan", "roberts")
"""Ships whose masts and bridge lie where the landmarks are looked for."""

END_SHARES = {"measured": 0.02, "noiseless": 0.02, "synthetic": 0.05, "point": 0.05}
"""Share of the highest peak at which a ship begins. A bare deck, the only return if the transom is
dark, reaches 0.02; pixels of a level lattice spread as much beyond a sloping stern."""

SOURCES = tuple(END_SHARES)

LANDMARKS = {
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
"""Label and unit of each figure of a profile that is compared."""

Floats = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True, kw_only=True)
class Chain(Correction):
    """A chain of corrections.

    Attributes
    ----------
    form : str
        `exact`, or as printed by the article [1]_, `printed` or `printed_pulse_rate`.
    azimuth, mirror, range_filter : str
        As of `Correction`, for the exact chain.
    segmentation_threshold : float or None
        As of `ncti.irar.segmented`, in noise powers.

    See Also
    --------
    correct, correct_as_printed : The corrections.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, MIT Lincoln Laboratory, 'Data Processing'.

    Examples
    --------
    >>> from ncti.irar import Chain
    >>> Chain(mirror="none").azimuth
    'pixel'
    """

    form: str = EXACT
    segmentation_threshold: float | None = None

    def correct(
        self, scan: Scan, estimate: Flight, window: Window | None = None, overscanned: bool = False
    ) -> Snapshot:
        """Return the corrected images of a scan, in a window; printed rows are a pixel apart."""
        arguments: dict[str, Any] = {"estimate": estimate, "window": window}
        if self.form != EXACT:
            return correct_as_printed(scan, rate=RATES[self.form], **arguments)
        return correct(scan, self, overscanned=overscanned, **arguments)

    def tilt(self, scan: Scan, images: Any, truths: Any, estimate: Flight, window: Window) -> Tilt:
        """Return the tilt of corrected images, with places of looks for exact corrections only."""
        if self.form != EXACT:
            return tilts(images, truths)
        row, column, _ = places(scan, self, estimate)
        return tilts(images, truths, places=(row - window.bottom, column - window.left))

    def window(self, mesh: trimesh.Trimesh, flight: Flight, error: tuple[str, float]) -> Window:
        """Return the pixels of a corrected image: around the ship, wider if it may lean.

        A pointing `error`, (name, degrees), moves them to the ship's apparent place.
        """
        window = ship_window(mesh, flight)
        upright = self.azimuth == "pixel" and self.mirror in MIRROR_FORMS
        if error != NO_ERROR or self.form != EXACT or not upright:
            # Uncorrected lines rise by the mirror's angle; rows follow one another with the drift.
            turn = mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle)
            drift, steep = abs(flight.drift / flight.climb), math.tan(abs(math.radians(turn)))
            # The printed chain keeps the row spacing, though such lines climb slower or faster.
            tall = 1.0 if self.form == EXACT else 1.0 / max(1.0 - drift * steep, 0.1)
            longest = max(window.rows, window.columns)
            above = math.ceil(longest * max(1 / 8, 1.1 * steep) + window.rows * 0.6 * (tall - 1.0))
            aside = math.ceil(window.rows * max(1.0, drift + steep) * tall)
            window = window.padded(above, aside)
        if error[0] == "pointing":
            shift = math.radians(error[1]) * math.cos(math.radians(flight.depression)) / flight.ifov
            window = replace(window, left=window.left + round(shift))
        return window


def navigated_flight(flight: Flight, error: tuple[str, float]) -> Flight:
    """Return the flight that navigation measures, with one parameter wrong.

    `error` is the parameter's name and its error, in percent of the aircraft's speed, else in the
    parameter's unit; `NO_ERROR` for none.
    """
    parameter, value = error
    if parameter == NO_ERROR[0]:
        return flight
    if parameter == "aircraft_speed":
        return replace(flight, aircraft_speed=flight.aircraft_speed * (1 + value / 100))
    if parameter == "pointing" and flight.pointing is None:
        return replace(flight, pointing=flight.offset + value)
    return replace(flight, **{parameter: getattr(flight, parameter) + value})


def measure_tilts(
    chain: Chain,
    scan: Scan,
    clean: Scan,
    uncut: Snapshot,
    truth: Snapshot,
    estimate: Flight,
    *,
    shows_ship: bool,
) -> Arrays:
    """Return the tilts of corrected images [deg]: both sensors together, each alone, no noise.

    They are `mast_tilt` and `waterline_tilt`, each with `_error`, and with the prefixes
    `intensity_`, `infrared_` and `noiseless_`. `uncut` are corrected images without a threshold,
    `truth` the true images in the ship's window; `shows_ship` says whether the intensity shows a
    ship.
    """
    pixels = uncut.window
    # Tilts are of the uncut image if it shows a ship: a threshold eats into dim edges.
    truths = [_pad_values(truth, values, pixels) for values in (truth.intensity, truth.infrared)]
    images = [uncut.intensity * shows_ship, uncut.infrared]
    tilt = partial(chain.tilt, estimate=estimate, window=pixels)
    noiseless = chain.correct(clean, estimate, pixels).infrared
    lean = tilt(scan, images, truths)
    by_channel = {
        "": lean,
        "intensity_": tilt(scan, images[0], truths[0]),
        "infrared_": tilt(scan, images[1], truths[1]),
        "noiseless_": tilt(clean, noiseless, truths[1]),
    }
    degrees = {f"{name}mast_tilt": np.array(fit.mast) for name, fit in by_channel.items()}
    degrees |= {
        f"{name}waterline_tilt": np.array(fit.waterline) for name, fit in by_channel.items()
    }
    return degrees | {
        "mast_tilt_error": np.array(lean.mast_error),
        "waterline_tilt_error": np.array(lean.waterline_error),
    }


def model_profiles(
    mesh: trimesh.Trimesh,
    truth: Snapshot,
    flight: Flight,
    *,
    aspect: float,
    engine: str,
    bin_width: float,
    window: float,
    reflectance: str,
) -> Floats:
    """Return (noiseless, synthetic, point; bin) profiles for a carrier-to-noise ratio of 1.

    The last two come from a range image of the whole view with the sensor's pixels and uniform
    reflectivity: each pixel's area is spread over its range extent, or binned at its centre. Level
    rows of pixels see a deck at widely spaced distances, and only the whole extent closes the gaps.
    """
    sight: dict[str, Any] = {"slant_range": flight.slant_range}
    view = {"aspect": aspect, "depression": flight.depression, "roll": 0.0, **sight}
    image = range_image(mesh, pixel=flight.pixel, engine=engine, **view)
    # at least the pixel, in spite of rounding
    sight |= {"ifov": flight.ifov * (1 + 1e-9), "bin_width": bin_width, "window": window}
    synthetic = [
        range_extent(image, **sight, spread=spread, reflectance=reflectance).fraction.sum(axis=0)
        for spread in (1.0, 0.0)
    ]
    noiseless = profile(truth, flight, bins=len(synthetic[0]), bin_width=bin_width)
    return np.stack([noiseless, *synthetic])


def _pad_values(truth: Snapshot, values: Floats, window: Window) -> Floats:
    """Return values of a truth padded from its own window to a larger one."""
    above = (window.rows - truth.window.rows) // 2 * CELLS_PER_PIXEL
    aside = (window.columns - truth.window.columns) // 2 * CELLS_PER_PIXEL
    return np.pad(values, ((above, above), (aside, aside)))


def compare_profiles(
    profiles: Floats, down_range: Floats, *, aspect: float, ship: str = ""
) -> Arrays:
    """Return correlations of (source, bin) profiles at an aspect [deg], and their landmarks.

    Landmarks (source,) are NaN if the view is not near the stern or shows none. The hangar's spike
    is the highest of the synthetic profile, in which nothing glints, or the highest within
    `HANGARS`; in the others it is the highest peak close to that. Masts and bridge are searched for
    at their places in the Perry class, and reported for its ships only.
    """
    measured, noiseless, synthetic = profiles[:3]
    astern = abs(aspect - STERN) <= NEAR_STERN
    if astern and ship in HANGARS:
        first, last = HANGARS[ship]
        synthetic = np.where((down_range >= first) & (down_range <= last), synthetic, 0)
    spike = float(down_range[synthetic.argmax()])
    marks: list[Landmarks | None] = [None] * len(SOURCES)
    if astern:
        near = (spike - HANGAR_REACH, spike + HANGAR_REACH)
        for k, (line, end) in enumerate(zip(profiles, END_SHARES.values(), strict=False)):
            with suppress(NothingSeenError):
                marks[k] = landmarks(line, down_range, hangar=near, end=end)
    figures = [_landmark_values(mark, ship in PERRY) for mark in marks]
    correlate = partial(profile_correlation, measured, noiseless)
    near_spike = np.abs(down_range - spike) <= HANGAR
    return {
        "profile_correlation": np.array(correlate()),
        "profile_correlation_without_hangar": np.array(correlate(exclude=near_spike)),
        "hangar_spike_offset": np.array(
            figures[0].get("hangar", math.nan) - figures[1].get("hangar", math.nan)
        ),
        **{
            name: np.array([figure.get(name, math.nan) for figure in figures]) for name in LANDMARKS
        },
    }


def _landmark_values(marks: Landmarks | None, is_perry: bool) -> dict[str, float]:
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
    peaks |= {"mast": marks.mast, "forward": marks.forward} if is_perry else {}
    for name, peak in peaks.items():
        figures[f"{name}_position"] = peak.offset
        figures[f"{name}_ratio"] = peak.height
        figures[f"{name}_energy"] = peak.energy
    return figures
