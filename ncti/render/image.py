"""Range images and their pixel lattices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.labels import labelled_array
from ncti.render.view import cos_sin

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Range image of a ship: range and slope of every pixel.

    The pixel lattice is rolled about the line of sight by `roll`, so rows and columns are
    not horizontal and vertical; `cross_range` gives the unrolled coordinates.

    Attributes
    ----------
    down_range : (row, col) float64 ndarray
        Down-range coordinate [m], 0 at the ship origin, growing away from the sensor; NaN
        where the line of sight meets nothing. With a finite `slant_range` it is the exact
        distance to the sensor less `slant_range` (wavefront curvature included); without
        one it is the far-field coordinate -p.u.
    gradient : (row, col, 2) float32 ndarray
        Derivative of down-range along the image axes (column, row) [m/m] on the surface
        that the pixel centre hits; NaN where `down_range` is.
    pixel : float
        Pixel side, measured at the range of the ship origin [m].
    origin : (float, float)
        Coordinates of the centre of pixel [0, 0] along the image axes (column, row) [m],
        from the point where the line of sight through the ship origin meets the image.
        Row 0 is the lowest one.
    aspect, depression, roll : float
        View angles [deg].
    slant_range : float or None
        Distance from the sensor to the ship origin [m]; None in the far field.

    See Also
    --------
    range_image : Draws one.
    LineImage : The same along lines.
    ncti.ladar.range_extent, ncti.infrared.silhouette : What sensors resolve of it.

    Examples
    --------
    >>> import trimesh
    >>> from ncti.render import range_image
    >>> box = trimesh.creation.box((40.0, 8.0, 6.0))
    >>> image = range_image(box, aspect=90, depression=0, pixel=0.5, engine="embree")
    >>> area = image.hit.sum() * image.pixel**2  # of its side, 240 m^2
    >>> abs(float(area) - 240) < 5
    True
    >>> image.to_xarray().down_range.attrs["units"]
    'm'
    """

    down_range: NDArray[np.float64]
    gradient: NDArray[np.float32]
    pixel: float
    origin: tuple[float, float]
    aspect: float
    depression: float
    roll: float
    slant_range: float | None = None

    @property
    def hit(self) -> NDArray[np.bool_]:
        """(row, col) bool ndarray: True where the line of sight meets the ship."""
        return ~np.isnan(self.down_range)

    @property
    def resolution(self) -> float:
        """Pixel side [m], the least width of an IFOV."""
        return self.pixel

    def cross_range(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return horizontal and vertical coordinates of the pixel centres.

        Returns
        -------
        horizontal, vertical : (row, col) float64 ndarray
            Metres along `right` and `up` of the unrolled view, at the range of the ship
            origin (angle times slant range, when that is finite).
        """
        rows, cols = self.down_range.shape
        return self.cross_range_at(np.arange(rows)[:, None], np.arange(cols))

    def cross_range_at(
        self, rows: NDArray[np.integer], cols: NDArray[np.integer]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return horizontal and vertical coordinates [m] of some pixels, as `cross_range`."""
        column = self.origin[0] + self.pixel * cols
        row = self.origin[1] + self.pixel * rows
        cos, sin = cos_sin(self.roll)
        return column * cos - row * sin, column * sin + row * cos

    def to_xarray(self) -> xr.Dataset:
        """Return the image as an xarray data set with units, on its own (rolled) axes."""
        import xarray as xr

        rows, cols = map(np.arange, self.down_range.shape)
        horizontal, vertical = self.cross_range()
        image, along = ("row", "col"), "cross-range along the"
        return xr.Dataset(
            {
                "down_range": labelled_array(
                    image, self.down_range, "m", "down-range from the ship origin"
                ),
                "gradient": labelled_array(
                    (*image, "axis"), self.gradient, "1", "slope of down-range along the image axes"
                ),
            },
            coords={
                "row": labelled_array(
                    "row", self.origin[1] + self.pixel * rows, "m", f"{along} rows' axis"
                ),
                "col": labelled_array(
                    "col", self.origin[0] + self.pixel * cols, "m", f"{along} columns' axis"
                ),
                "axis": ("axis", ["col", "row"]),
                "horizontal": labelled_array(image, horizontal, "m", "horizontal cross-range"),
                "vertical": labelled_array(image, vertical, "m", "vertical cross-range"),
            },
            attrs={
                "aspect_deg": self.aspect,
                "depression_deg": self.depression,
                "roll_deg": self.roll,
                "pixel_m": self.pixel,
                # netCDF and zarr attributes have no None: infinity is the far field.
                "slant_range_m": np.inf if self.slant_range is None else self.slant_range,
            },
        )
