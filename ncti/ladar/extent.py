"""Range extent: how much of each IFOV the ship fills, bin by range bin."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_each
from ncti.ladar.pulse import target_response
from ncti.render.image import RangeImage
from ncti.render.lines import LineImage
from ncti.render.view import View

Floats = NDArray[np.float64]

REFERENCE_BIN = 1.0  # m; the bin of the article, in which its beta-hat is stated
ERROR = 0.75  # of the difference of odd and even lines; see `RangeExtent.error`
FARTHEST = 1e15  # m; the squares of longer slant ranges would leave float64
MOST_BINS = 2**22  # of a range window: 4 km in bins of 1 mm
MOST_SHIFT = 1e6  # IFOVs; places in them are then known to 1e-10
_POINT = 1e-3  # bins; a narrower spread is a point
_ROUNDING = 1e-8  # of a pixel; slopes of 1/_POINT over hundreds of bins leave some 1e-9


@dataclass(frozen=True, eq=False)
class RangeExtent:
    """Range-extent fractions of the IFOVs that see the ship.

    Attributes
    ----------
    fraction : (ifov, bin) float64 ndarray
        Visible projected area in each range bin over the area of the IFOV; a row sums to at
        most 1, up to the sampling error of the image.
    down_range : (bin,) float64 ndarray
        Centres of the range bins [m], 0 at the ship origin.
    bin_width : float
        Width of a range bin [m].
    cell : (ifov, 2) int64 ndarray
        Column and row of each IFOV; the corner of column 0 and row 0 lies `shift` to the left of
        and below the ship origin.
    ifov : float
        Side of an IFOV [rad].
    slant_range : float
        Sensor to ship origin [m].
    difference : (bin,) float64 ndarray or None
        What odd and even lines of a line image disagree in: the fractions of all IFOVs by the
        ones less those by the others, which together are the sum of `fraction`. None of a range
        image.
    shift : (float, float)
        Where the ship origin lies, right and up from the corner of column 0 and row 0 [IFOV].
    """

    fraction: NDArray[np.float64]
    down_range: NDArray[np.float64]
    bin_width: float
    cell: NDArray[np.int64]
    ifov: float
    slant_range: float
    difference: NDArray[np.float64] | None = None
    shift: tuple[float, float] = (0.0, 0.0)

    @property
    def error(self) -> float:
        """Estimated error of the ship's range extent, sum |p - q| / sum q; NaN of an image."""
        return self.error_after(0.0)

    def error_after(self, pulse_width: float) -> float:
        """Return the estimated error of the ship's range extent after a pulse.

        Parameters
        ----------
        pulse_width : float
            Full width of pulse and matched filter at 1/e^2 of the intensity [s]; 0 for none.

        Returns
        -------
        float
            Estimate of sum |p - q| / sum q, p the extent after the pulse and q the exact one; NaN
            of an image, which does not know its error, and where nothing is seen.

        Notes
        -----
        Odd and even lines are two estimates of equal spacing. Half their difference overrates the
        error of both together: of three ships, by lines of 1 to 1/8 m, with and without a pulse,
        95 % of the errors were below 0.4 to 0.73 of it. `ERROR` is 0.75, so that the estimate is
        a bound for nearly all views, and twice the error of most.
        """
        if self.difference is None:
            return math.nan
        return estimated_error(
            self.difference, self.fraction.sum(axis=0), pulse_width, bin_width=self.bin_width
        )

    @property
    def density(self) -> NDArray[np.float64]:
        """(ifov, bin) float64 ndarray: beta-hat, the fraction per metre of range times 1 m.

        The article states it at its 1 m bins; as a density the profile is free of the bin.
        """
        return self.fraction * (REFERENCE_BIN / self.bin_width)

    def mirrored(self) -> RangeExtent:
        """The extent of the same ship with port and starboard swapped, seen from the other side.

        IFOVs are mirrored, too: the ship origin then lies as far to the left as it did right.
        """
        right, up = self.shift
        cell = np.stack([-1 - self.cell[:, 0], self.cell[:, 1]], axis=1)
        order = np.lexsort(cell.T)  # by rows, as of `range_extent`: noise is drawn in that order
        return replace(
            self, fraction=self.fraction[order], cell=cell[order], shift=(0.0 - right, up)
        )


def estimated_error(
    difference: Floats, whole: Floats, pulse_width: float, *, bin_width: float
) -> float:
    """Return the estimated sum |p - q| / sum q from (bin,) sums; see `RangeExtent.error_after`."""
    if pulse_width > 0.0:
        response = target_response(pulse_width=pulse_width, bin_width=bin_width) ** 2
        difference, whole = np.convolve(difference, response), np.convolve(whole, response)
    total = float(whole.sum())
    return ERROR * float(np.abs(difference).sum()) / total if total > 0 else math.nan


