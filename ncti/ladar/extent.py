"""Range extent: the fraction of each IFOV that the ship fills, by range bin."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require, require_each, require_word
from ncti.ladar.beam import Beam
from ncti.ladar.sampling import pixel_error, sampling_error
from ncti.render.image import RangeImage
from ncti.render.lines import LineImage
from ncti.render.view import View, check_made_at, far_field_error

Floats = NDArray[np.float64]

REFERENCE_BIN = 1.0  # m; the range bin for which the article states its beta-hat
MAX_SLANT_RANGE = 1e15  # m; the square of a longer slant range would leave float64
MAX_WINDOW_BINS = 2**22  # range bins of a window: 4 km in bins of 1 mm
MAX_SHIFT = 1e6  # IFOVs; positions within an IFOV then keep a precision of 1e-10


@dataclass(frozen=True, eq=False)
class RangeExtent:
    """Range-extent fractions of the IFOVs that see the ship, as returned by `range_extent`.

    Attributes
    ----------
    fraction : (ifov, bin) float64 ndarray
        Visible projected area in each range bin over the area of the IFOV. A row sums to at
        most 1, up to the sampling error of the image.
    down_range : (bin,) float64 ndarray
        Centres of the range bins [m], 0 at the ship origin, increasing away from the sensor.
    bin_width : float
        Width of a range bin [m].
    cell : (ifov, 2) int64 ndarray
        Column and row of each IFOV; the lower left corner of cell (0, 0) lies `shift` to the left
        of and below the ship origin.
    ifov : float
        Side of an IFOV [rad].
    slant_range : float
        Distance from sensor to ship origin [m].
    strands : (strand, bin) float64 ndarray
        Fractions from subsets of the samples, summed over IFOVs, for the error estimate; empty
        without one. Lines have sixteen strands, each of every sixteenth line, which add up to the
        sum of `fraction`. A range image has four, each of every second row and column, spread in
        range like an image with pixels twice as wide.
    line_count : int
        Lines across the ship; 0 if made from a range image.
    shift : (float, float)
        Position of the ship origin, right and up from the lower left corner of cell (0, 0) [IFOV].
    far_field_error : float
        Bound on the error of the far-field approximation at this range, from
        `ncti.render.far_field_error`; 0 if the image was drawn at the slant range.

    See Also
    --------
    range_extent : Compute it from an image.
    expected_profile : Closed-form profile of an extent.
    sample_frames : Random frames of an extent.

    Examples
    --------
    A plate of 30 m x 30 m, 2 m in front of the origin, fills four IFOVs of 15 m at 100 km. All of
    its area is in the bin from -2 m to -1 m:

    >>> import trimesh
    >>> from ncti.ladar import range_extent
    >>> from ncti.render import line_image
    >>> plate = trimesh.creation.box(extents=(4.0, 30.0, 30.0))
    >>> lines = line_image(plate, aspect=0, depression=0, spacing=0.5)
    >>> extent = range_extent(lines, slant_range=100e3)
    >>> extent.cell.tolist()
    [[-1, -1], [0, -1], [-1, 0], [0, 0]]
    >>> extent.fraction.sum(axis=1).round(2)
    array([1., 1., 1., 1.])
    >>> extent.down_range[extent.fraction.any(axis=0)]
    array([-1.5])
    >>> extent.error < 0.001
    True
    """

    fraction: NDArray[np.float64]
    down_range: NDArray[np.float64]
    bin_width: float
    cell: NDArray[np.int64]
    ifov: float
    slant_range: float
    strands: NDArray[np.float64] = field(default_factory=partial(np.zeros, (0, 0)))
    line_count: int = 0
    shift: tuple[float, float] = (0.0, 0.0)
    far_field_error: float = 0.0

    @property
    def error(self) -> float:
        """Bound on the error sum |p - q| / sum q of the summed extent."""
        return self.error_after(0.0)

    def error_after(self, pulse_width: float) -> float:
        """Return a bound on the error of the summed range extent after convolution with a pulse.

        Parameters
        ----------
        pulse_width : float
            Full width of pulse and matched filter at 1/e^2 of the intensity [s]; 0 for none.

        Returns
        -------
        float
            Bound on sum |p - q| / sum q, p the extent summed over IFOVs and convolved with the
            power response of the pulse, q the exact one. NaN if nothing is visible, and without
            strands.

        Notes
        -----
        The samples themselves bound the sampling error: lines by the content of their strands at
        frequencies below that of the lines (`ncti.ladar.sampling.sampling_error`), pixels by the
        differences between images of a quarter of them (`ncti.ladar.sampling.pixel_error`).
        The bound holds in 97 of 100 views and is twice the error in the median.
        `far_field_error` is added, so that the bound holds at the slant range even for a view drawn
        in the far field.
        """
        if not len(self.strands):
            return math.nan
        if self.line_count:
            error = sampling_error(
                self.strands, self.line_count, pulse_width, bin_width=self.bin_width
            )
        else:
            summed = self.fraction.sum(axis=0)
            error = pixel_error(self.strands, summed, pulse_width, bin_width=self.bin_width)
        return error + self.far_field_error

    @property
    def density(self) -> NDArray[np.float64]:
        """(ifov, bin) float64 ndarray: beta-hat, the fraction per metre of range times 1 m.

        The article states it for bins of 1 m; as a density it does not depend on the bin width.
        """
        return self.fraction * (REFERENCE_BIN / self.bin_width)

    def mirrored(self) -> RangeExtent:
        """Return the extent of the mirrored ship at the mirrored aspect, as a `RangeExtent`.

        The IFOV grid is mirrored too: the ship origin lies as far to the left as it did to the
        right.
        """
        right, up = self.shift
        cell = np.stack([-1 - self.cell[:, 0], self.cell[:, 1]], axis=1)
        order = np.lexsort(cell.T)  # rows first, as in `range_extent`: noise is drawn in this order
        return replace(
            self, fraction=self.fraction[order], cell=cell[order], shift=(0.0 - right, up)
        )

    def packed(self) -> dict[str, Any]:
        """Return the attributes as arrays for `unpacked`, without the empty bins at either end.

        Returns
        -------
        dict of str to ndarray or number
            The attributes by name. `fraction` and `strands` are cut to the bins from the first to
            the last that is not empty, and `begin` is the index of the first. For a ship in a
            window of 250 m they take a fifth of the space.

        See Also
        --------
        unpacked : Inverse of this method.
        """
        rows = [array.any(axis=0) for array in (self.fraction, self.strands) if len(array)]
        filled = np.flatnonzero(np.any(rows, axis=0))
        begin, end = (int(filled[0]), int(filled[-1]) + 1) if filled.size else (0, 0)
        return {
            **vars(self),
            "fraction": self.fraction[:, begin:end],
            "strands": self.strands[:, begin:end],
            "begin": begin,
        }

    @classmethod
    def unpacked(
        cls, *, fraction: Floats, strands: Floats, down_range: Floats, begin: int, **others: Any
    ) -> RangeExtent:
        """Rebuild an extent from the arrays of `packed`, bit for bit.

        Parameters
        ----------
        fraction, strands : (..., bin) float64 ndarray
            Consecutive bins; all others are empty.
        down_range : (bin,) float64 ndarray
            Centres of all range bins [m].
        begin : int
            Number of the first of these bins.
        **others
            The other attributes.

        Returns
        -------
        RangeExtent

        See Also
        --------
        packed : Arrays to unpack.

        Examples
        --------
        >>> import trimesh
        >>> from ncti.ladar import RangeExtent, range_extent
        >>> from ncti.render import line_image
        >>> plate = trimesh.creation.box(extents=(4.0, 30.0, 30.0))
        >>> lines = line_image(plate, aspect=0, depression=0, spacing=0.5)
        >>> extent = range_extent(lines, slant_range=100e3)
        >>> packed = extent.packed()
        >>> extent.fraction.shape, packed["fraction"].shape, packed["begin"]
        ((4, 250), (4, 1), 123)
        >>> bool((RangeExtent.unpacked(**packed).fraction == extent.fraction).all())
        True
        """

        def expand(bins: Floats) -> Floats:
            full = np.zeros((len(bins), down_range.size))
            full[:, begin : begin + bins.shape[1]] = bins
            return full

        strands = expand(strands) if len(strands) else strands
        return cls(fraction=expand(fraction), strands=strands, down_range=down_range, **others)


def range_extent(
    image: RangeImage | LineImage,
    *,
    slant_range: float,
    ifov: float = Beam.ifov,
    bin_width: float = Beam.bin_width,
    window: float = Beam.window,
    spread: float = 0.5,
    reflectance: str = "projected_area",
    shift: tuple[float, float] = (0.0, 0.0),
) -> RangeExtent:
    """Return the fraction of each IFOV that the ship fills in each range bin.

    Parameters
    ----------
    image : RangeImage or LineImage
        Finely resolved range image, or the visible pieces along lines.
    slant_range : float
        Distance from sensor to ship origin [m]. A far-field image is corrected for the wavefront
        curvature at this range; an image made at a finite range must have been made at this one.
    ifov : float
        Side of the square instantaneous field of view [rad].
    bin_width : float
        Width of a range bin [m].
    window : float
        Length of the range window [m], centred on the ship origin.
    spread : float
        Share of the range extent of a pixel, p (|dr/dx| + |dr/dy|), over which its area is
        spread; 0 is point sampling. Lines are exact and ignore it.
    reflectance : str
        `projected_area`: the return is proportional to the visible projected area, as in the
        article. `lambertian`: times the cosine of incidence, 1 / sqrt(1 + |grad r|^2).
    shift : (float, float)
        Position of the ship origin in an IFOV, right and up from its lower left corner [IFOV].

    Returns
    -------
    RangeExtent
        Only the IFOVs that see some of the ship.

    Raises
    ------
    ValueError
        If a parameter is out of range, the image was made at another slant range, or the ship
        reaches the sensor or does not fit into the window.

    See Also
    --------
    ncti.render.line_image : Visible pieces along lines; the exact and faster input.
    ncti.render.range_image : Rendered range image.
    lines_within : Line image of a given accuracy.
    expected_profile : Range profile of the extent.

    Notes
    -----
    The fraction is the article's beta-hat [1]_. IFOVs tile the view, by default with a corner on
    the line of sight through the ship origin, the centre of the 2 x 2 detector. A shift changes
    the share of each IFOV, not their sum; a shift by a whole IFOV only renumbers the cells.

    A pixel on a deck at grazing incidence spans metres of range, so point sampling puts the deck
    into a comb of bins (the three spikes of Figure 16 of [1]_). Here each pixel is a uniform box
    in range. Half of its full extent is used, because the pixels of a rolled lattice interleave
    in range, and a wider box leaks past the ends of a deck.

    Boxes are binned exactly, at a cost that does not depend on their width: the cumulative area
    at a bin edge is a sum of clipped ramps, each of which starts and stops a slope (two cumulative
    sums over each IFOV).

    References
    ----------
    .. [1] "Non-Cooperative Identification of Ships with Electrooptical Data", The Lincoln
       Laboratory Journal, Appendix 1, section "Laser Radar Range Signatures" and Figure 16.

    Examples
    --------
    A deck of 40 m x 10 m, 10 m high, seen 30 degrees from above. The fractions sum to its projected
    area, deck times sin 30 plus near face times cos 30, over the 225 m^2 of an IFOV:

    >>> import math
    >>> import trimesh
    >>> from ncti.ladar import range_extent
    >>> from ncti.render import line_image
    >>> block = trimesh.creation.box(extents=(40.0, 10.0, 10.0))
    >>> lines = line_image(block, aspect=0, depression=30, spacing=0.25)
    >>> extent = range_extent(lines, slant_range=100e3)
    >>> print(f"{extent.fraction.sum():.3f}")
    1.274
    >>> print(f"{(40 * 10 * math.sin(math.pi / 6) + 10 * 10 * math.cos(math.pi / 6)) / 225:.3f}")
    1.274
    """
    require("slant_range", slant_range, positive=True, maximum=MAX_SLANT_RANGE)
    require("ifov", ifov, positive=True, maximum=1.0)
    half_window, bin_count = bins_of(window, bin_width)
    require("spread", spread, minimum=0.0)
    require_word("reflectance", reflectance, ("projected_area", "lambertian"))
    require_each("shift", shift, 2, minimum=-MAX_SHIFT, maximum=MAX_SHIFT)
    shift = float(shift[0]), float(shift[1])
    check_made_at(image.slant_range, slant_range)
    side = ifov * slant_range
    if side < image.resolution:
        raise ValueError(
            f"ifov is {ifov!r} rad, but must be at least {image.resolution / slant_range:.3g} rad, "
            f"the {image.resolution:g} m resolution of the range image at {slant_range:g} m"
        )
    lambertian = reflectance == "lambertian"
    # Pieces of lines are integrated exactly, and in strands for the error estimate.
    if isinstance(image, LineImage):
        cell, area, strands, reach = image.bin(
            side=side,
            shift=shift,
            slant_range=slant_range,
            near=-half_window,
            bin_width=bin_width,
            bin_count=bin_count,
            weight=image.cosine if lambertian else None,
        )
        if reach >= slant_range:
            _check_clear(image, image.piece[:, 2:], slant_range)
        _check_reach(reach, half_window)
        fraction, strands = area / side**2, strands / side**2
    else:
        bins = half_window, bin_width, bin_count
        options: dict[str, Any] = {"side": side, "spread": spread, "lambertian": lambertian}
        cell, fraction, strands, reach = _bin_pixels(image, slant_range, shift, bins, **options)
    return RangeExtent(
        fraction=fraction,
        down_range=bin_width * (np.arange(bin_count, dtype=np.float64) + 0.5) - half_window,
        bin_width=bin_width,
        cell=cell,
        ifov=ifov,
        slant_range=slant_range,
        strands=strands,
        line_count=image.count if isinstance(image, LineImage) else 0,
        shift=shift,
        far_field_error=_far_field_error(image, reach, slant_range),
    )


def _bin_pixels(
    image: RangeImage,
    slant_range: float,
    shift: tuple[float, float],
    bins: tuple[float, float, int],
    *,
    side: float,
    spread: float,
    lambertian: bool,
) -> tuple[NDArray[np.int64], Floats, Floats, float]:
    """Return IFOVs, their fractions and the strands of a range image, and its reach [m].

    Spread pixels over boxes in range, sort them into IFOVs and bin them. For the error estimate,
    also bin every second row and column as an image with pixels twice as wide.
    """
    from ncti.ladar import pixels

    half_window, bin_width, bin_count = bins
    hit = np.nonzero(image.hit)
    _check_clear(image, image.down_range[hit], slant_range)
    r, horizontal, vertical = pixels.places(image, hit, slant_range)
    reach = float(np.abs(r).max(initial=0.0))
    _check_reach(reach, half_window)
    area, half_width = pixels.boxes(image, hit, side=side, spread=spread, lambertian=lambertian)
    cell, index = pixels.tile(horizontal / side + shift[0], vertical / side + shift[1])
    middle, half = (r + half_window) / bin_width, half_width / bin_width
    fraction = pixels.bin_boxes(index, middle, half, area, len(cell), bin_count)
    return cell, fraction, pixels.strands(hit, middle, half, area, bin_count), reach


def _far_field_error(image: RangeImage | LineImage, reach: float, slant_range: float) -> float:
    """Return the bound on the error of a far-field image with a down-range reach [m]."""
    if image.slant_range is not None:
        return 0.0
    if isinstance(image, LineImage):
        places = image.bounds
    else:
        places = image.cross_range_at(*np.nonzero(image.hit))
    across = max(float(np.abs(place).max(initial=0.0)) for place in places)
    return far_field_error(reach, slant_range, across=across)


def bins_of(window: float, bin_width: float) -> tuple[float, int]:
    """Return half the length of the range window [m] and its number of bins."""
    require("window", window, positive=True)
    require("bin_width", bin_width, positive=True, minimum=window / MAX_WINDOW_BINS)
    bin_count = max(1, round(window / bin_width))
    return bin_count * bin_width / 2, bin_count


def bin_centres(window: float, bin_width: float) -> Floats:
    """Return the down-range positions of the bins of a profile.

    Parameters
    ----------
    window, bin_width : float
        Range window centred on the ship, and a bin of it [m].

    Returns
    -------
    (bin,) float64 ndarray
        Centres of the bins, relative to the ship origin [m].

    See Also
    --------
    range_extent : Returns an extent with these bins.

    Examples
    --------
    >>> from ncti.ladar import bin_centres
    >>> bin_centres(4.0, 1.0).tolist()
    [-1.5, -0.5, 0.5, 1.5]
    """
    bins = round(window / bin_width)
    return bin_width * (np.arange(bins, dtype=np.float64) - (bins - 1) / 2)


def no_return(window: float, bin_width: float) -> RangeExtent:
    """Return the range extent of a window without a ship.

    Parameters
    ----------
    window, bin_width : float
        As of `bin_centres` [m].

    Returns
    -------
    RangeExtent
        Without an IFOV.

    See Also
    --------
    range_extent : Range extent of a ship.

    Examples
    --------
    >>> from ncti.ladar import no_return
    >>> no_return(250.0, 1.0).fraction.shape
    (0, 250)
    """
    bins = bin_centres(window, bin_width)
    nothing, cell = np.zeros((0, bins.size)), np.zeros((0, 2), dtype=np.int64)
    return RangeExtent(nothing, bins, bin_width, cell, ifov=1.0, slant_range=1.0)


def _check_clear(image: RangeImage | LineImage, down_range: Floats, slant_range: float) -> None:
    """Raise `ValueError` if the ship of a far-field image would reach the sensor."""
    if image.slant_range is None:
        view = View(image.aspect, image.depression, slant_range=slant_range)
        view.check_clear(float(down_range.min(initial=0.0)))


def _check_reach(reach: float, half_window: float) -> None:
    """Raise `ValueError` if the ship does not fit into the window."""
    if reach > half_window:
        raise ValueError(
            f"window is {2 * half_window:g} m, but must be at least {2 * reach:.1f} m to hold "
            "this ship"
        )
