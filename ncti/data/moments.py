"""Exact mean and covariance of the views of a data set, for classifiers trained without noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ncti.data.views import drawing_range
from ncti.labels import labelled_array
from ncti.ladar.beam import Beam, Signal
from ncti.ladar.budget import power_ratio
from ncti.ladar.expected import expected_profile
from ncti.ladar.extent import range_extent
from ncti.ladar.moments import banded_frame_moments
from ncti.ladar.places import TEMPLATE_PLACES, spread_place
from ncti.render import line_image
from ncti.simulate.subject import read_ship, roll_at

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]

VIEW_KEYS = ("ship", "variant", "aspect", "depression", "slant_range", "pulse_width", "cnr")


def moments(rows: xr.Dataset, *, places: int = TEMPLATE_PLACES) -> xr.Dataset:
    """Return the mean and covariance of one frame of each view of a data set.

    Parameters
    ----------
    rows : xarray.Dataset
        Rows of `ncti.dataset` or of a split, of ships that have names.
    places : int
        Number of places of the ship on the IFOVs: the corner, and others spread evenly.

    Returns
    -------
    xarray.Dataset
        `mean` (view, place, down_range) and `covariance` (view, lag, down_range), a lower band as
        `ncti.ladar.banded_frame_moments` returns it, at the first place, of the nominal gain and
        floor, with the ship and the parameters of the view's first row.

    See Also
    --------
    ncti.classify.GaussianTemplates : Classifier of such moments.
    ncti.dataset : Rows, each at a place of its own.

    Notes
    -----
    The moments are the limit of infinitely many draws of these views.

    Examples
    --------
    >>> import ncti
    >>> rows = ncti.dataset(["duncan"], 4, seed=0, rows_per_view=2)
    >>> table = ncti.data.moments(rows)
    >>> table.sizes["view"], table["mean"].dims
    (2, ('view', 'place', 'down_range'))
    """
    import xarray as xr

    views, first = np.unique(rows.view.values, return_index=True)
    pairs = [_moments(rows.isel(row=k), places) for k in first.tolist()]
    means, bands = zip(*pairs, strict=True)
    covariance = np.zeros((len(bands), max(map(len, bands)), rows.sizes["down_range"]))
    for target, band in zip(covariance, bands, strict=True):
        target[: len(band)] = band
    coords = {
        name: ("view", rows[name].values[first], rows[name].attrs)
        for name in VIEW_KEYS
        if name in rows.coords
    }
    coords["view"] = ("view", views, rows.view.attrs)
    coords["down_range"] = rows.down_range
    return xr.Dataset(
        {
            "mean": labelled_array(
                ("view", "place", "down_range"), np.array(means), "1", "mean of a frame"
            ),
            "covariance": labelled_array(
                ("view", "lag", "down_range"), covariance, "1", "covariance of bins a lag apart"
            ),
        },
        coords,
        rows.attrs,
    )


def _moments(row: xr.Dataset, places: int) -> tuple[list[Floats], Floats]:
    """Return the means (bin,) of a view at `places` places, and its covariance (lag, bin)."""
    centres, attributes = row.down_range.values, row.attrs
    bin_width = float(centres[1] - centres[0])
    aspect, depression, slant_range, pulse_width, cnr = (float(row[name]) for name in VIEW_KEYS[2:])
    mesh = read_ship(row["variant" if "variant" in row.coords else "ship"].item())
    beam = Beam(attributes["ifov_urad"] * 1e-6, bin_width, bin_width * len(centres))
    signal = vars(Signal(pulse_width, power_ratio(cnr), attributes["target_free_ifovs"]))
    # The lines of `ncti.data.views`, at most an IFOV apart.
    image = line_image(
        mesh,
        aspect=aspect,
        depression=depression,
        slant_range=drawing_range(mesh, slant_range, attributes["far_field_error"]),
        roll=roll_at(aspect),
        spacing=min(attributes["spacing_m"], beam.ifov * slant_range),
    )
    extents = [
        range_extent(image, slant_range=slant_range, shift=spread_place(number), **vars(beam))
        for number in range(places)
    ]
    means = [expected_profile(extent, **signal) for extent in extents]
    return means, banded_frame_moments(extents[0], **signal)[1]