def range_extent(
    image: RangeImage | LineImage,
    *,
    slant_range: float,
    ifov: float = 150e-6,
    bin_width: float = 1.0,
    window: float = 250.0,
    spread: float = 0.5,
    reflectance: str = "projected_area",
    shift: tuple[float, float] = (0.0, 0.0),
) -> RangeExtent:
    """Range-extent fractions of every IFOV on the ship.

    Parameters
    ----------
    image : RangeImage or LineImage
        Finely resolved range image, or the visible pieces along lines.
    slant_range : float
        Sensor to ship origin [m]. An image of the far field gets the wavefront curvature of
        this range; one made at a finite range must have been made at this one.
    ifov : float
        Side of the square instantaneous field of view [rad].
    bin_width : float
        Range bin [m].
    window : float
        Length of the range window [m], centred on the ship origin.
    spread : float
        Share of a pixel's own range extent, p (|dr/dx| + |dr/dy|), over which its area is
        spread; 0 is point sampling. Lines are exact and need none.
    reflectance : str
        `projected_area`: the return follows the visible projected area, as in the article.
        `lambertian`: times the cosine of incidence, 1 / sqrt(1 + |grad r|^2).
    shift : (float, float)
        Where the ship origin lies in an IFOV, right and up from its corner [IFOV].

    Returns
    -------
    RangeExtent
        Only the IFOVs that see some of the ship.

    Raises
    ------
    ValueError
        If a parameter is out of range, the image was made at another slant range, or the ship
        reaches the sensor or does not fit into the window.

    Notes
    -----
    Article, Appendix 1 (beta-hat) and 'Laser Radar Range Signatures'. IFOVs tile the view, by
    default with a corner on the line of sight through the ship origin, the centre of the 2 x 2
    detector. A shift moves what each IFOV holds, not their sum; by a whole IFOV it only changes
    the numbers of cells.

    A pixel of a grazing deck spans metres of range, so that point sampling puts the deck into
    a comb of bins (the three spikes of the article's Figure 16). Here each pixel is a uniform
    box in range. Half of the pixel's full extent is used: the pixels of a rolled lattice
    interleave in range, and a wider box leaks past the ends of a deck.

    Boxes are binned exactly at a cost free of their width: the cumulative area at a bin edge is
    a sum of clipped ramps, each of which starts and stops a slope (two sums over each IFOV).
    """
    require("slant_range", slant_range, positive=True, maximum=FARTHEST)
    require("ifov", ifov, positive=True, maximum=1.0)
    require("bin_width", bin_width, positive=True)
    require("window", window, positive=True)
    if window > MOST_BINS * bin_width:
        raise ValueError(
            f"bin_width is {bin_width!r} m, but must be at least {window / MOST_BINS:.3g} m in a "
            f"window of {window:g} m, which may have {MOST_BINS} bins"
        )
    require("spread", spread, minimum=0.0)
    if reflectance not in ("projected_area", "lambertian"):
        raise ValueError(
            f"reflectance is {reflectance!r}, but must be projected_area or lambertian"
        )
    require_each("shift", shift, 2, minimum=-MOST_SHIFT, maximum=MOST_SHIFT)
    right, up = float(shift[0]), float(shift[1])
    if image.slant_range is not None and not math.isclose(image.slant_range, slant_range):
        raise ValueError(
            f"slant_range is {slant_range!r}, but must be the {image.slant_range!r} m at which "
            "the range image was made"
        )
    side = ifov * slant_range
    if side < image.resolution:
        raise ValueError(
            f"ifov is {ifov!r} rad, but must be at least {image.resolution / slant_range:.3g} rad, "
            f"the {image.resolution:g} m resolution of the range image at {slant_range:g} m"
        )
    bin_count = max(1, round(window / bin_width))
    half_window = bin_count * bin_width / 2
    lambertian = reflectance == "lambertian"
    difference = None
    if isinstance(image, LineImage):
        parts = image.bin(
            side=side,
            shift=(right, up),
            slant_range=slant_range,
            near=-half_window,
            bin_width=bin_width,
            bin_count=bin_count,
            weight=image.cosine if lambertian else None,
        )
        if parts.reach >= slant_range:
            _check_clear(image, image.piece[:, 2:], slant_range)
        _check_reach(parts.reach, half_window)
        cell = parts.cell
        even, odd = parts.area[:, 0] / side**2, parts.area[:, 1] / side**2
        fraction, difference = even + odd, (even - odd).sum(axis=0)
    else:
        _check_clear(image, image.down_range[image.hit], slant_range)
        r, horizontal, vertical = _places(image, slant_range)
        _check_reach(float(np.abs(r).max(initial=0.0)), half_window)
        area, half_width = _boxes(image, side=side, spread=spread, lambertian=lambertian)
        cell, index = _tile(horizontal / side + right, vertical / side + up)
        fraction = _bin_boxes(
            index,
            (r - half_width + half_window) / bin_width,
            (r + half_width + half_window) / bin_width,
            area,
            group_count=len(cell),
            bin_count=bin_count,
        )
    return RangeExtent(
        fraction=fraction,
        down_range=bin_width * (np.arange(bin_count, dtype=np.float64) + 0.5) - half_window,
        bin_width=bin_width,
        cell=cell,
        ifov=ifov,
        slant_range=slant_range,
        difference=difference,
        shift=(right, up),
    )


