"""Displacements that take every sample of a scan to its place in the snapshot.

Each function returns displacements of a sample's place or range. None of them resamples an image,
so steps do not blur one another, and looks stay separate until they are averaged (`looks`). Rows
and columns are counted in pixels (IFOVs of the snapshot) from the line of sight to the ship's
origin, upwards and to the right.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.irar.flight import Flight
from ncti.irar.mirror import mirror_rotation

Floats = NDArray[np.float64]

MOTION_METHODS = ("pixel", "line", "constant")


def azimuth_shift(flight: Flight, slant_range: float, *, rate: float, scans: float = 1.0) -> float:
    """Return the shift of the ship's image across the scan, in pixels per scan or per row.

    Parameters
    ----------
    flight : Flight
        Speeds V_a and V_s, headings beta_a and beta_s, the azimuth theta of the line of sight from
        the aircraft's heading, and the instantaneous field of view phi. The aircraft's heading is
        the direction of its motion.
    slant_range : float
        Slant range R [m].
    rate : float
        Rate f [Hz].
    scans : float
        Number N of scans between the two images.

    Returns
    -------
    float
        Shift [pixel], positive to the right.

    Raises
    ------
    ValueError
        If range, rate or scans are not positive.

    See Also
    --------
    mirror_rotation : The article's other equation of the corrections.
    correct_as_printed : Corrections with this equation.

    Notes
    -----
    The equation of the azimuthal shift [1]_,

        N (V_a sin(theta) - V_s cos(beta_a + theta + 270 deg - beta_s)) / (R phi f).

    The bracket is the velocity of the ship relative to the aircraft, to the right across the line
    of sight: cos(x + 270 deg) is sin(x), and the ship's part, V_s sin(beta_s - beta_a - theta), has
    a plus sign. The article calls f the pulse-repetition frequency, but the equation is a shift per
    scan only with the line rate and N = 1. N lines make a row, so N gives the shift per row. With
    the pulse-repetition frequency it is smaller by the number of samples of a line.

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data",
       The Lincoln Laboratory Journal, 'Data Processing'.

    Examples
    --------
    Per row of ten lines at 3.9 km, 5 deg off a ship that sails straight away:

    >>> flight = Flight(slant_range=3.9e3, ship_heading=0.0, offset=5.0)
    >>> shift = azimuth_shift(flight, 3.9e3, rate=flight.line_rate, scans=10)
    >>> print(f"{shift:.2f} pixels")
    0.75 pixels
    """
    for name, value in {"slant_range": slant_range, "rate": rate, "scans": scans}.items():
        require(name, value, positive=True)
    offset = flight.sight - flight.track
    theta = math.radians(offset)
    towards = math.radians(flight.track + offset + 270.0 - flight.ship_heading)
    bracket = flight.aircraft_speed * math.sin(theta) - flight.ship_speed * math.cos(towards)
    return scans * bracket / (slant_range * flight.ifov * rate)


def approach_rate(flight: Flight) -> float:
    """Return the rate at which the slant range decreases in the snapshot [m/s]."""
    return flight.closing_speed * math.cos(math.radians(flight.depression))


def snapshot_places(flight: Flight, time: Floats, ranges: Floats) -> tuple[Floats, Floats, Floats]:
    """Return row, column [pixel] and range [m] of each sample's target in the snapshot, exactly.

    All results are (line, sample). `time` [s] is after the snapshot; where `ranges` [m] are NaN,
    the range of the ship's origin gives row and column. The direction and range of a sample give a
    point on the ship, projected into the view from the aircraft's place in the snapshot. This makes
    all corrections at once.
    """
    position = flight.position(time)
    nominal = np.linalg.norm(position, axis=-1)
    reach = np.where(np.isnan(ranges), nominal, ranges)
    point = position + reach[..., None] * _beam_directions(flight, time.shape)
    sight = point - flight.position(np.zeros(()))
    row, column = _image_places(flight, sight)
    distance = np.linalg.norm(sight, axis=-1)
    return row, column, np.where(np.isnan(ranges), np.nan, distance)


def raw_places(flight: Flight, samples: NDArray[np.integer]) -> tuple[Floats, Floats]:
    """Return rows and columns (sample,) [pixel] of samples of a level scan without motion.

    There is one column per sample, centred on the scan's pointing.
    """
    row, column = _image_places(flight, flight.directions(np.zeros(()), np.zeros(())))
    along: Floats = np.asarray(samples) - (flight.samples - 1) / 2
    return np.full_like(along, row), along + column


def mirror_displacement(
    flight: Flight, samples: NDArray[np.integer], *, form: str = "exact"
) -> tuple[Floats, Floats]:
    """Return displacements (sample,) of rows and columns [pixel] by the lean of the lines.

    `exact` reflects every sample's beam; `printed` is a shear by the article's small-angle form.

    The article's 'Data Processing' prescribes a rotation (`rotate`). With one scanned detector the
    lines lean while the rows still climb straight up with the aircraft: a shear. The rotation
    levels the waterline, but tilts the mast by the same angle. A sample of a line that leans by L
    is sin(L) higher than the one before it, and cos(L) to its right. At psi = 45 deg the printed
    tangent happens to equal that sine exactly, so the printed shear levels the waterline; only its
    columns remain 1 - cos(L) too wide.
    """
    level_row, level_column = raw_places(flight, samples)
    angles = flight.scan_angles(samples)
    if form == "exact":
        row, column = _image_places(flight, flight.directions(angles, np.zeros_like(angles)))
        return row - level_row, column - level_column
    lean = mirror_rotation(flight.depression, mirror_angle=flight.mirror_angle, form=form)
    return math.tan(math.radians(lean)) * angles / flight.ifov, np.zeros_like(angles)


def rotate(row: Floats, column: Floats, *, clockwise: float) -> tuple[Floats, Floats]:
    """Return (...) rows and columns [pixel] rotated about the ship's origin, as in the article.

    `clockwise` [deg]; minus the angle of `mirror_rotation` undoes the mirror's rotation.
    """
    c, s = math.cos(math.radians(clockwise)), math.sin(math.radians(clockwise))
    return c * row - s * column, s * row + c * column


def motion_displacement(
    flight: Flight, time: Floats, ranges: Floats, *, method: str = "pixel"
) -> tuple[Floats, Floats, Floats]:
    """Return displacements (line, sample) to the snapshot: rows, columns [pixel] and range [m].

    The method `pixel` follows each sample's own range and direction; `line` the ship's origin, with
    range and offset of each line; `constant` the origin at time 0, one shift for all lines, with
    `azimuth_shift` for the columns. The article computes the correction at each pixel and
    propagates it through every scan line ('Data Processing'). For an aircraft heading 5 deg off the
    ship, a mast leans by nearly 40 deg uncorrected, by a few degrees with `constant`, by one
    degree with `line`, and not at all with `pixel`.
    """
    if method == "constant":
        row = flight.climb * time / flight.pixel
        shift = flight.line_rate * azimuth_shift(flight, flight.slant_range, rate=flight.line_rate)
        return row, -shift * time, approach_rate(flight) * time
    # By the true geometry: of the ship's origin (`line`), or of each sample (`pixel`).
    position = flight.position(time)
    nominal = np.linalg.norm(position, axis=-1)
    if method == "line":
        row, column = _image_places(flight, -position)
        return -row, -column, flight.slant_range - nominal
    row, column, distance = snapshot_places(flight, time, ranges)
    row_now, column_now = _image_places(flight, _beam_directions(flight, time.shape))
    nominal_snapshot = np.linalg.norm(flight.position(np.zeros(())))
    closer = np.where(np.isnan(ranges), nominal_snapshot - nominal, distance - ranges)
    return row - row_now, column - column_now, closer


def _beam_directions(flight: Flight, shape: tuple[int, ...]) -> Floats:
    """Return the direction of each sample's beam, (line, sample, 3)."""
    angles = flight.scan_angles(np.arange(shape[-1]))
    return np.broadcast_to(flight.directions(angles, np.zeros_like(angles)), (*shape, 3))


def _image_places(flight: Flight, directions: Floats) -> tuple[Floats, Floats]:
    """Return rows and columns of directions in the snapshot [pixel]."""
    right, up, away = np.moveaxis(directions @ flight.snapshot_axes.T, -1, 0)
    return up / away / flight.ifov, right / away / flight.ifov
