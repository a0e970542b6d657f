"""Line images and range extents of a given accuracy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ncti.checks import require
from ncti.ladar.extent import FARTHEST, RangeExtent, binned_extent, bins_of
from ncti.ladar.sampling import SLOPE, sampling_error, scarcity
from ncti.render.draw_lines import between, line_image, merged
from ncti.render.far_field import drawn_range, sampling_tolerance
from ncti.render.lines import STRANDS, LineImage
from ncti.render.surfaces import Surfaces
from ncti.render.view import ROLL

if TYPE_CHECKING:
    import trimesh

Floats = NDArray[np.float64]

FIRST = 0.75
"""Distance between the lines that are drawn first [m]: a fifth of the cost of the lines that an
error of 0.1 % takes, and enough of them to choose those from."""

FINEST = 1 / 256
"""Smallest distance between lines [m]: the error of ships is then some 0.003 % without a pulse."""

FEWEST = 32
"""Lines across a ship below which they may agree by chance."""

AIM = 0.8
"""Part of the tolerance that the next spacing is chosen for: a bound scatters about its fall."""

SPARE = 0.98
"""Part of the tolerance that is used in the far field: at the range of the sensor, wavefront
curvature moves some of the extent, and of its bound, into the next bin."""


def lines_within(
    mesh: trimesh.Trimesh,
    *,
    aspect: float,
    depression: float,
    tolerance: float,
    pulse_width: float,
    roll: float = ROLL,
    slant_range: float | None = None,
    bin_width: float = 1.0,
    window: float = 250.0,
    spacing: float = FIRST,
) -> LineImage:
    """Return a line image, as coarse as possible, whose range extent is accurate to a tolerance.

    Parameters
    ----------
    mesh, aspect, depression, roll, slant_range
        See `ncti.render.line_image`.
    tolerance : float
        Largest error of the summed range extent after the pulse, sum |p - q| / sum q.
    pulse_width : float
        Full width of pulse and matched filter at 1/e^2 of the intensity [s]; 0 for none.
    bin_width, window : float
        Width of the range bins of the extent, and length of their window [m].
    spacing : float
        Largest distance between lines [m].

    Returns
    -------
    LineImage
        Lines some 0.75 m apart are drawn first. Their spacing is divided by whole numbers until
        the bound on the error is within the tolerance, down to 1/256 m.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    extent_within : The range extent itself, in less time.
    ncti.render.line_image : Lines of a given spacing.
    RangeExtent.error_after : The bound.

    Notes
    -----
    The number by which the spacing is divided follows from the bound and its fall with the
    spacing, to the power of 1.6. Lines are kept, and only those between them are added. The
    tolerance holds at `slant_range`; a far-field image has the error `ncti.render.far_field_error`
    besides at any finite range.

    Examples
    --------
    Lines for an error of 10 %, 1 % and 0.1 % in the profile of a destroyer:

    >>> import ncti
    >>> from ncti.ladar import lines_within
    >>> ship = ncti.ships.load("duncan")
    >>> for tolerance in (0.1, 0.01, 0.001):
    ...     lines = lines_within(
    ...         ship, aspect=37, depression=3.84, tolerance=tolerance, pulse_width=30e-9
    ...     )
    ...     print(tolerance, lines.spacing)
    0.1 0.75
    0.01 0.375
    0.001 0.075
    """
    require("tolerance", tolerance, positive=True)
    require("pulse_width", pulse_width, minimum=0.0)
    half_window, bin_count = bins_of(window, bin_width)

    def binned(lines: LineImage) -> Floats:
        # One IFOV that holds the whole ship: the error does not depend on the tiling.
        return lines.bin(
            side=1e9,
            shift=(0.5, 0.5),
            near=-half_window,
            bin_width=bin_width,
            bin_count=bin_count,
        ).strands

    view: Any = {
        "aspect": aspect,
        "depression": depression,
        "roll": roll,
        "slant_range": slant_range,
    }
    require("spacing", spacing, positive=True)
    lines = line_image(mesh, spacing=_first(spacing), **view)
    goal = tolerance if slant_range is not None else SPARE * tolerance
    grown = _Grown.of(lines, binned)
    while factor := grown.factor(goal, pulse_width, bin_width, spacing=spacing):
        new = between(mesh, lines, factor)
        grown = grown.with_lines(new, binned)
        lines = merged(lines, new)
    return lines


def extent_within(
    mesh: trimesh.Trimesh,
    *,
    aspect: float,
    depression: float,
    slant_range: float,
    tolerance: float,
    pulse_width: float,
    roll: float = ROLL,
    ifov: float = 150e-6,
    bin_width: float = 1.0,
    window: float = 250.0,
    spacing: float = FIRST,
) -> RangeExtent:
    """Return the range extent of a ship, accurate to a tolerance.

    Parameters
    ----------
    mesh, aspect, depression, roll
        See `ncti.render.line_image`.
    slant_range, ifov, bin_width, window
        See `range_extent`.
    tolerance, pulse_width, spacing
        See `lines_within`; lines are at most an IFOV apart.

    Returns
    -------
    RangeExtent
        As `range_extent` of the image that `lines_within` returns, up to rounding.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    See Also
    --------
    lines_within : The lines themselves.
    range_extent : The extent of a view that is there.
    RangeExtent.error_after : The bound.

    Notes
    -----
    The ship is drawn at its range, unless `ncti.render.drawn_range` allows the far field. Each
    line is drawn and binned once: the extents of the first lines and of those added between them
    are summed.

    Examples
    --------
    >>> import ncti
    >>> from ncti.ladar import extent_within
    >>> ship = ncti.ships.load("duncan")
    >>> extent = extent_within(
    ...     ship,
    ...     aspect=37,
    ...     depression=3.84,
    ...     slant_range=100e3,
    ...     tolerance=0.001,
    ...     pulse_width=30e-9,
    ... )
    >>> extent.error_after(30e-9) < 0.001
    True
    """
    require("tolerance", tolerance, positive=True)
    require("pulse_width", pulse_width, minimum=0.0)
    require("slant_range", slant_range, positive=True, maximum=FARTHEST)
    require("ifov", ifov, positive=True, maximum=1.0)
    require("spacing", spacing, positive=True)
    drawn = drawn_range(Surfaces.of(mesh).reach, slant_range, tolerance=tolerance)
    goal = sampling_tolerance(tolerance, drawn)
    parts: list[tuple[LineImage, RangeExtent]] = []

    def binned(lines: LineImage) -> Floats:
        found = binned_extent(
            lines, slant_range=slant_range, ifov=ifov, bin_width=bin_width, window=window
        )
        parts.append((lines, found))
        assert found.strands is not None  # as of lines
        return found.strands

    view: Any = {"aspect": aspect, "depression": depression, "roll": roll, "slant_range": drawn}
    spacing = min(spacing, ifov * slant_range)
    lines = line_image(mesh, spacing=_first(spacing), **view)
    grown = _Grown.of(lines, binned)
    while factor := grown.factor(goal, pulse_width, bin_width, spacing=spacing):
        lines = between(mesh, lines, factor)
        grown = grown.with_lines(lines, binned)
    return _sum(parts, grown)


@dataclass(frozen=True)
class _Grown:
    """Strands of lines to which others were added.

    Attributes
    ----------
    lines : LineImage
        Those added last, which have the spacing of all.
    strands : (16, bin) float64 ndarray
        See `ncti.render.pieces.Parts`.
    first, last : int
        Numbers of the first and the last line that sees the ship; 0 and -1 if none does.
    """

    lines: LineImage
    strands: Floats
    first: int
    last: int

    @classmethod
    def of(cls, lines: LineImage, binned: Callable[[LineImage], Floats]) -> _Grown:
        """Return the strands of lines."""
        return cls(lines, binned(lines), *_ends(lines))

    def with_lines(self, new: LineImage, binned: Callable[[LineImage], Floats]) -> _Grown:
        """Return the strands with those of the lines `between`."""
        factor = round(self.lines.spacing / new.spacing)
        kept = math.floor(factor * self.lines.phase)
        strands = binned(new)
        # Line k has the number factor k + kept now, and stands for a narrower strip.
        at = (factor * np.arange(STRANDS) + kept) % STRANDS
        np.add.at(strands, at, self.strands / factor)
        first, last = _ends(new)
        if self.count:
            before = factor * self.first + kept, factor * self.last + kept
            first = min(first, before[0]) if new.line.size else before[0]
            last = max(last, before[1])
        return _Grown(new, strands, first, last)

    @property
    def count(self) -> int:
        """Lines across the ship."""
        return self.last - self.first + 1

    def factor(
        self, goal: float, pulse_width: float, bin_width: float, *, spacing: float = math.inf
    ) -> int:
        """Return the number to divide the spacing by; 0 if the lines suffice or are the finest."""
        least = self.lines.spacing / spacing * (1 - 1e-9)
        error = sampling_error(self.strands, self.count, pulse_width, bin_width=bin_width)
        if error <= goal and self.count >= FEWEST and least <= 1:
            return 0
        most = math.floor(self.lines.spacing / min(FINEST, spacing) * (1 + 1e-9))
        if most < 2:
            return 0
        if self.count > 0:
            least = max(least, FEWEST / self.count)
        if error > goal:
            error /= scarcity(self.count)  # there will be more lines
            least = max(least, (error / (AIM * goal)) ** (1 / SLOPE))
        return max(math.ceil(min(least, most)), 2)


def _first(spacing: float) -> float:
    """Return the distance between the lines drawn first, a whole multiple of the largest [m]."""
    return spacing * max(1, math.floor(FIRST / spacing))


def _ends(lines: LineImage) -> tuple[int, int]:
    """Return the numbers of the first and the last line that sees the ship; 0 and -1 if none."""
    return (int(lines.line[0]), int(lines.line[-1])) if lines.line.size else (0, -1)


def _sum(parts: list[tuple[LineImage, RangeExtent]], grown: _Grown) -> RangeExtent:
    """Return the extent of all lines from the extents of those added one after another."""
    last = parts[-1][1]
    cells = np.concatenate([found.cell for _, found in parts])
    order, which = np.unique(cells[:, ::-1], axis=0, return_inverse=True)
    fraction = np.zeros((len(order), len(last.down_range)))
    begin = 0
    for lines, found in parts:
        rows = which.reshape(-1)[begin : begin + len(found.cell)]
        fraction[rows] += found.fraction * (grown.lines.spacing / lines.spacing)
        begin += len(found.cell)
    return replace(
        last,
        fraction=fraction,
        cell=np.ascontiguousarray(order[:, ::-1]),
        strands=grown.strands,
        line_count=grown.count,
        far_field_error=max(found.far_field_error for _, found in parts),
    )