def _check_clear(image: RangeImage | LineImage, seen: Floats, slant_range: float) -> None:
    """Refuse a ship that reaches the sensor, though seen from the far field."""
    if image.slant_range is None:
        view = View(image.aspect, image.depression, slant_range=slant_range)
        view.check_clear(float(seen.min(initial=0.0)))


def _check_reach(reach: float, half_window: float) -> None:
    """Refuse a window that the ship leaves."""
    if reach > half_window:
        raise ValueError(
            f"window is {2 * half_window:g} m, but must be at least {2 * reach:.1f} m to hold "
            "this ship"
        )


def _places(image: RangeImage, slant_range: float) -> tuple[Floats, Floats, Floats]:
    """Down-range, horizontal and vertical cross-range [m] of the pixels that see the ship."""
    hit = np.nonzero(image.hit)
    r = image.down_range[hit]
    horizontal, vertical = image.cross_range_at(*hit)
    if image.slant_range is None:
        r = r + _sagitta(r, horizontal**2 + vertical**2, slant_range)
    return r, horizontal, vertical


def _boxes(
    image: RangeImage, *, side: float, spread: float, lambertian: bool
) -> tuple[Floats, Floats]:
    """Share of an IFOV, and half the range [m] over which it is spread, of pixels on the ship."""
    slope = image.gradient[np.nonzero(image.hit)].astype(np.float64)
    area = np.full(len(slope), (image.pixel / side) ** 2)
    if lambertian:
        area /= np.sqrt(1 + slope[:, 0] ** 2 + slope[:, 1] ** 2)
    return area, spread * image.pixel * (np.abs(slope[:, 0]) + np.abs(slope[:, 1])) / 2


def _sagitta(
    r: NDArray[np.float64], cross_range_squared: NDArray[np.float64], slant_range: float
) -> NDArray[np.float64]:
    """Wavefront curvature sqrt((R0 + r)^2 + s^2) - (R0 + r) [m], free of cancellation."""
    along = slant_range + r
    return cross_range_squared / (along + np.sqrt(along**2 + cross_range_squared))


def _tile(
    horizontal: NDArray[np.float64], vertical: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Occupied unit cells of the view (cell, 2), and the cell of each point (point,)."""
    column = np.floor(horizontal).astype(np.int64)
    row = np.floor(vertical).astype(np.int64)
    # From the ship's own first cell: it may be far from the line of sight through the origin.
    left, bottom = (int(some.min()) if some.size else 0 for some in (column, row))
    columns = int(column.max()) - left + 1 if column.size else 1
    flat = (row - bottom) * columns + (column - left)
    seen = np.bincount(flat) > 0  # a few hundred cells: far quicker than sorting the pixels
    occupied = np.flatnonzero(seen)
    cell = np.stack([occupied % columns + left, occupied // columns + bottom], axis=1)
    return cell, (np.cumsum(seen) - 1)[flat]


def _bin_boxes(
    group: NDArray[np.intp],
    start: NDArray[np.float64],
    stop: NDArray[np.float64],
    area: NDArray[np.float64],
    *,
    group_count: int,
    bin_count: int,
) -> NDArray[np.float64]:
    """Area of uniform boxes [start, stop] in every (group, bin), bins of unit width from 0."""
    # A box narrower than a point gets a point's width about its centre; one that pokes out of
    # the window is cut there, its area kept.
    short = np.maximum(_POINT - (stop - start), 0.0) / 2
    start = np.clip(start - short, 0.0, bin_count - _POINT)
    stop = np.clip(stop + short, start + _POINT, bin_count)
    rate = area / (stop - start)
    # cumulative(edge) = sum of rate * (edge - start) over ramps begun, less those ended.
    edges = bin_count + 1
    begun = group * edges + np.ceil(start).astype(np.int64)
    ended = group * edges + np.ceil(stop).astype(np.int64)
    at = np.concatenate([begun, ended])
    rates = np.concatenate([rate, -rate])
    offsets = rates * np.concatenate([start, stop])
    size = group_count * edges
    slopes = np.bincount(at, rates, size).reshape(group_count, edges).cumsum(axis=1)
    shifts = np.bincount(at, offsets, size).reshape(group_count, edges).cumsum(axis=1)
    binned = np.diff(slopes * np.arange(edges) - shifts, axis=1)
    # Where ramps cancel they leave rounding, which must not pass for an occupied bin.
    binned[binned < _ROUNDING * area.max(initial=0.0)] = 0.0
    return binned
